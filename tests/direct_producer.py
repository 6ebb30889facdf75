"""Certificates of direct/1 for tiny plants of one agent, in floats; nothing is shared with the project's producer.

The loop is written down in the original coordinates and transformed by numbers, the kernels are fitted to samples, and
the forcing of every plant is bounded by hand.
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
from scipy.linalg import null_space
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
    """One agent with ``s* = 0``; ``increments(z, x, Y)`` bounds ``q_1 … q_nz`` and what is in ``q_f`` without ``b``."""

    agent: str
    n: int
    claim: Json
    increments: Callable[[Array, Array, float], list[float]]
    x0: Fraction = Fraction(1)
    y0: Fraction = Fraction(1, 2)
    nz: int = 0
    exosystem: str = ""
    steady_state: tuple[str, ...] = ()
    ell: tuple[int, ...] = ()
    f0: tuple[tuple[int, ...], ...] = ()
    f1: tuple[int, ...] = ()
    b_radius: float = 0.0
    start: tuple[float, ...] = ()
    f1_whole: Callable[[Array, Array, float], float] = lambda z, x, Y: 0.0
    T1: Fraction = Fraction(0)
    steps: int = 0
    measured: bool = False
    grid_end: float = 21.0

    @property
    def toml(self) -> bytes:
        return PLANT.format(x0=f'"{self.x0}"', y0=f'"{self.y0}"', agent=self.agent, exosystem=self.exosystem,
                            observer='"measured"' if self.measured else 0).replace('[-"', '["-').encode()


def first_order() -> Tiny:
    claim = {"g": 1, "K": 6, "delta": 12, "h": None, "gamma": [], "observer": [], "M": [], "N": [], "psi": []}
    agent = 'order = 1\nf = "p*x1 + x1^3/10"\nb = "1 + q"\nuncertain = { p = [-0.1, 0.1], q = [-0.1, 0.1] }'
    return Tiny(agent, 1, claim,
                lambda z, x, Y: [(0.1 + 0.3 * (x[0] + Y) ** 2) * (x[0] + Y)], f1=(0,), b_radius=0.1, start=(1.5,))


def slow() -> Tiny:
    """A loop that is slower than the coordinator's tail."""
    claim = {"g": 1, "K": 0.25, "delta": 12, "h": None, "gamma": [], "observer": [], "M": [], "N": [], "psi": []}
    return Tiny('order = 1\nf = "x1^3/1000"\nb = 1', 1, claim, lambda z, x, Y: [0.003 * (x[0] + Y) ** 3], f1=(0,),
                start=(1.5,))


def second_order() -> Tiny:
    """With a first phase: the observer starts at 0, and so its error at ``h|x_1|``."""
    claim = {"g": 1, "K": 8, "delta": 40, "h": 256, "gamma": [1], "observer": [2, 3], "M": [], "N": [], "psi": []}

    def part(z: Array, x: Array, Y: float) -> float:
        return float((0.1 + (x[0] + Y) / 10) * x[1])

    return Tiny('order = 2\nf = "p*x2 + x1*x2/10"\nb = 1\nuncertain = { p = [-0.1, 0.1] }', 2, claim,
                lambda z, x, Y: [part(z, x, Y)], x0=Fraction(1, 4), y0=Fraction(1, 4), f1=(0, 0), start=(0.5, 0.25),
                f1_whole=part, T1=Fraction(1, 20), steps=20)


def measured() -> Tiny:
    """The same without a first phase: the observer starts at the measured output."""
    return replace(second_order(), T1=Fraction(0), steps=0, measured=True, x0=Fraction(1, 4))


