"""Majorants ``Σ_a c_a e^{−μ_a t}`` of the nominal loop's impulse responses (docs/certificate-direct.md section 2).

Sums of absolute values of modes lose a factor of three to ten where slow modes nearly cancel; the least majorant is
within a
factor of two of the true response. It is a small linear program per pair of output and column.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from certify.tube.modes import Modes

RATIO = 33 / 32
LIFETIMES = 32
GROUP = 3
MARGIN = 1e-4
ROUNDING = 1e-15
SEPARATION = 1.25
SHARES = (0.5, 0.7, 0.9, 1.5, 3.0, 10.0, 40.0)
MOST_RATES = 16
START_WEIGHT = 0.3
INPUT_WEIGHT = 1e-3
NEGLIGIBLE = 1e-6


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
    """Ends of the cells, from 0 to beyond ``32/σ``, on which the majorants are checked."""
    fastest = float(np.max(np.hypot(modes.decay, modes.frequency)))
    first = 1 / (64 * fastest)
    count = int(np.ceil(np.log((LIFETIMES + 1) / float(modes.decay.min()) / first) / np.log(RATIO))) + 1
    return np.concatenate([[0.0], first * RATIO ** np.arange(count + 1)])


def kernels(modes: Modes, inputs: int) -> Kernels:
    """Small majorants for every pair: input columns count by their integral, start columns by height too."""
    ends = cells(modes)
    bound = _cell_bounds(modes, ends)
    rates = _rates(modes)
    last = LIFETIMES / float(modes.decay.min())
    decay = np.exp(-np.outer(ends[1:], rates))
    size = np.linalg.norm(modes.outputs, axis=1)[:, None] * np.linalg.norm(modes.columns, axis=0)[None, :]
    coefficients = np.zeros((*bound.shape[:2], len(rates)))
    for i in range(bound.shape[0]):
        for j in range(bound.shape[1]):
            weight = INPUT_WEIGHT if j < inputs else START_WEIGHT
            coefficients[i, j] = least_majorant(bound[i, j], decay, 1 / rates + weight / rates[0])
            coefficients[i, j, 0] += ROUNDING * size[i, j]
            coefficients[i, j, 0] += _tail_excess(modes, i, j, rates[0], last, coefficients[i, j, 0])
    return Kernels(rates, coefficients, inputs)


def _rates(modes: Modes) -> np.ndarray:
    """Rates well below the slowest mode let the sum follow modes that nearly coincide (``t e^{−σt}``)."""
    slowest = float(modes.decay.min())
    candidates = [*(share * slowest for share in SHARES), *modes.decay, 0.6 * float(modes.decay.max())]
    chosen: list[float] = []
    for rate in sorted(candidates):
        if not chosen or rate > SEPARATION * chosen[-1]:
            mantissa, exponent = np.frexp(rate)
            chosen.append(float(np.ldexp(np.floor(mantissa * 4096) / 4096, exponent)))
    return np.array(chosen[: MOST_RATES - 1] + chosen[-1:] if len(chosen) > MOST_RATES else chosen)


def _cell_bounds(modes: Modes, ends: np.ndarray) -> np.ndarray:
    """An upper bound of every response on every cell: middle value, slope and curvature."""
    start, middle, half = ends[:-1], (ends[:-1] + ends[1:]) / 2, np.diff(ends) / 2
    moved, slope = _propagate(modes, middle)
    value = np.einsum("ia,taj->ijt", modes.outputs, moved)
    derivative = np.einsum("ia,taj->ijt", modes.outputs, slope)
    strength = (modes.decay**2 + modes.frequency**2)[:, None] * np.exp(-np.outer(modes.decay, start))
    left, right = _block_norms(modes)
    curvature = np.einsum("ia,aj,at->ijt", left, right, strength)
    return np.abs(value) + np.abs(derivative) * half + curvature * half**2 / 2


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


def least_majorant(bound: np.ndarray, decay: np.ndarray, price: np.ndarray) -> np.ndarray:
    """The cheapest ``c ≥ 0`` with ``decay @ c ≥ bound``, at a price per rate; ``decay[k, a]`` is ``e^{−μ_a t}`` at the end
    of cell ``k``."""
    largest = float(bound.max())
    if largest <= 0:
        return np.zeros(len(price))
    floor = np.maximum(bound / largest, NEGLIGIBLE * decay[:, 0])
    groups = -(-len(floor) // GROUP)
    need = np.array([floor[k * GROUP : (k + 1) * GROUP].max() for k in range(groups)])
    have = np.array([decay[min((k + 1) * GROUP, len(floor)) - 1] for k in range(groups)])
    result = linprog(price, A_ub=-have / need[:, None], b_ub=-np.ones(groups), bounds=(0, None), method="highs")
    found = np.maximum(result.x, 0) if result.x is not None else np.eye(len(price))[0] / have[-1, 0]
    ratio = float(np.max(floor / np.maximum(decay @ found, 1e-300)))
    return found * largest * max(ratio, 1.0) * (1 + MARGIN)


def _tail_excess(modes: Modes, i: int, j: int, slowest: float, end: float, coefficient: float) -> float:
    """What the slowest coefficient lacks to cover everything after the last cell."""
    left, right = _block_norms(modes)
    later = float(np.sum(left[i] * right[:, j] * np.exp(-(modes.decay - slowest) * end)))
    return max(0.0, 2 * later - coefficient)
