"""Certificates of direct/3 for tiny plants of one agent, in floats; nothing is shared with the project's producer.

The loop is written down in the original coordinates and transformed by numbers, the kernels are fitted to samples, and
the slopes of every plant are bounded by hand.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from math import ceil, exp, floor
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import linprog

Json = dict[str, Any]
Array = Any

RATE = Fraction(1, 2)  # of the coordinator y' = -y, and of its mixing
STEP = Fraction(1, 8)
STEPS = 160
PLANT = """
schema = "consensus-plant/1"
name = "tiny"
[network]
agents = 1
edges = []
{exosystem}
[initial]
x = [-{x0}, {x0}]
z = [-1, 1]
eta = 0
observer = {observer}
reference = [-{y0}, {y0}]
[[agent]]
ids = [1]
cost = "s^2/2"
{agent}
"""


@dataclass(frozen=True)
class Tiny:
    """One agent with ``s* = 0`` and ``b0 = 1``; ``z_size`` is above ``|z*|``.

    ``slopes(|z|, x̂, Y)`` are ``[lo, hi]`` of the slopes of every ``f0`` in ``(z, x_1)`` and of ``f1`` in ``(z, x)``.
    ``start`` are the magnitudes of ``z̄, x̄, η̄`` at 0.
    """

    agent: str
    n: int
    claim: Json
    slopes: Callable[[Array, Array, float], tuple[Any, Any]]
    start: tuple[float, ...]
    x0: Fraction = Fraction(1)
    y0: Fraction = Fraction(1, 2)
    nz: int = 0
    z_size: float = 0.0
    exosystem: str = ""
    steady_state: tuple[str, ...] = ()
    ell: tuple[int, ...] = ()
    f0: tuple[tuple[int, ...], ...] = ()
    b_radius: float = 0.0
    T1: Fraction = Fraction(0)
    steps: int = 0
    ranges: int = 0
    measured: bool = False
    grid_end: float = 21.0

    @property
    def f1(self) -> tuple[int, ...]:
        """The nominal slopes: 1 in ``z``, 0 in ``x``."""
        return (1,) * self.nz + (0,) * self.n

    @property
    def toml(self) -> bytes:
        return (
            PLANT.format(
                x0=f'"{self.x0}"',
                y0=f'"{self.y0}"',
                agent=self.agent,
                exosystem=self.exosystem,
                observer='"measured"' if self.measured else 0,
            )
            .replace('[-"', '["-')
            .encode()
        )


def first_order() -> Tiny:
    claim = {"g": 1, "K": 6, "delta": 12, "h": None, "gamma": [], "observer": [], "M": [], "N": [], "psi": []}
    agent = 'order = 1\nf = "p*x1 + x1^3/10"\nb = "1 + q"\nuncertain = { p = [-0.1, 0.1], q = [-0.1, 0.1] }'
    return Tiny(agent, 1, claim, lambda z, x, Y: ([], [[-0.1, 0.1 + (x[0] + Y) ** 2 / 10]]), (1.5,), b_radius=0.1)


def saturated() -> Tiny:
    """The same with an input that is too small at first."""
    tiny = first_order()
    return replace(tiny, claim={**tiny.claim, "delta": 5}, T1=Fraction(1, 2), steps=16)


def tight() -> Tiny:
    """Nothing but a linear loop, an input gain and a saturation, of which the worst case is simulated at a corner."""
    agent = 'order = 1\nf = "p*x1"\nb = "1 + q"\nuncertain = { p = [-1, 1], q = [-0.1, 0.1] }'
    claim = {**first_order().claim, "delta": 3}
    return Tiny(
        agent,
        1,
        claim,
        lambda z, x, Y: ([], [[-1, 1]]),
        (1.0,),
        y0=Fraction(0),
        b_radius=0.1,
        T1=Fraction(1, 2),
        steps=32,
    )


def slow() -> Tiny:
    """A loop that is slower than the coordinator's tail."""
    claim = {"g": 1, "K": 0.25, "delta": 12, "h": None, "gamma": [], "observer": [], "M": [], "N": [], "psi": []}
    return Tiny(
        'order = 1\nf = "x1^3/1000"\nb = 1', 1, claim, lambda z, x, Y: ([], [[0, (x[0] + Y) ** 2 / 1000]]), (1.5,)
    )


