"""Parameters whose interval is a single point are constants: the identities need to hold at that value only."""

from __future__ import annotations

from dataclasses import replace

from symbolic.constants import as_rational
from symbolic.plant import Agent


def without_point_parameters(agent: Agent) -> Agent:
    """The same agent with every parameter of zero width replaced by its value; the remaining box has an interior.

    On such a box two analytic functions of the parameters agree iff they agree as functions.
    """
    box = list(zip(agent.parameters, agent.parameter_box, strict=True))
    values = {name: as_rational(interval.lo) for name, interval in box if interval.is_point}
    if not values:
        return agent
    kept = [(name, interval) for name, interval in box if name not in values]
    given = agent.steady_state
    return replace(
        agent,
        zero_dynamics=tuple(expr.xreplace(values) for expr in agent.zero_dynamics),
        f=agent.f.xreplace(values),
        b=agent.b.xreplace(values),
        parameters=tuple(name for name, _ in kept),
        parameter_box=tuple(interval for _, interval in kept),
        steady_state=None if given is None else tuple(expr.xreplace(values) for expr in given),
        lyapunov=None if agent.lyapunov is None else agent.lyapunov.xreplace(values),
        guards=agent.guards.at(values),
    )
