"""The proved envelope of ``|y − s*|`` over time: ``|y^r − s*|`` of the coordinator and ``|x̄_1|`` of the tube."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from certify.coordinator.envelope import AgentEnvelope, Envelope
from certify.statement.tube import Tube

# a float logarithm is right to a few units of 1e-16
_UP = Fraction(1) + Fraction(1, 10**9)


@dataclass(frozen=True)
class ErrorEnvelope:
    """``|y − s*| ≤ values[k]`` on ``[times[k], times[k+1]]``; from the last time on the last value decays at
    ``decay`` (1/s)."""

    times: tuple[Fraction, ...]
    values: tuple[Fraction, ...]
    decay: Fraction

    @property
    def peak(self) -> Fraction:
        return max(self.values)

    def rises_at(self, time: Fraction) -> bool:
        """Whether the bound steps up at one of ``times``: where a wider argument takes over, not where ``y`` moves."""
        place = self.times.index(time) if time in self.times else 0
        return place > 0 and self.values[place] > self.values[place - 1]

    def settled(self, level: Fraction) -> Fraction:
        """A time from which on ``|y − s*| ≤ level`` is proved; ``level > 0``."""
        last = self.values[-1]
        if last > level:
            wait = math.log(float(last / level)) / float(self.decay)
            return self.times[-1] + Fraction(wait) * _UP
        above = [k for k, value in enumerate(self.values) if value > level]
        return self.times[above[-1] + 1] if above else Fraction(0)

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """The bound in floats, for drawing: at the border of two steps the larger one."""
        grid = np.array([float(t) for t in self.times])
        values = np.array([float(value) for value in self.values])
        step = np.clip(np.searchsorted(grid, times, side="right") - 1, 0, len(grid) - 1)
        before = np.clip(np.searchsorted(grid, times, side="left") - 1, 0, len(grid) - 1)
        late = np.exp(-float(self.decay) * np.maximum(times - grid[-1], 0.0))
        found: NDArray[np.float64] = np.maximum(values[step], values[before]) * late
        return found


def error_envelope(tube: Tube, zeros: int, reference: AgentEnvelope, envelope: Envelope) -> ErrorEnvelope:
    """``|y^r − s*| + |x̄_1|`` on the common refinement of the coordinator's grid and those of phase 1 and the tube.

    Each summand is bounded on its own step of time: ``x̄_1`` by the boxes of phase 1 until ``T1``, then by the tube's.
    """
    steps = len(reference.deviation)
    end = max(tube.grid[-1], envelope.horizon)
    border = {*tube.times, *envelope.times}
    times = sorted(t for t in border if t <= end)
    values = []
    for start in times[:-1]:
        k = bisect_right(envelope.times, start) - 1
        away = reference.deviation[k] if k < steps else reference.tail_deviation
        values.append(away + tube.states[bisect_right(tube.times, start) - 1][zeros])
    # both tails are over at the last time, and both decay at least at the slower rate
    values.append(reference.tail_deviation + tube.tail[zeros])
    return ErrorEnvelope(tuple(times), tuple(values), min(tube.tail_rate, envelope.tail_decay))