def second_order() -> Tiny:
    """With a first phase: the observer starts at 0, and so its error at ``h|x_1|``."""
    claim = {"g": 1, "K": 8, "delta": 40, "h": 256, "gamma": [1], "observer": [2, 3], "M": [], "N": [], "psi": []}

    def slopes(z: Array, x: Array, Y: float) -> tuple[Any, Any]:
        size = 0.1 + (x[0] + Y) / 10
        return [], [[0, 0], [-size, size]]

    return Tiny(
        'order = 2\nf = "p*x2 + x1*x2/10"\nb = 1\nuncertain = { p = [-0.1, 0.1] }',
        2,
        claim,
        slopes,
        (0.5, 0.25),
        x0=Fraction(1, 4),
        y0=Fraction(1, 4),
        T1=Fraction(1, 20),
        steps=24,
    )


def measured() -> Tiny:
    """The same without a first phase: the observer starts at the measured output."""
    return replace(second_order(), T1=Fraction(0), steps=0, measured=True)


def third_order() -> Tiny:
    """``θ = (1, 2, 1)``, and an uncertain input gain."""
    claim = {"g": 1, "K": 4, "delta": 30, "h": 256, "gamma": [1, 2], "observer": [1, 3, 3], "M": [], "N": [], "psi": []}

    def slopes(z: Array, x: Array, Y: float) -> tuple[Any, Any]:
        size = (x[0] + Y) / 10
        return [], [[0, 0], [-size, size], [-0.1, 0.1]]

    return Tiny(
        'order = 3\nf = "p*x3 + x1*x2/10"\nb = "1 + q"\nuncertain = { p = [-0.1, 0.1], q = [-0.05, 0.05] }',
        3,
        claim,
        slopes,
        (0.375, 0.125, 0.125),
        x0=Fraction(1, 8),
        y0=Fraction(1, 4),
        b_radius=0.05,
        T1=Fraction(1, 10),
        steps=40,
    )


def with_exosystem() -> Tiny:
    """``z' = −z + x1 + v1``: ``z* = s + (v1 − v2)/2`` and ``u* = −(3v1 − v2)/(2b)``."""
    claim = {
        "g": 1,
        "K": 6,
        "delta": 40,
        "h": None,
        "gamma": [],
        "observer": [],
        "M": [[0, 1], [-2, -3]],
        "N": [0, 1],
        "psi": [1, 3],
    }
    exosystem = '[exosystem]\nstates = ["v1", "v2"]\nS = [[0, 1], [-1, 0]]\ninitial = { v1 = 0, v2 = 1 }'
    agent = 'order = 1\nzero_dynamics = { z1 = "-z1 + x1 + v1" }\nf = "z1 + v1 + z1*x1/10"\nb = "1 + q"'
    agent += "\nuncertain = { q = [-0.05, 0.05] }"
    psi, F = np.array([[1.0, 3.0]]), np.array([[0.0, 1.0], [-1.0, 0.0]])
    T, tau = np.linalg.inv(np.vstack([psi, psi @ F])), np.array([0.5, -1.5])
    eta = np.abs(T @ tau) + 0.06 * np.abs(T) @ np.abs(tau)
    return Tiny(
        agent,
        1,
        claim,
        lambda z, x, Y: ([[[-1, -1], [1, 1]]], [[1, 1], [-z[0] / 10, z[0] / 10]]),
        (1.5, 1.5, *eta),
        nz=1,
        z_size=1.0,
        exosystem=exosystem,
        steady_state=("s + (v1 - v2)/2",),
        ell=(-1, 0),
        f0=((-1, 1),),
        b_radius=0.05,
        T1=Fraction(1, 16),
        steps=8,
        ranges=30,
    )


def text(value: float | Fraction) -> str:
    """A number of the certificate, rounded up to 48 bits after the point."""
    return str(value if isinstance(value, Fraction) else Fraction(ceil(value * 2.0**48), 2**48))


def texts(value: Any) -> Any:
    if value is None:
        return None
    return [texts(entry) for entry in value] if isinstance(value, (list, tuple, np.ndarray)) else text(Fraction(value))


