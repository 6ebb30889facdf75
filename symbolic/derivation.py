"""Everything that is derived from a plant before any gain is chosen, agent by agent (theory.md sections 2, 3)."""

from __future__ import annotations

from functools import lru_cache

import sympy

from symbolic.coordinates import error_system
from symbolic.derivation_text import as_dict, as_latex, as_text
from symbolic.derived import AgentDerivation, Derivation
from symbolic.design import design_polynomials
from symbolic.internal_model import InternalModel, NoInternalModel, internal_model
from symbolic.named_equations import named_equations
from symbolic.plant import Agent, Plant
from symbolic.point_parameters import without_point_parameters
from symbolic.regulator import solve_regulator
from symbolic.steady_state import NoSteadyState, SteadyState

__all__ = ["AgentDerivation", "Derivation", "as_dict", "as_latex", "as_text", "derive", "derive_agent"]


def derive_agent(agent: Agent, plant: Plant, s_star: sympy.Expr) -> AgentDerivation:
    """Steady state, internal model, design polynomials and error system of one agent.

    ``s_star`` is exact, or the symbol ``s``. Raises ``InputError`` for a design polynomial or a pair (M, N)
    that does not fit.
    """
    exosystem = plant.exosystem
    design = design_polynomials(agent)
    steady = solve_regulator(agent, exosystem)
    if isinstance(steady, NoSteadyState):
        return AgentDerivation(agent, steady, None, design, None, None)
    model = internal_model(agent, exosystem, steady, s_star)
    if isinstance(model, NoInternalModel):
        return AgentDerivation(agent, steady, model, design, None, None)
    return AgentDerivation(
        agent,
        steady,
        model,
        design,
        error_system(agent, exosystem, steady, model, s_star),
        named_equations(agent, exosystem, steady, model, s_star),
    )


@lru_cache(maxsize=4)
def derive(plant: Plant, s_star: sympy.Expr) -> Derivation:
    """``derive_agent`` for every agent, and the agents grouped into types. Several steps of a command ask for it; it
    is computed once."""
    agents = tuple(derive_agent(agent, plant, s_star) for agent in plant.agents)
    types: dict[tuple[object, ...], list[int]] = {}
    for derived in agents:
        types.setdefault(_structure(derived), []).append(derived.id)
    return Derivation(plant.name, s_star, plant.exosystem, agents, tuple(tuple(ids) for ids in types.values()))


def _structure(derived: AgentDerivation) -> tuple[object, ...]:
    agent = without_point_parameters(derived.agent)
    outcome = tuple(
        part if isinstance(part, SteadyState | InternalModel) else str(part)
        for part in (derived.steady_state, derived.internal_model)
    )
    return agent.order, agent.zero_states, agent.zero_dynamics, agent.f, agent.b, derived.design, outcome
