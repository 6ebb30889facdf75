"""The certified region as bounds that a search for counterexamples tries to break."""

from __future__ import annotations

from fractions import Fraction

from certify.statement.bounds import ProvedBounds
from sims.bounds import ERROR, SignalBound

# of a signal's largest bound: what the integrator's tolerance may add; a bound is only broken by more
SLACK = Fraction(1, 10**6)


def signal_bounds(found: ProvedBounds) -> tuple[SignalBound, ...]:
    """``|y − s*|`` over time and every plant state for all time, a millionth of its peak wider than proved."""
    bounds = []
    for agent in found.agents:
        slack = SLACK * agent.error.peak
        values = tuple(value + slack for value in agent.error.values)
        bounds.append(SignalBound(agent.id, ERROR, agent.error.times, values))
        for state in agent.states:
            size = max(abs(state.whole.lo), abs(state.whole.hi))
            size += SLACK * max(size, agent.error.peak)
            bounds.append(SignalBound(agent.id, state.state.name, (Fraction(0),), (size,)))
    return tuple(bounds)