def loop(tiny: Tiny) -> tuple[Array, Array, Array]:
    """``A``, the columns of ``q`` and the outputs, from the loop of ``(z, x, η, x~)`` with ``y^r = 0``."""
    c, n, nz, s = tiny.claim, tiny.n, tiny.nz, len(tiny.ell)
    observer = n if n > 1 else 0
    size = nz + n + s + observer
    eye = np.eye(size)
    theta = np.zeros(size)
    for k, gamma in enumerate([*c["gamma"], 1]):
        theta[(nz + n + s if observer else nz) + k] = c["g"] ** (n - 1 - k) * gamma
    psi = np.zeros(size)
    psi[nz + n : nz + n + s] = c["psi"]
    u = psi - c["K"] * theta
    f = np.zeros(size)
    f[: nz + n] = tiny.f1
    rows = [np.concatenate([row, np.zeros(size - nz - 1)]) for row in tiny.f0]
    rows += [eye[nz + k + 1] for k in range(n - 1)] + [f + u]
    for j in range(s):
        own = np.zeros(size)
        own[nz + n : nz + n + s] = c["M"][j]
        rows.append(own + c["N"][j] * u)
    for k in range(observer):
        following = eye[nz + n + s + k + 1] if k + 1 < n else np.zeros(size)
        rows.append(following + c["h"] ** (k + 1) * c["observer"][n - 1 - k] * (eye[nz] - eye[nz + n + s]))
    S = np.eye(size)
    for k in range(observer):
        S[nz + n + s + k] = c["h"] ** (n - 1 - k) * (eye[nz + k] - eye[nz + n + s + k])
    inverse = np.linalg.inv(S)
    A = S @ np.array(rows) @ inverse
    columns = [eye[k] for k in range(nz)] + [S @ eye[nz + n - 1], -eye[nz]]
    outputs = [eye[k] @ inverse for k in range(nz + n)] + [theta @ inverse, u @ inverse]
    return A, np.array(columns).T, np.array(outputs)


def starts(tiny: Tiny, size: int) -> Array:
    """``X`` from ``Y = (z̄, x̄_1 … x̄_(n−1), ϑ, ζ, e)``: the inverse of the definition of ``Y``."""
    last = tiny.nz + tiny.n - 1
    Y = np.eye(size)
    Y[last, tiny.nz : last + 1] = thetas(tiny)
    Y[last + 1 : last + 1 + len(tiny.ell), last] = -np.array(tiny.claim["N"], dtype=float)
    return np.linalg.inv(Y)


def thetas(tiny: Tiny) -> Array:
    c = tiny.claim
    return np.array([c["g"] ** (tiny.n - 1 - k) * gamma for k, gamma in enumerate([*c["gamma"], 1])], dtype=float)


def modes(A: Array) -> tuple[Array, list[str], Array]:
    """``H``, the blocks, and the eigenvalues with nonnegative imaginary part."""
    values, vectors = np.linalg.eig(A)
    columns, blocks, kept = [], [], []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag == 0:
            columns.append(vector.real)
            blocks.append("1")
        elif value.imag > 0:
            columns += [vector.real, vector.imag]
            blocks.append("2")
        if value.imag >= 0:
            kept.append(value)
    return np.array(columns).T, blocks, np.array(kept)


def majorants(A: Array, outputs: Array, columns: Array, rates: Array, fastest: float, slowest: float) -> Array:
    """Coefficients by linear programs on cells somewhat wider than needed."""
    ends = [1 / (64 * fastest)]
    while ends[-1] < 45 / slowest:
        ends.append(ends[-1] * 1.032)
    D, V = np.linalg.eig(A)
    left, right = outputs @ V, np.linalg.solve(V, columns)
    values = [np.abs(left @ (np.exp(D * t)[:, None] * right)) for t in np.concatenate([[0.0], ends])]
    peaks = np.array([np.maximum(a, b) for a, b in pairwise(values)])
    basis = np.exp(-np.outer(np.array(ends) * 1.04, rates))
    result = np.zeros((*peaks.shape[1:], len(rates)))
    for i in range(peaks.shape[1]):
        for j in range(peaks.shape[2]):
            needed = 1.02 * peaks[:, i, j] + 1e-7 * np.exp(-rates[0] * np.array(ends)) * (1 + peaks[:, i, j].max())
            scale = needed.max()
            chosen = np.zeros(len(ends), dtype=bool)
            chosen[::20] = True
            while True:  # more rows of the linear program as long as one is violated
                found = linprog(1 / rates, A_ub=-basis[chosen] / scale, b_ub=-needed[chosen] / scale, bounds=(0, None))
                assert found.status == 0, (i, j, found.message)
                violated = basis @ found.x * 1.001 < needed
                if not violated.any():
                    break
                chosen |= violated
            result[i, j] = found.x * 1.001 + 1e-12
    return result


