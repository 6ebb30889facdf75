"""A whole plant measured in other units: the same plant, other numbers (docs/units.md section 1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import sympy

from certify.units.apply import scaled_agent, scaled_gains, scaled_requirements
from certify.units.scales import ONE, Scales
from symbolic.plant import (
    COST_VARIABLE,
    Agent,
    CoordinatorChoice,
    Exosystem,
    Implementation,
    Interval,
    Plant,
)


@dataclass(frozen=True)
class Measure:
    """``t = T t̂``, ``y = Y ŷ``, ``z = Z ẑ``, ``v = V v̂``, ``u = U û``, ``c = Q ĉ``, for all agents alike."""

    time: Fraction = ONE
    output: Fraction = ONE
    zeros: Fraction = ONE
    disturbance: Fraction = ONE
    input: Fraction = ONE
    cost: Fraction = ONE

    def scales(self, agent: Agent) -> Scales:
        """Without the disturbance and the cost."""
        zeros = (self.zeros,) * len(agent.zero_states)
        return Scales(self.time, self.output, zeros, self.input, agent.order)

    @property
    def gradient_gain(self) -> Fraction:
        """Of ``κ``: ``ẏ = −κ c'(y)``."""
        return self.output**2 / self.time / self.cost


def measured(plant: Plant, measure: Measure) -> Plant:
    """The plant with every number in the units of ``measure``. It has no source: ``with_source`` of the plant's writer
    makes one."""
    scales = [measure.scales(agent) for agent in plant.agents]
    exosystem = plant.exosystem
    return replace(
        plant,
        exosystem=Exosystem(
            exosystem.states,
            exosystem.S * _rational(measure.time),
            tuple(_divided(side, measure.disturbance) for side in exosystem.initial),
        ),
        agents=tuple(_agent(agent, plant, measure) for agent in plant.agents),
        coordinator=_coordinator(plant.coordinator, measure),
        gains=tuple(
            scaled_gains(gains, own) for gains, own in zip(plant.gains, scales[: len(plant.gains)], strict=True)
        ),
        requirements=tuple(
            scaled_requirements(asked, own)
            for asked, own in zip(plant.requirements, scales[: len(plant.requirements)], strict=True)
        ),
        implementations=tuple(_implementation(one, measure) for one in plant.implementations),
        sha256="",
        source=b"",
    )


def _agent(agent: Agent, plant: Plant, measure: Measure) -> Agent:
    scales = measure.scales(agent)
    v = {state: _rational(measure.disturbance) * state for state in plant.exosystem.states}
    s = {COST_VARIABLE: _rational(measure.output) * COST_VARIABLE}
    z = {state: _rational(measure.zeros) * state for state in agent.zero_states}
    there, steady, size = scaled_agent(agent, scales), agent.steady_state, _rational(measure.zeros)
    return replace(
        there,
        zero_dynamics=tuple(f0.xreplace(v) for f0 in there.zero_dynamics),
        f=there.f.xreplace(v),
        cost=agent.cost.xreplace(s) / _rational(measure.cost),
        steady_state=None if steady is None else tuple(z.xreplace({**s, **v}) / size for z in steady),
        lyapunov=None if agent.lyapunov is None else agent.lyapunov.xreplace(z),
        guards=there.guards.at({**s, **v}),
    )


def _coordinator(choice: CoordinatorChoice, measure: Measure) -> CoordinatorChoice:
    rate, time = 1 / measure.time, measure.time
    units = {
        "alpha1": rate,
        "alpha2": rate,
        "gradient_gain": measure.gradient_gain,
        "mixing_gain": rate,
        "mixing_time": time,
        "softening": rate,
        "period": time,
    }
    values = {key: getattr(choice, key) for key in units}
    return CoordinatorChoice(**{key: None if value is None else value / units[key] for key, value in values.items()})


def _implementation(one: Implementation, measure: Measure) -> Implementation:
    return replace(
        one,
        period=one.period / measure.time,
        delay=None if one.delay is None else _divided(one.delay, measure.time),
        noise=None if one.noise is None else one.noise / measure.output,
        input_resolution=None if one.input_resolution is None else one.input_resolution / measure.input,
    )


def _divided(side: Interval, scale: Fraction) -> Interval:
    return Interval(side.lo / scale, side.hi / scale)


def _rational(value: Fraction) -> sympy.Rational:
    return sympy.Rational(value.numerator, value.denominator)
