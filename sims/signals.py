"""Piecewise polynomials in time: how the upper layer's solution is handed to the agents."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DEGREE = 7
_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)
_FIT = np.linalg.inv(np.vander(_NODES, increasing=True))


@dataclass(frozen=True)
class PiecewisePolynomial:
    """``Σ_k coefficients[j, k] (t − breaks[j])^k`` on ``[breaks[j], breaks[j+1]]``.

    ``breaks`` has shape ``(pieces + 1,)`` in seconds and ``coefficients`` ``(pieces, degree + 1, signals)``.
    """

    breaks: Array
    coefficients: Array

    @property
    def end(self) -> float:
        return float(self.breaks[-1])

    def sample(self, times: Array) -> Array:
        """Values at ``times``, shape ``(signals, len(times))``."""
        piece = np.clip(np.searchsorted(self.breaks, times, side="right") - 1, 0, len(self.coefficients) - 1)
        s = times - self.breaks[piece]
        value = np.zeros((len(times), self.coefficients.shape[2]))
        for k in reversed(range(self.coefficients.shape[1])):
            value = value * s[:, None] + self.coefficients[piece, k]
        return value.T

    def reader(self, rows: Sequence[int]) -> Callable[[float], list[float]]:
        """A fast scalar evaluation of the signals ``rows``, for right-hand sides."""
        breaks = self.breaks.tolist()
        pieces = np.swapaxes(self.coefficients[:, ::-1, list(rows)], 1, 2).tolist()
        last = len(pieces) - 1

        def read(t: float) -> list[float]:
            j = min(max(bisect_right(breaks, t) - 1, 0), last)
            s = t - breaks[j]
            values = []
            for row in pieces[j]:
                value = 0.0
                for coefficient in row:
                    value = value * s + coefficient
                values.append(value)
            return values

        return read


def fit_piece(start: float, end: float, evaluate: Callable[[Array], Array]) -> Array:
    """Coefficients, shape ``(8, signals)``, of a polynomial of degree ≤ 7 known by its values ``(signals, times)``."""
    width = end - start
    values = evaluate(start + width * _NODES).T
    scaled: Array = _FIT @ (values - values[0])
    scaled[0] += values[0]
    return scaled / (width ** np.arange(_DEGREE + 1))[:, None]