def weighed(slopes: Any, shift: Any, sizes: Array) -> float:
    """``Σ mag(D + shift)·size``"""
    D = np.array(slopes, dtype=float).reshape(-1, 2)
    return float(np.abs(D + np.array(shift, dtype=float)[:, None]).max(axis=1) @ sizes)


def produce(tiny: Tiny) -> Json:
    """A certificate that should be verified."""
    c, n, nz, s = tiny.claim, tiny.n, tiny.nz, len(tiny.ell)
    A, inputs, outputs = loop(tiny)
    H, blocks, values = modes(A)
    decays = sorted(-values.real)
    rates = np.array([0.9 * decays[0], *(d for before, d in pairwise(decays) if d > 1.3 * before)])
    columns = np.hstack([inputs, starts(tiny, len(A))])
    kernels = majorants(A, outputs, columns, rates, max(abs(values)), decays[0])
    y0, rate = float(tiny.y0), float(RATE)

    def reach(t: float) -> float:
        """``|y^r − s*|`` and ``|ẏ^r|`` from the coordinator's step that holds ``t`` on."""
        return 1.001 * y0 * exp(-rate * float(STEP) * min(floor(t / float(STEP)), STEPS)) + 1e-9

    phase, start, widths = first_phase(tiny, reach(0.0))
    p = np.einsum("ila,l->ia", kernels[:, nz + 2 :, :], start) * 1.0001 + 1e-12

    def push(box: Array, Y: float) -> Array:
        """``Σ_j c_ija q_j``"""
        by_f0, by_f1 = tiny.slopes(tiny.z_size + box[:nz], box[nz : nz + n], Y)
        q = [
            weighed(row, -np.array(f0), box[: nz + 1]) + np.abs(row[-1]).max() * Y
            for row, f0 in zip(by_f0, tiny.f0, strict=True)
        ]
        q.append(weighed(by_f1, -np.array(tiny.f1), box[: nz + n]) + np.abs(by_f1[nz]).max() * Y)
        q[-1] += tiny.b_radius * box[-1]
        return np.einsum("ija,j->ia", kernels[:, : nz + 2, :], np.array([*q, Y])) * 1.0001

    T1 = float(tiny.T1)
    grid = [T1]
    while grid[-1] < tiny.grid_end:
        grid.append(grid[-1] + max(0.02, (grid[-1] - T1) / 16))
    grid = [tiny.T1, *(Fraction(floor(t * 2**20), 2**20) for t in grid[1:])]
    boxes = []
    for a, b in pairwise(grid):
        Y, e, box = reach(float(a)), np.exp(-rates * float(b - a)), p.sum(axis=1) * 1.01
        for _ in range(200):
            after = e * p + (1 - e) * push(box, Y) / rates
            needed = np.maximum(p, after).sum(axis=1)
            if (needed <= box).all():
                break
            box = needed * 1.01 + 1e-9
        else:
            raise AssertionError(f"no tube at {float(a)}: {box}")
        assert c["K"] * box[nz + n] <= c["delta"], (float(a), box)
        boxes.append(box * 1.001)
        p = e * p + (1 - e) * push(box * 1.001, Y) / rates
        if len(widths) < tiny.ranges:
            widths.append(wider(widths[-1], float(b - a), box[nz] * 1.001 + Y))
    rho = min(float(RATE) / 2, rates[0]) * 0.8
    box, Y = p.sum(axis=1) * 1.5, 3 * reach(float(grid[-1]))
    for _ in range(200):
        needed = (p + push(box, Y) / (rates - rho)[None, :]).sum(axis=1)
        if (needed <= box).all():
            break
        box = needed * 1.01
    else:
        raise AssertionError("no tail")
    agent = {
        "id": "1",
        "steady_state": list(tiny.steady_state),
        "ell": texts(tiny.ell),
        "nominal": {"f0": texts(tiny.f0), "f1": texts(tiny.f1), "b": "1"},
        "modes": [[text(float(entry)) for entry in row] for row in H],
        "blocks": blocks,
        "rates": [text(float(mu)) for mu in rates],
        "kernels": [[[text(float(entry)) for entry in entries] for entries in row] for row in kernels],
        "phase1": phase,
        "ranges": [[[text(-r), text(r)]] for r in widths],
        "grid": [text(t) for t in grid],
        "boxes": [[text(float(entry)) for entry in row] for row in boxes],
        "tail": {"box": [text(1.001 * float(entry)) for entry in box], "rate": text(float(rho))},
    }
    return {
        "schema": "consensus-certificate/1",
        "theorem": "direct/3",
        "producer": {},
        "claim": {
            "plant_sha256": hashlib.sha256(tiny.toml).hexdigest(),
            "alpha1": "1",
            "alpha2": "1",
            "gradient_gain": "1",
            "mixing_gain": "1",
            "mixing_time": "0",
            "softening": "0",
            "agents": [
                {
                    "id": "1",
                    **{key: texts(value) for key, value in c.items()},
                    "requirements": {"settling": None, "input": None, "bandwidth": None},
                }
            ],
        },
        "witness": {
            "optimum": ["0", "0"],
            "left_null_vector": ["1"],
            "exosystem": {"Q": [["1", "0"], ["0", "1"]]} if s else None,
            "coordinator": {
                "P": [["1"]],
                "multiplier": ["1/2"],
                "rate": str(RATE),
                "mixing_rate": str(RATE),
                "step": str(STEP),
                "steps": str(STEPS),
            },
            "agents": [agent],
        },
    }


