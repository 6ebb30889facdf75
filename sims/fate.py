"""What became of a trajectory: converged, escaped, a limit cycle or an offset that stays, or still on its way.

The output error is looked at over equal windows at the end of the run, each at least one period of the exosystem long.
Its largest value per window falls by a fixed factor from window to window while a trajectory converges exponentially,
however slowly; in a limit cycle or at an offset it does not fall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sims.signals import Array
from symbolic.plant import Plant

Fate = Literal["converged", "slow", "oscillates", "offset", "grows", "escaped", "failed"]

BROKEN: tuple[Fate, ...] = ("escaped", "oscillates", "offset", "grows")
_STEADY = 0.9
_GROWTH = 1.5
_PER_WINDOW = 160


@dataclass(frozen=True)
class Windows:
    """``count`` windows of equal length at the end of ``[0, horizon]`` and the instants at which they are sampled.

    The instants are spread unevenly, so that no oscillation is sampled in step.
    """

    horizon: float
    count: int
    times: Array


def windows(plant: Plant, horizon: float) -> Windows:
    """Three windows, each a fifth of the horizon or a period of the exosystem, whichever is longer."""
    length = min(max(horizon / 5, longest_period(plant)), horizon / 3)
    count = 3
    generator = np.random.default_rng(0)
    places = (np.arange(count * _PER_WINDOW) + generator.uniform(0.05, 0.95, count * _PER_WINDOW)) / _PER_WINDOW
    times = horizon - length * count + length * places
    times[-1] = horizon
    return Windows(horizon, count, times)


def amplitudes(error: Array, frame: Windows) -> Array:
    """``max |error|`` per window: ``(…, times)`` to ``(…, windows)``."""
    return np.abs(error).reshape(*error.shape[:-1], frame.count, -1).max(axis=-1)


def judge(error: Array, frame: Windows, tolerance: float, *, strict: bool = False) -> Fate:
    """The fate of one completed trajectory by its output error ``y − s*`` at ``frame.times``.

    ``strict`` compares the last window with both before it: what is to count as a counterexample has to pass it.
    """
    first, second, third = amplitudes(error, frame)
    if not math.isfinite(third):
        return "failed"
    if third <= tolerance:
        return "converged"
    before = max(first, second) if strict else second
    if third < _STEADY * before:
        return "slow"
    if third > _GROWTH * before:
        return "grows"
    last = error[-_PER_WINDOW:]
    return "oscillates" if np.ptp(last) > 0.1 * third else "offset"


def longest_period(plant: Plant) -> float:
    """The longest period among the eigenvalues of ``S`` in floats; 0 without oscillation."""
    states = len(plant.exosystem.states)
    if not states:
        return 0.0
    frequencies = np.abs(np.linalg.eigvals(np.array(plant.exosystem.S.tolist(), dtype=float)).imag)
    moving = frequencies[frequencies > 1e-9]
    return float(2 * math.pi / moving.min()) if moving.size else 0.0
