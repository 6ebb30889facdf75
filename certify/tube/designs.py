"""Other designs than the default one, where the plant file leaves the observer, ``γ`` or ``(M, N)`` open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

from symbolic.design import companion_pair, damped_polynomial
from symbolic.plant import Agent

DAMPINGS = (Fraction(3, 4), Fraction(3, 5))
POLES = (Fraction(1, 2), Fraction(2))


def observers(agent: Agent, internal_order: int) -> tuple[Agent, ...]:
    """Less damping: at the same bandwidth the observer lags less behind a steady acceleration, and peaks more."""
    if agent.observer is not None or agent.order < 2:
        return ()
    return tuple(replace(agent, observer=damped_polynomial(agent.order, damping)) for damping in DAMPINGS)


def surfaces(agent: Agent, internal_order: int) -> tuple[Agent, ...]:
    """``γ`` with less damping; for ``n = 2`` it is a multiple of ``g``."""
    if agent.gamma is not None or agent.order < 3:
        return ()
    return tuple(replace(agent, gamma=damped_polynomial(agent.order - 1, damping)) for damping in DAMPINGS)


def internal_models(agent: Agent, internal_order: int) -> tuple[Agent, ...]:
    """A slower one asks for less input and settles later, a faster one the other way round."""
    if agent.internal_model is not None or internal_order < 1:
        return ()
    return tuple(replace(agent, internal_model=companion_pair(internal_order, pole)) for pole in POLES)


STAGES: tuple[Callable[[Agent, int], tuple[Agent, ...]], ...] = (observers, surfaces, internal_models)