def wider(width: float, length: float, x1: float) -> float:
    """``|z| ≤ width`` after a step of ``z' = −z + x1 + v1``, ``|v1| ≤ 1``."""
    return width + 1.01 * length * max(0.0, x1 + 1 - width) + 1e-6


def first_phase(tiny: Tiny, Y: float) -> tuple[Json, Array, list[float]]:
    """The witness, magnitudes of ``Y`` at ``T1``, and ranges of ``z``; ``Y`` bounds the reference all along."""
    n, nz, error = tiny.n, tiny.nz, Error(tiny)
    theta, N = thetas(tiny), np.abs(np.array(tiny.claim["N"], dtype=float))
    low, high = 1 - tiny.b_radius, 1 + tiny.b_radius
    z, x, eta = np.split(np.array(tiny.start, dtype=float), [nz, nz + n])
    ball, zeta, fastest = float(theta @ x), eta + N * x[-1] / low, 0.0
    grid = [tiny.T1 * k / max(tiny.steps, 1) for k in range(tiny.steps + 1)]
    boxes, ends = [], []
    widths: list[float] = []
    for a, b in pairwise(grid):
        length, box, end = float(b - a), np.array([*z, *x, ball, *zeta]), ball
        for _ in range(500):
            Bx, Bt = box[nz : nz + n], box[nz + n]
            dz, F, P, dzeta = speeds(tiny, box, Y)
            reached, epsilon, u = steered(tiny, error, float(a), fastest, F, Bt)
            found = max(1e-6, ball + length * drawn(tiny, min(ball, end), P, epsilon))
            settled = found <= end <= 1.001 * found + 1e-6
            end = end if settled else found * 1.0002 + 1e-7
            dx = np.append(Bx[1:], F + high * u)
            if n > 1:
                to_theta = Bt + theta[: n - 2] @ Bx[: n - 2] - theta[n - 2] * x[n - 2]
                dx[n - 2] = min(dx[n - 2], max(0.0, to_theta))
                dx[0] += Y
            after = x + length * dx
            during = np.append(after[:-1], min(after[-1], Bt + theta[:-1] @ Bx[:-1]))
            needed = np.array([*(z + length * dz), *during, max(ball, end), *(zeta + length * dzeta)])
            if settled and (needed * 1.0001 <= box).all():
                break
            box = np.maximum(needed * 1.0005 + 1e-8, box)
        else:
            raise AssertionError(f"no box at {float(a)}: {box}")
        z, ball, zeta, fastest = (z + length * dz) * 1.0001, end, (zeta + length * dzeta) * 1.0001, reached * 1.0001
        x = after * 1.0001
        x[-1] = min(x[-1], ball + theta[:-1] @ x[:-1])
        boxes.append(texts(box))
        ends.append(text(ball))
        if tiny.ranges:
            widths.append(wider(widths[-1] if widths else 1.0, length, box[nz] + Y))
    at_end = error.at(float(tiny.T1), fastest) if tiny.steps else error.start
    start = np.array([*z, *x[:-1], ball, *(zeta + N * (1 / low - 1) * x[-1]), *at_end])
    return {"grid": [str(t) for t in grid], "boxes": boxes, "vartheta": ends}, start * 1.0001, widths


