"""Controllers and starts for the five agents that several tests simulate."""

from __future__ import annotations

import dataclasses
from fractions import Fraction
from typing import Any

from sims import Scenario, nominal
from symbolic.controller import AgentController, Controller, CoordinatorGains
from symbolic.design import design_polynomials
from symbolic.internal_model import InternalModel, internal_model
from symbolic.plant import COST_VARIABLE, Interval, Plant
from symbolic.regulator import solve_regulator
from symbolic.steady_state import SteadyState


def controller_for(
    plant: Plant, g: float, K: float, h: float, delta: float, alpha: tuple[int, int] = (5, 5)
) -> Controller:
    """The derived internal models and default polynomials with the same gains for every agent."""
    laws = []
    for agent in plant.agents:
        steady_state = solve_regulator(agent, plant.exosystem)
        assert isinstance(steady_state, SteadyState)
        model = internal_model(agent, plant.exosystem, steady_state, COST_VARIABLE)
        assert isinstance(model, InternalModel)
        design = design_polynomials(agent)
        laws.append(
            AgentController(
                id=agent.id,
                gamma=design.gamma,
                observer=design.observer,
                M=model.M,
                N=model.N,
                psi=model.psi,
                g=Fraction(g),
                K=Fraction(K),
                delta=Fraction(delta),
                h=Fraction(h) if agent.order > 1 else None,
            )
        )
    return Controller(CoordinatorGains(Fraction(alpha[0]), Fraction(alpha[1])), tuple(laws))


def with_gains(controller: Controller, **gains: Any) -> Controller:
    exact = {name: Fraction(value) for name, value in gains.items()}
    return dataclasses.replace(controller, agents=tuple(dataclasses.replace(law, **exact) for law in controller.agents))


def corner(plant: Plant, controller: Controller) -> Scenario:
    """Agents 1 and 2 at ``p = (−i + ½, i + ½, i + ½)``, ``z = x1 = x2 = 1``."""
    scenario = nominal(plant, controller)
    for i in (1, 2):
        scenario = scenario.with_agent(i, parameters=(-i + 0.5, i + 0.5, i + 0.5), z=[1], x=[1, 1])
    return scenario


def at_the_centre(plant: Plant) -> Plant:
    """The same with every parameter and every initial state at the centre of its interval."""

    def centre(side: Interval) -> Interval:
        return Interval((side.lo + side.hi) / 2, (side.lo + side.hi) / 2)

    agents = []
    for agent in plant.agents:
        initial = dataclasses.replace(
            agent.initial, z=tuple(map(centre, agent.initial.z)), x=tuple(map(centre, agent.initial.x))
        )
        box = tuple(map(centre, agent.parameter_box))
        agents.append(dataclasses.replace(agent, initial=initial, parameter_box=box))
    return dataclasses.replace(plant, agents=tuple(agents))
