"""Curves short enough for a page: few points that keep the extremes, and numbers of a few digits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from certify.statement.numbers import rounded
from sims.signals import Array

DIGITS = 5
MOST_POINTS, LEAST_POINTS = 400, 60  # of one curve
CURVES_BUDGET = 200_000  # points of all curves: some megabytes

Values = list[float | None]


def points_per_curve(curves: int) -> int:
    """How many points a curve may have where there are so many of them."""
    return max(LEAST_POINTS, min(MOST_POINTS, CURVES_BUDGET // max(curves, 1)))


def thinned(values: Array, points: int) -> NDArray[np.intp]:
    """Indices of at most about ``points`` samples: of each stretch the least, the largest and the last value."""
    if len(values) <= points:
        return np.arange(len(values))
    borders = np.linspace(0, len(values), max(points // 3, 1) + 1).astype(int)
    chosen = {0, len(values) - 1}
    for low, high in pairwise(borders.tolist()):
        part = np.where(np.isfinite(values[low:high]), values[low:high], 0.0)
        if part.size:
            chosen |= {low + int(part.argmin()), low + int(part.argmax()), high - 1}
    return np.array(sorted(chosen), dtype=np.intp)


def plain(values: Iterable[float]) -> Values:
    """To five digits, for JSON; what is not finite is a gap."""
    return [float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None for value in values]


def chart_text(text: str) -> str:
    """Text for Plotly, which reads a small markup: ``<``, ``>`` and ``&`` become entities, it knows no other ones."""
    return escape(text, quote=False)


def bounds(values: Sequence[Fraction]) -> list[float]:
    """Proved upper bounds, rounded up to five digits."""
    return [float(rounded(value, DIGITS, "up")) for value in values]
