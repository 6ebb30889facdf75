"""How the observer forgets: ``e^{E3 τ}``, ``τ = ht``, on cells, and the bounds of ``e`` that it gives
(docs/certificate-direct.md section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from certify.agent_model import Matrix
from certify.inequalities.matrices import to_float

CELLS_PER_NORM = 4
NEGLIGIBLE = 2.0**-64
MOST_CELLS = 16_384
LARGEST = 1e100
MARGIN = 1.0005


@dataclass(frozen=True)
class ObserverDecay:
    """``|(e^{E3 τ})_ik| ≤ later[j, i, k]`` for all ``τ ≥ j·width``, and ``∫|(e^{E3 τ})_in| dτ ≤ gains[i]``."""

    width: float
    later: np.ndarray
    gains: np.ndarray


def observer_decay(observer: Matrix) -> ObserverDecay | None:
    """``None`` when ``e^{E3 τ}`` takes too many cells to vanish, or grows."""
    E3 = to_float(observer)
    size, norm = len(observer), float(np.abs(E3).sum(axis=1).max())
    width = 2.0 ** -np.ceil(np.log2(CELLS_PER_NORM * norm))
    step, spread = expm(E3 * width), expm(np.abs(E3) * width)
    flow, integral = np.eye(size), np.zeros((size, size))
    bounds: list[np.ndarray] = []
    while (left := np.abs(flow).sum(axis=1).max()) > NEGLIGIBLE:
        if len(bounds) >= MOST_CELLS or left > LARGEST:
            return None
        slope, curve = width * np.abs(E3 @ flow), width**2 / 2 * np.abs(E3 @ E3 @ flow) @ spread
        bounds.append(np.abs(flow) + slope + curve)
        integral += width * (np.abs(flow) + slope / 2 + curve / 3)
        flow = step @ flow
    rest = np.abs(flow).sum(axis=1).max()
    whole = np.max(bounds, axis=0)
    bounds.append(np.broadcast_to(2 * rest * whole.sum(axis=1, keepdims=True), (size, size)))
    later = np.maximum.accumulate(np.array(bounds)[::-1])[::-1]
    gains = integral[:, -1] + 2 * rest * integral.sum(axis=1)
    return ObserverDecay(width, later * MARGIN, gains * MARGIN)


class ObserverError:
    """``|e(t)|`` is at most what is left of ``e(0)`` plus what ``ẋ_n`` drives through ``e_n``.

    ``weights`` is ``E2``, ``initial`` bounds ``|e(0)|``.
    """

    def __init__(self, decay: ObserverDecay, weights: np.ndarray, initial: np.ndarray, h: float) -> None:
        self.initial, self._cells = initial, len(decay.later) - 1
        self._rate = h / decay.width * (1 - 1e-12)
        self._left, self._driven = decay.later @ initial, decay.gains / h
        self._missed, self._missed_driven = self._left @ np.abs(weights), float(self._driven @ np.abs(weights))

    def at(self, time: float, speed: float) -> np.ndarray:
        """Bounds of ``|e_i|`` from ``time`` on, as long as ``|ẋ_n| ≤ speed`` since 0."""
        bound: np.ndarray = self._left[self._cell(time)] + self._driven * speed
        return bound

    def missed(self, time: float, speed: float) -> float:
        """``|E2 e|`` from ``time`` on."""
        return float(self._missed[self._cell(time)]) + self._missed_driven * speed

    def _cell(self, time: float) -> int:
        return min(int(time * self._rate), self._cells)
