"""One agent in other units: its plant, what is derived of it, what it sees, and what is asked of it
(docs/units.md section 2)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction

import sympy

from certify.agent_model import AgentModel, InternalModelData, References
from certify.coordinator.envelope import AgentEnvelope, Envelope
from certify.units.scales import ONE, Row, Scales
from symbolic.plant import (
    COST_VARIABLE,
    Agent,
    Exosystem,
    InitialBox,
    InternalModelChoice,
    Interval,
    RequestedGains,
    Requirements,
    Settling,
)


def scaled_agent(agent: Agent, scales: Scales) -> Agent:
    """The same plant: ``x̂_n' = f̂ + b̂ û``, ``ẑ' = f̂0``; ``γ`` and the observer's ``c`` have no unit. A Lyapunov function
    of the user's is left out: nobody here asks for it."""
    states = _substitution(agent, scales)
    per_force, initial = 1 / scales.force, agent.initial
    observer = None if initial.observer is None else _each(initial.observer, scales.chain)
    return replace(
        agent,
        zero_dynamics=tuple(
            _times(scales.time / z, f0.xreplace(states))
            for f0, z in zip(agent.zero_dynamics, scales.zeros, strict=True)
        ),
        f=_times(per_force, agent.f.xreplace(states)),
        b=_times(1 / scales.b, agent.b),
        initial=InitialBox(
            _each(initial.z, scales.zeros),
            _each(initial.x, scales.chain),
            observer,
            _divided(initial.eta, scales.input),
            _divided(initial.reference, scales.output),
        ),
        steady_state=None,
        lyapunov=None,
        internal_model=None if agent.internal_model is None else scaled_pair(agent.internal_model, scales.time),
        guards=agent.guards.at(states),
    )


def scaled_pair(pair: InternalModelChoice, time: Fraction) -> InternalModelChoice:
    """``η̂' = TM η̂ + TN û``: ``η`` has the unit of the input."""
    rows = tuple(tuple(time * entry for entry in row) for row in pair.M)
    return InternalModelChoice(rows, tuple(time * entry for entry in pair.N))


def scaled_model(model: AgentModel, scales: Scales) -> AgentModel:
    """What is derived of the plant, transformed instead of derived anew."""
    s = {COST_VARIABLE: _rational(scales.output) * COST_VARIABLE}
    exosystem, references = model.exosystem, model.references
    return AgentModel(
        agent=scaled_agent(model.agent, scales),
        exosystem=Exosystem(exosystem.states, exosystem.S * _rational(scales.time), exosystem.initial),
        steady_state=tuple(
            _times(1 / z, component.xreplace(s)) for component, z in zip(model.steady_state, scales.zeros, strict=True)
        ),
        internal_model=_internal_model(model.internal_model, scales),
        gamma=model.gamma,
        observer=model.observer,
        optimum=_divided(model.optimum, scales.output),
        disturbance=model.disturbance,
        extent=model.extent,
        references=References(
            references.peak / scales.output,
            references.energy / scales.output**2 / scales.time,
            references.rate_energy / scales.output**2 * scales.time,
        ),
        scales=scales,
    )


def scaled_envelope(envelope: Envelope, index: int, scales: Scales) -> Envelope:
    """The coordinator as agent ``index`` sees it; the others' parts are left as they are: nobody looks at them."""
    agents = list(envelope.agents)
    agents[index] = _agent_envelope(agents[index], scales)
    return replace(
        envelope,
        times=tuple(time / scales.time for time in envelope.times),
        tail_decay=envelope.tail_decay * scales.time,
        agents=tuple(agents),
    )


def scaled_gains(gains: RequestedGains, scales: Scales) -> RequestedGains:
    def divided(value: Fraction | None, scale: Fraction) -> Fraction | None:
        return None if value is None else value / scale

    return RequestedGains(
        divided(gains.g, scales.rate),
        divided(gains.K, scales.K),
        divided(gains.delta, scales.input),
        divided(gains.h, scales.rate),
    )


def scaled_requirements(asked: Requirements, scales: Scales) -> Requirements:
    settling = asked.settling
    return replace(
        asked,
        settling=None if settling is None else Settling(settling.time / scales.time, settling.band / scales.output),
        input=None if asked.input is None else asked.input / scales.input,
        bandwidth=None if asked.bandwidth is None else asked.bandwidth / scales.rate,
    )


def _internal_model(data: InternalModelData, scales: Scales) -> InternalModelData:
    """``τ_k = d^(k−1)u*/dt^(k−1)`` and ``η = Tτ``, which has the unit of the input."""
    time, order = scales.time, data.order
    s = {COST_VARIABLE: _rational(scales.output) * COST_VARIABLE}
    derivatives = [scales.input / time**k for k in range(order)]
    return InternalModelData(
        ell=tuple(time ** (order - k) * entry for k, entry in enumerate(data.ell)),
        M=tuple(tuple(time * entry for entry in row) for row in data.M),
        N=tuple(time * entry for entry in data.N),
        T=tuple(tuple(entry / time**k for k, entry in enumerate(row)) for row in data.T),
        psi=data.psi,
        tau=tuple(_times(1 / scale, entry.xreplace(s)) for entry, scale in zip(data.tau, derivatives, strict=True)),
    )


def _agent_envelope(agent: AgentEnvelope, scales: Scales) -> AgentEnvelope:
    y, t = scales.output, scales.time
    return replace(
        agent,
        reference=tuple(_divided(side, y) for side in agent.reference),
        deviation=tuple(value / y for value in agent.deviation),
        rate=tuple(value / y * t for value in agent.rate),
        tail_deviation=agent.tail_deviation / y,
        tail_rate=agent.tail_rate / y * t,
        peak=agent.peak / y,
        rate_peak=agent.rate_peak / y * t,
        energy=agent.energy / y**2 / t,
        rate_energy=agent.rate_energy / y**2 * t,
    )


def _substitution(agent: Agent, scales: Scales) -> Mapping[sympy.Symbol, sympy.Expr]:
    names, factors = (*agent.zero_states, *agent.chain), (*scales.zeros, *scales.chain)
    return {x: _rational(factor) * x for x, factor in zip(names, factors, strict=True) if factor != ONE}


def _times(factor: Fraction, expression: sympy.Expr) -> sympy.Expr:
    return expression if factor == ONE else _rational(factor) * expression


def _each(sides: Iterable[Interval], scales: Row) -> tuple[Interval, ...]:
    return tuple(_divided(side, scale) for side, scale in zip(sides, scales, strict=True))


def _divided(side: Interval, scale: Fraction) -> Interval:
    return Interval(side.lo / scale, side.hi / scale)


def _rational(value: Fraction) -> sympy.Rational:
    return sympy.Rational(value.numerator, value.denominator)
