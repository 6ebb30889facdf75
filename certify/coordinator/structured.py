"""The structured norm of a coordinator that waits: ``P = [[Rm, B Rm], [B Rm, c Rm]]``, ``B_i = b/(1 + D_i/d0)``.

Three numbers, found by a direct search in floats (docs/coordinator.md has the inequality, the checker proves it).
Coordinates are scaled by ``√r``, so that nothing depends on how small an entry of ``r`` is.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

# of (b, d0/C): the optimum is near one of them, and c near b, since α1 (B − c) L is to vanish where messages are fast
STARTS = ((0.5, 1000.0), (0.5, 10.0), (0.3, 1.0), (0.9, 1000.0), (0.9, 3.0))
SIMPLEX = 0.4  # of the logarithms: the first steps of the search
ENOUGH = 0.9  # of the rate with the least damping, which no norm beats by much: further starts are not worth their time
LIMITS = ((-14.0, -14.0, -7.0), (1.0, 14.0, 5.0))  # of the logarithms of b, d0/C and c/max(B)² − 1
EVALUATIONS = 150  # per start; the rate is within 1 % by then
POINT_PRICE, BOX_PRICE = 0.02, 0.5  # of log κ against log λ: a box of starts pays κ at once, a point only for rounding
B_BITS, C_BITS, RATE_BITS = 14, 20, 8
ROOM = 0.99  # of the rate: for rounding
SHIFTS = tuple(4.0**k for k in range(-2, 9))


@dataclass(frozen=True)
class System:
    """The coordinator with every damping between ``low`` and ``high``; rates in one unit of time."""

    laplacian: Array
    r: Array
    low: Array
    high: Array
    alpha1: float
    alpha2: float

    @property
    def pace(self) -> float:
        """``C = Σ r_i D_i``, the rate on the consensus line."""
        return float(self.r @ (self.low + self.high) / 2)

    @property
    def scaled_laplacian(self) -> Array:
        """``√Rm L √Rm⁻¹``"""
        root = np.sqrt(self.r)
        return root[:, None] * self.laplacian / root[None, :]

    def slowest(self) -> float:
        """The decay rate of the limit system with damping in the middle, without the conserved direction."""
        n = len(self.r)
        damping = np.diag((self.low + self.high) / 2)
        upper = np.hstack([-self.alpha1 * self.laplacian - damping, -self.alpha2 * np.eye(n)])
        values = np.linalg.eigvals(np.vstack([upper, np.hstack([self.alpha1 * self.laplacian, np.zeros((n, n))])]))
        return float(-np.sort(np.delete(values.real, np.argmin(np.abs(values))))[-1])


@dataclass(frozen=True)
class StructuredNorm:
    """``B``, ``c``, the rate that it proves in floats, and the ``μ`` of the inequality."""

    B: tuple[Fraction, ...]
    c: Fraction
    rate: Fraction
    shift: Fraction

    @property
    def reach(self) -> float:
        """The largest ``c/(c − B_i²)``: ``|y_i|² r_i ≤ reach ‖e‖_P²``."""
        return float(self.c / (self.c - max(abs(b) for b in self.B) ** 2))


def structured_norm(system: System, box: bool) -> StructuredNorm | None:
    """The norm with the best rate, where a large ``κ`` has its price; ``None`` if none decays."""
    from scipy.optimize import minimize

    middle, pace = (system.low + system.high) / 2, system.pace
    rates, price = _Rates(system), BOX_PRICE if box else POINT_PRICE

    def cost(x: Array) -> float:
        b, d0, room = np.exp(np.clip(x, *LIMITS))
        B = b / (1 + middle / (d0 * pace))
        c = float(np.max(B)) ** 2 * (1 + room)
        rate = rates(B, c)
        return float(-np.log(rate / pace) + price * np.log(1 + 1 / room)) if rate > 0 else 50.0 - rate / pace

    found, least = [], float(system.r @ system.low)
    for b, share in STARTS:
        start = np.log([b, share, 1 / b - 1])
        simplex = np.vstack([start, start + SIMPLEX * np.eye(3)])
        options = {"maxfev": EVALUATIONS, "xatol": 1e-2, "fatol": 1e-3, "initial_simplex": simplex}
        found.append(minimize(cost, start, method="Nelder-Mead", options=options))
        if found[-1].fun < -np.log(ENOUGH * least / pace):
            break
    best = min(found, key=lambda one: one.fun)
    if best.fun >= 50.0:
        return None
    b, d0, room = np.exp(np.clip(best.x, *LIMITS))
    B = tuple(_short(value, B_BITS) for value in (b / (1 + middle / (d0 * pace))).tolist())
    c = _short(float(max(B)) ** 2 * (1 + float(room)), C_BITS)
    rate = rates(np.array([float(value) for value in B]), float(c))
    if not rate > 0:
        return None
    claimed = _short(ROOM * rate, RATE_BITS)
    return StructuredNorm(B, c, claimed, rates.shift(B, c, claimed))


class _Rates:
    """Everything about the system that does not depend on ``B`` and ``c``."""

    def __init__(self, system: System) -> None:
        self.system, self.L = system, system.scaled_laplacian
        root = np.sqrt(system.r)
        normal = root / np.linalg.norm(root)
        normal[0] += 1.0
        reflection = np.eye(len(root)) - 2 * np.outer(normal, normal) / (normal @ normal)
        self.basis: Array = reflection[:, 1:]  # of the ζ with rᵀζ = 0

    def blocks(self, B: Array, c: float) -> tuple[Array, Array, Array]:
        """``−(AᵀP + PA)`` with the least damping, less the rest of the damping."""
        s, L = self.system, self.L
        top = s.alpha1 * (1 - B)[:, None] * L
        side = np.diag(s.alpha2 + B * s.low) + s.alpha1 * ((B - c)[:, None] * L).T
        return top + top.T + 2 * np.diag(s.low), side, 2 * s.alpha2 * B - (s.high - s.low) * B**2 / 2

    def __call__(self, B: Array, c: float) -> float:
        from scipy.linalg import eigh

        top, side, corner = self.blocks(B, c)
        Z, n = self.basis, len(B)
        left = np.block([[top, side @ Z], [(side @ Z).T, Z.T @ (corner[:, None] * Z)]])
        right = np.block([[np.eye(n), B[:, None] * Z], [(B[:, None] * Z).T, c * np.eye(n - 1)]])
        try:
            return float(eigh(left, right, eigvals_only=True, subset_by_index=[0, 0])[0]) / 2
        except np.linalg.LinAlgError:
            return -np.inf

    def shift(self, B: tuple[Fraction, ...], c: Fraction, rate: Fraction) -> Fraction:
        """``μ``: what makes the inequality hold also where ``rᵀζ ≠ 0``."""
        b = np.array([float(value) for value in B])
        top, side, corner = self.blocks(b, float(c))
        n, root, lam = len(b), np.sqrt(self.system.r), float(rate)
        best, unit = 0.0, self.system.alpha2 + self.system.pace
        least = -np.inf
        for factor in SHIFTS:
            left = np.block(
                [
                    [top - 2 * lam * np.eye(n), side - 2 * lam * np.diag(b)],
                    [
                        (side - 2 * lam * np.diag(b)).T,
                        np.diag(corner - 2 * lam * float(c)) + factor * unit * np.outer(root, root),
                    ],
                ]
            )
            smallest = float(np.linalg.eigvalsh(left)[0])
            if smallest > least:
                best, least = factor * unit, smallest
        return _short(best, RATE_BITS)


def _short(value: float, bits: int) -> Fraction:
    """The value with that many significant bits."""
    mantissa, exponent = np.frexp(value)
    return Fraction(round(float(mantissa) * 2**bits)) * Fraction(2) ** (int(exponent) - bits)