def with_exosystem() -> Tiny:
    """``z' = −z + x1 + v1``: ``z* = s + (v1 − v2)/2`` and ``u* = −(3v1 − v2)/2``."""
    claim = {"g": 1, "K": 6, "delta": 40, "h": None, "gamma": [], "observer": [],
             "M": [[0, 1], [-2, -3]], "N": [0, 1], "psi": [1, 3]}
    exosystem = '[exosystem]\nstates = ["v1", "v2"]\nS = [[0, 1], [-1, 0]]\ninitial = { v1 = 0, v2 = 1 }'
    agent = 'order = 1\nzero_dynamics = { z1 = "-z1 + x1 + v1" }\nf = "z1 + v1 + z1*x1/10"\nb = 1'
    psi, F = np.array([[1.0, 3.0]]), np.array([[0.0, 1.0], [-1.0, 0.0]])
    eta = np.abs(np.linalg.inv(np.vstack([psi, psi @ F])) @ np.array([0.5, -1.5]))
    return Tiny(agent, 1, claim, lambda z, x, Y: [Y, (1 + z[0]) / 10 * (x[0] + Y)], nz=1, exosystem=exosystem,
                steady_state=("s + (v1 - v2)/2",), ell=(-1, 0), f0=((-1, 1),), f1=(1, 0), start=(1.5, 1.5, *eta))


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
    outputs = [eye[k] @ inverse for k in range(nz + n)] + [theta @ inverse] + ([psi @ inverse] if s else [])
    return A, np.array(columns).T, np.array(outputs)


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


def produce(tiny: Tiny) -> Json:
    """A certificate that should be verified."""
    c, n, nz, s = tiny.claim, tiny.n, tiny.nz, len(tiny.ell)
    A, inputs, outputs = loop(tiny)
    H, blocks, values = modes(A)
    decays = sorted(-values.real)
    rates = np.array([0.9 * decays[0], *(d for before, d in pairwise(decays) if d > 1.3 * before)])
    columns = np.hstack([inputs, np.eye(len(A))])
    kernels = majorants(A, outputs, columns, rates, max(abs(values)), decays[0])
    y0, rate = float(tiny.y0), float(RATE)

    def reach(t: float) -> float:
        """``|y^r − s*|`` and ``|ẏ^r|`` from the coordinator's step that holds ``t`` on."""
        return 1.001 * y0 * exp(-rate * float(STEP) * min(floor(t / float(STEP)), STEPS)) + 1e-9

    X, P3, kappa = np.array(tiny.start, dtype=float), [], None
    if n > 1:
        P3, kappa = observer_norm(c)
        X = np.concatenate([X, first_phase(tiny, X, P3, kappa, reach)])
        X[: nz + n + s] = phase_end(tiny, X[: nz + n + s], reach)[0]
    p = np.einsum("ila,l->ia", kernels[:, nz + 2 :, :], X) * 1.0001 + 1e-12

    def push(box: Array, Y: float) -> Array:
        """``Σ_j c_ija q_j``"""
        steering = c["K"] * box[nz + n] + (box[nz + n + 1] if s else 0.0)
        q = tiny.increments(box[:nz], box[nz : nz + n], Y)
        q[-1] += tiny.b_radius * steering
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
    rho = min(float(RATE) / 2, rates[0]) * 0.8
    box, Y = p.sum(axis=1) * 1.5, 3 * reach(float(grid[-1]))
    for _ in range(200):
        needed = np.maximum(p, push(box, Y) / (rates - rho)[None, :]).sum(axis=1)
        if (needed <= box).all():
            break
        box = needed * 1.01
    else:
        raise AssertionError("no tail")
    agent = {
        "id": "1", "steady_state": list(tiny.steady_state), "ell": texts(tiny.ell),
        "nominal": {"f0": texts(tiny.f0), "f1": texts(tiny.f1), "b": "1"},
        "modes": [[text(float(entry)) for entry in row] for row in H], "blocks": blocks,
        "rates": [text(float(mu)) for mu in rates],
        "kernels": [[[text(float(entry)) for entry in entries] for entries in row] for row in kernels],
        "observer_norm": [[text(entry) for entry in row] for row in P3],
        "observer_rate": None if kappa is None else text(kappa),
        "phase1": {"duration": str(tiny.T1), "steps": str(tiny.steps)} if n > 1 else None,
        "grid": [text(t) for t in grid], "boxes": [[text(float(entry)) for entry in row] for row in boxes],
        "tail": {"box": [text(1.001 * float(entry)) for entry in box], "rate": text(float(rho))}}
    return {
        "schema": "consensus-certificate/1", "theorem": "direct/1", "producer": {},
        "claim": {"plant_sha256": hashlib.sha256(tiny.toml).hexdigest(), "alpha1": "1", "alpha2": "1",
                  "agents": [{"id": "1", **{key: texts(value) for key, value in c.items()}}]},
        "witness": {
            "optimum": ["0", "0"], "exosystem": {"Q": [["1", "0"], ["0", "1"]]} if s else None,
            "coordinator": {"P": [["1"]], "multiplier": ["1/2"], "rate": str(RATE), "mixing_rate": str(RATE),
                            "step": str(STEP), "steps": str(STEPS)},
            "agents": [agent]}}


