"""How near a trajectory of a search is to breaking the claim, as numbers."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from sims.batch import COMPLETED, ESCAPED, BatchSolution
from sims.signals import Array
from sims.witness import Replay


def scores(solution: BatchSolution, last: Array, closeness: Array, horizon: float) -> Array:
    """One per trajectory, larger is nearer: peaks and late errors in decades, broken bounds, early escapes first.

    ``last`` is the amplitude of the error at the end, ``closeness`` the margin of the bounds, ``horizon`` in seconds.
    """
    late = np.log10(np.clip(np.nan_to_num(last, nan=1e3), 1e-9, 1e6))
    peak = np.log10(np.clip(solution.peak, 1e-9, 1e12))
    found = peak + 0.25 * late - 10.0 * np.minimum(closeness, 0.5)
    found = np.where(closeness < 0, 500.0 - closeness, found)
    found = np.where(solution.status == ESCAPED, 1e3 - solution.end / horizon, found)
    result: Array = np.where((solution.status == COMPLETED) | (found > 100.0), found, -1e3)
    return result


def seen(found: Replay) -> tuple[tuple[str, str], ...]:
    """What a replayed run showed, for the witness."""
    return (
        ("amplitudes", " ".join(f"{size:.6g}" for size in found.amplitudes if math.isfinite(size))),
        ("end", repr(found.end)),
        ("margin", repr(found.margin)),
        ("reason", found.reason),
    )


def broken_margin(found: Replay, tolerance: Fraction) -> float:
    """The margin of a confirmed counterexample: below 0."""
    if found.fate == "escaped":
        return -math.inf
    if found.fate == "bound":
        return found.margin
    return 1.0 - found.amplitudes[-1] / float(tolerance)
