"""Majorants ``Σ_a c_a e^{−μ_a t}`` of the nominal loop's impulse responses (docs/certificate-direct.md section 2).

Sums of absolute values of modes lose a factor of three to ten where slow modes nearly cancel; the least majorant is a
small linear program per pair of output and column. Coefficients may be negative: only the sum has to be above the
response, and a response that starts at zero is far below any sum of positive ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from certify.tube.covering import least_cover
from certify.tube.modes import Modes

COARSEST, FINEST = 16, 512  # the start of a cell over its width
MOST_CELLS = 8192
LIFETIMES = 32
MARGIN = 1e-4
TANGENT = 1 / 2  # of the largest half width of a cell over a time constant
GUARD = 1e-4
ROUNDING = 1e-15
DENSITY = 1.7
SLOWEST_SHARE = 0.75
FASTEST_SHARE = 0.95
MOST_RATES = 16
START_WEIGHT = 0.3
INPUT_WEIGHT = 1e-3
NEGLIGIBLE = 1e-6
CANCELLED = 0.01  # the price of what coefficients of different signs cancel: the tube pays for it


@dataclass(frozen=True)
class Kernels:
    """``|(C e^{At} J)_ij| ≤ Σ_a coefficients[i, j, a] e^{−rates[a] t}``; ``inputs`` is the number of columns
    ``B_j``."""

    rates: np.ndarray
    coefficients: np.ndarray
    inputs: int

    @property
    def gains(self) -> np.ndarray:
        """``Σ_a c_ija/μ_a``: bounds of the peak-to-peak gains from the inputs to the outputs."""
        return self.coefficients[:, : self.inputs] @ (1 / self.rates)


def cells(modes: Modes) -> np.ndarray:
    """Ends of the cells, from 0 to beyond ``32/σ``, on which the majorants are checked; they are short where a mode
    turns often while it decays."""
    turns = np.abs(modes.frequency)
    turning = turns > 4 * modes.decay
    decay, turns = modes.decay[turning].tolist(), turns[turning].tolist()
    ends = [0.0, 1 / (64 * float(np.max(np.hypot(modes.decay, modes.frequency))))]
    last = (LIFETIMES + 1) / float(modes.decay.min())
    while ends[-1] < last and len(ends) <= MOST_CELLS:
        t = ends[-1]
        both = [(slow, turn) for slow, turn in zip(decay, turns, strict=True) if slow * t < LIFETIMES]
        widths = [max(t / FINEST, (1 + slow * t) / (4 * turn)) for slow, turn in both]
        ends.append(t + min([t / COARSEST, *widths]))
    return np.array(ends)


def kernels(modes: Modes, inputs: int) -> Kernels:
    """Small majorants for every pair: input columns count by their integral, start columns by height too."""
    ends = cells(modes)
    bound = _cell_bounds(modes, ends)
    rates = _rates(modes)
    last = LIFETIMES / float(modes.decay.min())
    basis = Basis(ends, rates)
    size = np.linalg.norm(modes.outputs, axis=1)[:, None] * np.linalg.norm(modes.columns, axis=0)[None, :]
    left, right = _block_norms(modes)
    later = (left * np.exp(-(modes.decay - rates[0]) * last)) @ right
    coefficients = np.zeros((*bound.shape[:2], len(rates)))
    for i in range(bound.shape[0]):
        for j in range(bound.shape[1]):
            weight = INPUT_WEIGHT if j < inputs else START_WEIGHT
            coefficients[i, j] = basis.least_majorant(bound[i, j], 1 / rates + weight / rates[0])
            coefficients[i, j, 0] += ROUNDING * size[i, j]
            coefficients[i, j, 0] += _tail_excess(later[i, j], rates, last, coefficients[i, j])
    return Kernels(rates, coefficients, inputs)


def _rates(modes: Modes) -> np.ndarray:
    """Rates from below the slowest mode to about the fastest, evenly in ratio."""
    slowest, fastest = float(modes.decay.min()), float(np.hypot(modes.decay, modes.frequency).max())
    count = min(MOST_RATES, 3 + int(np.ceil(np.log(fastest / slowest) / np.log(DENSITY))))
    mantissas, exponents = np.frexp(np.geomspace(SLOWEST_SHARE * slowest, FASTEST_SHARE * fastest, count))
    return np.ldexp(np.floor(mantissas * 4096) / 4096, exponents)


def _cell_bounds(modes: Modes, ends: np.ndarray) -> np.ndarray:
    """Of every response on every cell: what a line has to be above at its start, then at its end."""
    start, middle, half = ends[:-1], (ends[:-1] + ends[1:]) / 2, np.diff(ends) / 2
    moved, slope = _propagate(modes, middle)
    value = np.einsum("ia,taj->ijt", modes.outputs, moved)
    derivative = np.einsum("ia,taj->ijt", modes.outputs, slope)
    strength = (modes.decay**2 + modes.frequency**2)[:, None] * np.exp(-np.outer(modes.decay, start))
    left, right = _block_norms(modes)
    curvature = np.einsum("ia,aj,at->ijt", left, right, strength)
    bend = curvature * half**2 / 2
    return np.concatenate([np.abs(value - derivative * half) + bend, np.abs(value + derivative * half) + bend], axis=2)


def _propagate(modes: Modes, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``e^{Λt} J'`` and ``Λ e^{Λt} J'`` at many times."""
    damping = np.exp(-np.outer(times, modes.decay))[:, :, None]
    moved = damping * modes.columns[None]
    slope = -modes.decay[None, :, None] * moved
    for a in _pairs(modes):
        c, s = np.cos(modes.frequency[a] * times)[:, None], np.sin(modes.frequency[a] * times)[:, None]
        u, w = modes.columns[a][None], modes.columns[a + 1][None]
        e = damping[:, a]
        moved[:, a], moved[:, a + 1] = e * (c * u + s * w), e * (c * w - s * u)
        sigma, omega = -modes.decay[a], modes.frequency[a]
        first, second = moved[:, a].copy(), moved[:, a + 1].copy()
        slope[:, a], slope[:, a + 1] = sigma * first + omega * second, sigma * second - omega * first
    return moved, slope