def observer_norm(c: Json) -> tuple[list[list[Fraction]], Fraction]:
    """``P3 = RᵀR`` for the real eigenvectors of ``E3ᵀ``, rounded, and 0.9 of the least decay."""
    n = len(c["observer"])
    E3 = np.eye(n, k=1)
    E3[:, 0] -= np.array(c["observer"][::-1], dtype=float)
    rows = [null_space(E3.T - value.real * np.eye(n))[:, 0] for value in np.linalg.eigvals(E3)]
    P = sum(np.outer(row, row) for row in rows)
    exact = [[Fraction(round((P[i][j] + P[j][i]) * 2**20), 2**21) for j in range(n)] for i in range(n)]
    return exact, Fraction(floor(-0.9 * max(np.linalg.eigvals(E3).real) * 2**20), 2**20)


def phase_end(tiny: Tiny, X: Array, reach: Callable[[float], float]) -> tuple[Array, float]:
    """Magnitudes of ``z̄, x̄, η̄`` at ``T1``, and a bound of ``|ẋ_n|`` before it (agents without ``z`` and ``η`` only)."""
    acceleration, length = 0.0, float(tiny.T1) / max(tiny.steps, 1)
    for k in range(tiny.steps):
        Y = reach(k * length)
        box = X.copy()
        for _ in range(50):
            fastest = tiny.f1_whole([], box, Y) + tiny.claim["delta"]
            after = X + length * np.array([*box[1:] + np.array([Y] + [0.0] * (tiny.n - 2)), fastest])
            if (after <= box).all():
                break
            box = X + (after - X) * 1.05
        X, acceleration = X + (after - X) * 1.05, max(acceleration, fastest)
    return X, acceleration * 1.02


def first_phase(tiny: Tiny, X: Array, P3: Any, kappa: Fraction, reach: Callable[[float], float]) -> Array:
    """Magnitudes of ``e`` at ``T1``."""
    c, P = tiny.claim, np.array(P3, dtype=float)
    x0 = [0.0 if tiny.measured else float(tiny.x0), *[float(tiny.x0)] * (tiny.n - 1)]
    m = np.array([c["h"] ** (tiny.n - 1 - k) * x for k, x in enumerate(x0)])
    if not tiny.steps:
        return m
    rate = float(kappa) * c["h"]
    norm = exp(-rate * float(tiny.T1)) * np.sqrt(m @ np.abs(P) @ m)
    norm += np.sqrt(P[-1, -1]) * phase_end(tiny, X, reach)[1] / rate
    return np.sqrt(np.diag(np.linalg.inv(P))) * norm * 1.001


def encode(certificate: Json) -> bytes:
    return (json.dumps(certificate, sort_keys=True, separators=(",", ":")) + "\n").encode()