def speeds(tiny: Tiny, box: Array, Y: float) -> tuple[Array, float, float, Array]:
    """Bounds of ``|z̄'|``, ``|x̄_n' − bū|``, ``|ϑ' − bū|``, ``|ζ'|`` over a box of ``z̄, x̄, ϑ, ζ``."""
    n, nz, s = tiny.n, tiny.nz, len(tiny.ell)
    N, psi = (np.array(tiny.claim[key], dtype=float) for key in ("N", "psi"))
    M, theta, states = np.array(tiny.claim["M"], dtype=float).reshape(s, s), thetas(tiny), box[: nz + n]
    f0, f1 = tiny.slopes(tiny.z_size + box[:nz], states[nz:], Y)
    low, high, own = 1 - tiny.b_radius, 1 + tiny.b_radius, Y if n == 1 else 0.0
    outer, last = np.abs(f1[nz]).max() * Y, np.eye(nz + n)[-1]
    rest, zeta = outer + high * np.abs(psi) @ box[nz + n + 1 :], np.abs(M) @ box[nz + n + 1 :]
    chain = np.concatenate([np.zeros(nz + 1), theta[:-1]])
    dz = [weighed(row, [0] * (nz + 1), box[: nz + 1]) + np.abs(row[-1]).max() * Y for row in f0]
    by_f1 = [
        weighed(N[i] * np.array(f1, dtype=float), -(M @ N)[i] * last, states) + abs(N[i]) * (outer + own)
        for i in range(s)
    ]
    return (
        np.array(dz),
        weighed(f1, psi @ N * last, states) + rest + own,
        weighed(f1, psi @ N * last + chain, states) + rest + theta[0] * Y,
        zeta + np.array(by_f1) / low,
    )


def steered(tiny: Tiny, error: Error, t: float, fastest: float, F: float, theta: float) -> tuple[float, float, float]:
    """``X2``, ``ε``, ``u``"""
    u = delta = tiny.claim["delta"]
    for _ in range(2):
        reached = max(fastest, F + (1 + tiny.b_radius) * u)
        epsilon = float(error.gain @ error.at(t, reached))
        u = min(delta, tiny.claim["K"] * (theta + epsilon))
    return reached, epsilon, u


def drawn(tiny: Tiny, theta: float, P: float, epsilon: float) -> float:
    """The rate of ``|ϑ|`` at this size."""
    delta, argument = tiny.claim["delta"], tiny.claim["K"] * (theta - epsilon)
    b = 1 - tiny.b_radius if argument > 0 else 1 + tiny.b_radius
    return P - b * min(max(argument, -delta), delta)


class Error:
    """Bounds of the observer's error: sums over ``|e^(E3 jd)|``, to second order in ``d``."""

    def __init__(self, tiny: Tiny) -> None:
        c, n = tiny.claim, tiny.n
        self.h, size = c["h"], n if n > 1 else 0
        if not size:
            self.gain = self.start = np.zeros(0)
            return
        scale = np.array([float(self.h) ** (n - 1 - k) for k in range(n)])
        x0 = [0.0 if tiny.measured else float(tiny.x0), *[float(tiny.x0)] * (n - 1)]
        self.gain, self.start = thetas(tiny) / scale, scale * np.array(x0)
        E3 = np.eye(n, k=1)
        E3[:, 0] -= np.array(c["observer"][::-1], dtype=float)
        self.d = 2.0 ** floor(np.log2(1 / (4 * np.abs(E3).sum(axis=1).max())))
        d, powers = self.d, [np.eye(n)]
        while np.abs(powers[-1]).sum(axis=1).max() > 2.0**-64:
            powers.append(powers[-1] @ expm(E3 * d))
        later = expm(np.abs(E3) * d)
        terms = [(np.abs(E), d * np.abs(E3 @ E), d**2 * np.abs(E3 @ E3 @ E) @ later) for E in powers[:-1]]
        covers = np.array([a + b + c / 2 for a, b, c in terms])
        self.bounds = np.maximum.accumulate(covers[::-1])[::-1]
        self.area = d * sum(a + b / 2 + c / 6 for a, b, c in terms)[:, -1]

    def at(self, t: float, fastest: float) -> Array:
        if not self.start.size:
            return self.start
        j = floor(self.h * t / self.d * 0.9999)
        free = self.bounds[j] @ self.start if j < len(self.bounds) else 1e-15 * self.start.sum()
        return (free + self.area * fastest / self.h) * 1.0001


def encode(certificate: Json) -> bytes:
    return (json.dumps(certificate, sort_keys=True, separators=(",", ":")) + "\n").encode()
