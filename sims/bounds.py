"""Bounds on signals over time, such as a certificate gives, and how close a trajectory comes to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np

from sims.signals import Array
from symbolic.errors import InputError
from symbolic.plant import Agent

ERROR = "error"


@dataclass(frozen=True)
class SignalBound:
    """``|signal(t)| ≤ values[k]`` for ``times[k] ≤ t < times[k+1]`` (the last one for ever), of agent ``agent``.

    ``signal`` is a plant state by its name (``z1``, ``x2``) or ``error`` for ``y − s*``; ``times`` in seconds begin
    at 0 and increase. Raises ``InputError`` for lengths or times that do not fit.
    """

    agent: int
    signal: str
    times: tuple[Fraction, ...]
    values: tuple[Fraction, ...]

    def __post_init__(self) -> None:
        increasing = all(a < b for a, b in pairwise(self.times))
        if not self.times or len(self.times) != len(self.values) or self.times[0] != 0 or not increasing:
            raise InputError(f"bound of {self.signal}: times from 0 on that increase, one value each, are needed")
        if min(self.values) <= 0:
            raise InputError(f"bound of {self.signal}: a bound must be positive")

    def at(self, times: Array) -> Array:
        """The bound at ``times``."""
        steps = np.searchsorted(np.array([float(t) for t in self.times]), times, side="right") - 1
        values: Array = np.array([float(value) for value in self.values])[steps]
        return values


def margin(bounds: Sequence[SignalBound], agent: Agent, states: Array, times: Array, optimum: float) -> Array:
    """``min 1 − |signal|/bound`` over the bounds and the samples that were reached; below 0 a bound is broken.

    ``states`` has shape ``(…, states, times)``, the plant's ``(z, x)`` first; 1 where there are no bounds. Raises
    ``InputError`` for a signal the agent does not have.
    """
    names = [str(symbol) for symbol in (*agent.zero_states, *agent.chain)]
    least = np.ones(states.shape[:-2])
    for bound in bounds:
        if bound.agent != agent.id:
            continue
        if bound.signal != ERROR and bound.signal not in names:
            raise InputError(f"agent {agent.id} has no signal {bound.signal} to bound")
        row = names.index("x1" if bound.signal == ERROR else bound.signal)
        signal = states[..., row, :] - (optimum if bound.signal == ERROR else 0.0)
        distance = 1.0 - np.abs(signal) / bound.at(times)
        least = np.minimum(least, np.where(np.isnan(distance), 1.0, distance).min(axis=-1))
    return least