def _pairs(modes: Modes) -> list[int]:
    starts, position = [], 0
    for size in modes.blocks:
        if size == 2:
            starts.append(position)
        position += size
    return starts


def _block_norms(modes: Modes) -> tuple[np.ndarray, np.ndarray]:
    """``|C'_ia|`` and ``|J'_aj|`` with the Euclidean norm of a pair on its first column and zero on its second."""
    left, right = np.abs(modes.outputs), np.abs(modes.columns)
    for a in _pairs(modes):
        left[:, a] = np.hypot(left[:, a], left[:, a + 1])
        right[a] = np.hypot(right[a], right[a + 1])
        left[:, a + 1] = 0
    return left, right


class Basis:
    """Lines below and above the exponentials, at the starts and then at the ends of the cells: tangents in the middle
    or the least value, and chords."""

    def __init__(self, ends: np.ndarray, rates: np.ndarray) -> None:
        values = np.exp(-np.outer(ends, rates))
        middle = np.exp(-np.outer((ends[:-1] + ends[1:]) / 2, rates))
        turns = np.outer(np.diff(ends) / 2, rates)
        self.below = np.vstack(
            [np.where(turns <= TANGENT * (1 - 1e-9), middle * (1 + sign * turns), values[1:]) for sign in (1, -1)]
        )
        self.above = np.vstack([values[:-1], values[1:]])

    def least_majorant(self, bound: np.ndarray, price: np.ndarray) -> np.ndarray:
        """The cheapest coefficients, at a price per rate, whose sum is above ``bound`` on every cell."""
        largest = float(bound.max())
        if largest <= 0:
            return np.zeros(len(price))
        need = np.maximum(bound / largest, NEGLIGIBLE * self.below[:, 0])[:, None]
        signed = np.hstack([self.below, -self.above]) / need
        prices = np.concatenate([price * (1 + CANCELLED), price * (CANCELLED - 1)])
        positive, negative = np.split(_cheapest(signed, prices), 2)
        lower = self.below @ positive - self.above @ negative
        lacking = float(np.max((need[:, 0] - lower) / self.below[:, 0], initial=0.0))
        positive[0] += lacking + MARGIN * float(positive.sum() + negative.sum()) * GUARD
        return (positive - negative) * largest * (1 + MARGIN)


def _cheapest(signed: np.ndarray, prices: np.ndarray) -> np.ndarray:
    """``least_cover``, or what a solver for all kinds of programs finds, without negative coefficients if that is too
    hard for both; zeros if everything is."""
    found = least_cover(signed, prices)
    if found is not None:
        return np.maximum(found, 0)
    count = len(prices) // 2
    for columns in (2 * count, count):
        result = linprog(prices[:columns], A_ub=-signed[:, :columns], b_ub=-np.ones(len(signed)), method="highs")
        if result.x is not None:
            return np.append(np.maximum(result.x, 0), np.zeros(2 * count - columns))
    return np.zeros(2 * count)


def _tail_excess(later: float, rates: np.ndarray, end: float, coefficients: np.ndarray) -> float:
    """What the slowest coefficient lacks to cover ``later``, a bound of everything after the last cell."""
    against = float(np.minimum(coefficients[1:], 0) @ np.exp(-(rates[1:] - rates[0]) * end))
    return max(0.0, 2 * later - against - float(coefficients[0]))
