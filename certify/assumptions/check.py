"""All assumptions of a plant, each decided with evidence (theory.md section 2)."""

from __future__ import annotations

from fractions import Fraction

import sympy

from certify.assumptions.a0_origin import check_origin
from certify.assumptions.a1_costs import check_cost
from certify.assumptions.a2_network import check_network
from certify.assumptions.a3_regulator import check_regulator
from certify.assumptions.a4_exosystem import check_exosystem
from certify.assumptions.a5_steady_input import check_steady_input
from certify.assumptions.a6_zero_dynamics import check_zero_dynamics
from certify.assumptions.findings import CheckReport, Finding
from certify.optimum import NoOptimumError, optimum
from symbolic.constants import as_rational
from symbolic.plant import COST_VARIABLE, Agent, Exosystem, Plant
from symbolic.regulator import solve_regulator
from symbolic.steady_state import NoSteadyState, SteadyState


def check_assumptions(plant: Plant) -> CheckReport:
    """Decide A0 … A6. Raises InputError where the user's own answers use names that they may not."""
    exosystem = plant.exosystem
    agents = plant.agents
    s_star = _exact_optimum(plant)
    spectrum = check_exosystem(exosystem)
    steady = [solve_regulator(agent, exosystem) for agent in agents]
    pairs = list(zip(agents, steady, strict=True))
    findings = [
        *(check_origin(agent, exosystem) for agent in agents),
        *(check_cost(agent) for agent in agents),
        check_network(plant.digraph),
        *(check_regulator(agent, found) for agent, found in pairs),
        spectrum,
        *(_steady_input(agent, exosystem, found, s_star, spectrum) for agent, found in pairs),
        *(
            check_zero_dynamics(agent, exosystem, found if isinstance(found, SteadyState) else None, s_star)
            for agent, found in pairs
        ),
    ]
    return CheckReport(tuple(findings))


def _exact_optimum(plant: Plant) -> Fraction | None:
    try:
        return optimum(plant).exact
    except NoOptimumError:
        return None


def _steady_input(
    agent: Agent, exosystem: Exosystem, found: SteadyState | NoSteadyState, s_star: Fraction | None, spectrum: Finding
) -> Finding:
    """A5 rests on ``z*`` (A3) and on the spectrum of ``S`` (A4)."""
    if isinstance(found, NoSteadyState):
        return Finding("A5", agent.id, "unknown", "u* needs the steady state of A3, which was not found")
    if spectrum.verdict != "holds":
        return Finding("A5", agent.id, "unknown", "an internal model needs A4, which was not proved")
    value: sympy.Expr = COST_VARIABLE if s_star is None else as_rational(s_star)
    return check_steady_input(agent, exosystem, found, value)
