"""One point of ``W × V0 × (initial box)``: the parameters and the initial state of a simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Interval, Plant

Floats = tuple[float, ...]
Draw = Literal["uniform", "vertex"]
Choice = Callable[[Sequence[Interval]], Floats]


@dataclass(frozen=True)
class AgentStart:
    """``w`` (in the order of ``Agent.parameters``) and ``z(0), x(0), x̃(0), η(0)`` of one agent."""

    parameters: Floats
    z: Floats
    x: Floats
    observer: Floats
    eta: Floats


@dataclass(frozen=True)
class Scenario:
    """``v(0)``, ``y^r(0)``, ``ζ(0)`` and one :class:`AgentStart` per agent.

    The controller starts with ``ζ(0) = 0`` and ``ξ(0) = I``; another ``ζ(0)`` is for experiments (``rᵀζ`` is
    conserved, so the outputs then settle elsewhere than at ``s*``).
    """

    v: Floats
    reference: Floats
    zeta: Floats
    agents: tuple[AgentStart, ...]

    def with_zeta(self, zeta: Sequence[float]) -> Scenario:
        """The same with another ``ζ(0)``, one value per agent."""
        if len(zeta) != len(self.agents):
            raise InputError(f"zeta(0) has {len(zeta)} values for {len(self.agents)} agents")
        return replace(self, zeta=tuple(map(float, zeta)))

    def with_agent(
        self,
        number: int,
        *,
        parameters: Sequence[float] | None = None,
        z: Sequence[float] | None = None,
        x: Sequence[float] | None = None,
        observer: Sequence[float] | None = None,
        eta: Sequence[float] | None = None,
    ) -> Scenario:
        """The same with other values for agent ``number`` (1 … N). Raises ``InputError`` for a wrong length."""
        if not 1 <= number <= len(self.agents):
            raise InputError(f"there is no agent {number}")
        start = self.agents[number - 1]
        given = {"parameters": parameters, "z": z, "x": x, "observer": observer, "eta": eta}
        changed: dict[str, Floats] = {}
        for name, values in given.items():
            if values is None:
                continue
            if len(values) != len(getattr(start, name)):
                raise InputError(
                    f"agent {number}: {name} has {len(values)} values and needs {len(getattr(start, name))}"
                )
            changed[name] = tuple(map(float, values))
        agents = (*self.agents[: number - 1], replace(start, **changed), *self.agents[number:])
        return replace(self, agents=agents)

    def with_parameters(self, values: Mapping[int, Mapping[str, float]], plant: Plant) -> Scenario:
        """The same with the named parameters of the given agents replaced."""
        scenario = self
        for number, named in values.items():
            if not 1 <= number <= len(self.agents):
                raise InputError(f"there is no agent {number}")
            names = [parameter.name for parameter in plant.agents[number - 1].parameters]
            for name in named:
                if name not in names:
                    raise InputError(f"agent {number} has no parameter {name}")
            old = scenario.agents[number - 1].parameters
            new = [named.get(name, value) for name, value in zip(names, old, strict=True)]
            scenario = scenario.with_agent(number, parameters=new)
        return scenario


def nominal(plant: Plant, controller: Controller) -> Scenario:
    """The centre of every interval."""
    return _choose(plant, controller, _centre, _centre)


def random_scenario(
    plant: Plant,
    controller: Controller,
    seed: int | Sequence[int],
    *,
    parameters: Draw = "uniform",
    start: Draw = "uniform",
) -> Scenario:
    """A seeded draw: ``w`` from ``W`` and the initial state from ``V0`` and the box, uniform or among the vertices."""
    generator = np.random.default_rng(seed)

    def uniform(box: Sequence[Interval]) -> Floats:
        return tuple(float(generator.uniform(float(side.lo), float(side.hi))) for side in box)

    def vertex(box: Sequence[Interval]) -> Floats:
        return tuple(float((side.lo, side.hi)[generator.integers(2)]) for side in box)

    draws: dict[str, Choice] = {"uniform": uniform, "vertex": vertex}
    return _choose(plant, controller, draws[parameters], draws[start])


def _centre(box: Sequence[Interval]) -> Floats:
    return tuple(float((side.lo + side.hi) / 2) for side in box)


def _choose(plant: Plant, controller: Controller, parameters: Choice, start: Choice) -> Scenario:
    agents = []
    for agent, law in zip(plant.agents, controller.agents, strict=True):
        initial = agent.initial
        x = start(initial.x)
        if agent.order == 1:
            observer: Floats = ()
        elif initial.observer is None:
            observer = (x[0],) + (0.0,) * (agent.order - 1)
        else:
            observer = start(initial.observer)
        agents.append(
            AgentStart(
                parameters=parameters(agent.parameter_box),
                z=start(initial.z),
                x=x,
                observer=observer,
                eta=start((initial.eta,) * len(law.N)),
            )
        )
    return Scenario(
        v=start(plant.exosystem.initial),
        reference=tuple(start((agent.initial.reference,))[0] for agent in plant.agents),
        zeta=(0.0,) * len(plant.agents),
        agents=tuple(agents),
    )
