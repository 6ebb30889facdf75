"""All assumptions of a plant, each decided with evidence (theory.md section 2)."""

from __future__ import annotations

from dataclasses import replace
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
from symbolic.steady_state import SteadyState


def check_assumptions(plant: Plant) -> CheckReport:
    """Decide A0 … A6. Raises InputError where the user's own answers use names that they may not."""
    spectrum = check_exosystem(plant.exosystem)
    s_star = _exact_optimum(plant)
    kinds: dict[Agent, tuple[Finding, ...]] = {}
    decided: list[Finding] = [spectrum, check_network(plant.digraph)]
    for agent in plant.agents:
        kind = replace(agent, id=0, cost=sympy.S.Zero)
        if kind not in kinds:
            kinds[kind] = _dynamics(agent, plant.exosystem, s_star, spectrum)
        decided.append(check_cost(agent))
        decided.extend(replace(finding, agent=agent.id) for finding in kinds[kind])
    return CheckReport(tuple(sorted(decided, key=lambda finding: finding.id)))


def _dynamics(
    agent: Agent, exosystem: Exosystem, s_star: Fraction | None, spectrum: Finding
) -> tuple[Finding, Finding, Finding, Finding]:
    """A0, A3, A5 and A6 of one agent; they do not depend on its number or its cost."""
    found = solve_regulator(agent, exosystem)
    steady_state = found if isinstance(found, SteadyState) else None
    return (
        check_origin(agent, exosystem),
        check_regulator(agent, found),
        _steady_input(agent, exosystem, steady_state, s_star, spectrum),
        check_zero_dynamics(agent, exosystem, steady_state, s_star),
    )


def _exact_optimum(plant: Plant) -> Fraction | None:
    try:
        return optimum(plant).exact
    except NoOptimumError:
        return None


def _steady_input(
    agent: Agent, exosystem: Exosystem, steady_state: SteadyState | None, s_star: Fraction | None, spectrum: Finding
) -> Finding:
    """A5 rests on ``z*`` (A3) and on the spectrum of ``S`` (A4)."""
    if steady_state is None:
        return Finding("A5", agent.id, "unknown", "u* needs the steady state of A3, which was not found")
    if spectrum.verdict != "holds":
        return Finding("A5", agent.id, "unknown", "an internal model needs A4, which was not proved")
    value: sympy.Expr = COST_VARIABLE if s_star is None else as_rational(s_star)
    return check_steady_input(agent, exosystem, steady_state, value)
