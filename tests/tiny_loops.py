"""Simulated closed loops of the tiny plants, to hold against every number of a certificate of theirs.

A loop is integrated in the original coordinates with its saturation; nothing of the checker's rules is used for that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import Any

import direct_producer as producer
import numpy as np
from direct_producer import Json, Tiny
from scipy.integrate import solve_ivp

Array = Any
MODELS: dict[str, tuple[Callable[[], Tiny], Any]] = {
    "saturated": (producer.saturated, lambda z, x, v, p, q: ([], p * x[0] + x[0] ** 3 / 10)),
    "tight": (producer.tight, lambda z, x, v, p, q: ([], 10 * p * x[0])),
    "second": (producer.second_order, lambda z, x, v, p, q: ([], p * x[1] + x[0] * x[1] / 10)),
    "measured": (producer.measured, lambda z, x, v, p, q: ([], p * x[1] + x[0] * x[1] / 10)),
    "third": (producer.third_order, lambda z, x, v, p, q: ([], p * x[2] + x[0] * x[1] / 10)),
    "exosystem": (
        producer.with_exosystem,
        lambda z, x, v, p, q: ([-z[0] + x[0] + v[0]], z[0] + v[0] + z[0] * x[0] / 10),
    ),
}
"""``f0`` and ``f1``; ``|p| ≤ 1/10``, ``b = 1 + q`` with ``|q|`` up to the plant's ``b_radius``."""


class Simulation:
    """One closed loop; ``at(t)`` are ``z, x, ϑ, ζ, e, ϑ̃, υ, ẋ_n`` around the steady state, and ``z`` itself."""

    def __init__(self, name: str, seed: int) -> None:
        make, self.model = MODELS[name]
        self.tiny = tiny = make()
        c, n, nz, s = tiny.claim, tiny.n, tiny.nz, len(tiny.ell)
        random = np.random.default_rng(seed)

        def pick(size: int) -> Array:
            return random.choice([-1.0, 1.0], size) if seed % 2 else random.uniform(-1, 1, size)

        self.p, self.q = 0.1 * pick(1)[0], tiny.b_radius * pick(1)[0]
        self.theta, self.psi = producer.thetas(tiny), np.array(c["psi"], dtype=float)
        self.M, self.N = np.array(c["M"], dtype=float).reshape(s, s), np.array(c["N"], dtype=float)
        self.powers = float(c["h"] or 1) ** np.arange(n - 1, -1, -1)
        self.gains = np.array([c["h"] ** (k + 1) * c["observer"][n - 1 - k] for k in range(n)]) if n > 1 else []
        x, y = float(tiny.x0) * pick(n), float(tiny.y0) * pick(1)
        guess = np.array([x[0], *[0.0] * (n - 1)]) if tiny.measured else np.zeros(n)
        start = np.concatenate([pick(nz), x, np.zeros(s), guess if n > 1 else [], y])
        self.cuts = np.cumsum([nz, n, s, n if n > 1 else 0])
        span = (0.0, float(tiny.T1) + 4.0)
        self.solution = solve_ivp(self.flow, span, start, method="LSODA", rtol=1e-9, atol=1e-11, dense_output=True).sol

    def exosystem(self, t: float) -> Array:
        return np.array([np.sin(t), np.cos(t)]) if self.tiny.ell else np.zeros(0)

    def steering(self, x: Array, guess: Array, y: float) -> tuple[float, float]:
        """``ϑ̃`` and ``−sat(Kϑ̃)``."""
        seen = np.array(guess if len(guess) else x)
        estimate = self.theta @ seen - self.theta[0] * y
        delta = self.tiny.claim["delta"]
        return estimate, -float(np.clip(self.tiny.claim["K"] * estimate, -delta, delta))

    def flow(self, t: float, state: Array) -> Array:
        z, x, eta, guess, (y,) = np.split(state, self.cuts)
        _, sat = self.steering(x, guess, y)
        u = sat + self.psi @ eta
        dz, f1 = self.model(z, x, self.exosystem(t), self.p, self.q)
        observer = np.append(guess[1:], 0.0) + self.gains * (x[0] - guess[0]) if len(guess) else []
        return np.concatenate([dz, x[1:], [f1 + (1 + self.q) * u], self.M @ eta + self.N * u, observer, [-y]])

    def at(self, t: float) -> Json:
        z, x, eta, guess, (y,) = np.split(self.solution(t), self.cuts)
        v, b, s = self.exosystem(t), 1 + self.q, len(eta)
        steady, tau = np.zeros(len(z)), np.zeros(s)
        if s:
            F = self.M + np.outer(self.N, self.psi)
            output = np.array([-(3 * v[0] - v[1]) / 2, -(3 * v[1] + v[0]) / 2]) / b
            tau = np.linalg.solve(np.vstack([self.psi, self.psi @ F]), output)
            steady = np.array([(v[0] - v[1]) / 2])
        x_bar, eta_bar = x - np.append([y], np.zeros(len(x) - 1)), eta - tau
        estimate, sat = self.steering(x, guess, y)
        return {
            "z": z,
            "z_bar": z - steady,
            "x": x_bar,
            "theta": self.theta @ x_bar,
            "eta": eta_bar,
            "zeta": eta_bar - self.N * x_bar[-1] / b,
            "e": self.powers * (x - guess) if len(guess) else np.zeros(0),
            "estimate": estimate,
            "input": sat + self.psi @ eta_bar,
            "speed": self.flow(t, self.solution(t))[self.cuts[1] - 1],
        }


def numbers(value: Any) -> Any:
    return np.array([numbers(entry) if isinstance(entry, list) else float(producer.Fraction(entry)) for entry in value])


def sizes(*values: Any) -> Array:
    return np.abs(np.concatenate([np.atleast_1d(value) for value in values]))


def hold_against(tiny: Tiny, certificate: Json, loops: Iterable[Simulation]) -> float:
    """The largest share of a box that is used, in both phases up to four seconds after ``T1``; none is ever left."""
    witness = certificate["witness"]["agents"][0]
    phase, ranges = witness["phase1"], numbers([*[[["-1", "1"]] * tiny.nz], *witness["ranges"]])
    steps = [
        (a, b, box, part is phase)
        for part in (phase, witness)
        for (a, b), box in zip(pairwise(numbers(part["grid"])), numbers(part["boxes"]), strict=True)
    ]
    closest = 0.0
    for loop in loops:
        for index, (start, end, box, saturating) in enumerate(steps):
            if end > float(tiny.T1) + 4:
                break
            for t in np.linspace(start, end, 4):
                now = loop.at(t)
                found = (
                    sizes(now["z_bar"], now["x"], now["theta"], now["zeta"])
                    if saturating
                    else sizes(now["z_bar"], now["x"], now["estimate"], now["input"])
                )
                assert (found <= box * (1 + 1e-6) + 1e-8).all(), (t, found, box)
                closest = max(closest, *(found / box))
                if index + 1 < len(ranges):
                    lo, hi = ranges[index : index + 2, :, 0].min(axis=0), ranges[index : index + 2, :, 1].max(axis=0)
                    assert (lo - 1e-8 <= now["z"]).all() and (now["z"] <= hi + 1e-8).all()
            if saturating:
                assert abs(now["theta"]) <= float(producer.Fraction(phase["vartheta"][index])) + 1e-8
    return closest
