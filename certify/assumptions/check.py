"""All assumptions of a plant, each decided with evidence (theory.md section 2)."""

from __future__ import annotations

from dataclasses import replace

import sympy

from certify.assumptions.a0_origin import check_origin
from certify.assumptions.a1_costs import check_cost
from certify.assumptions.a2_network import check_network
from certify.assumptions.a3_regulator import check_regulator
from certify.assumptions.a4_exosystem import check_exosystem
from certify.assumptions.a5_steady_input import check_steady_input
from certify.assumptions.a6_zero_dynamics import check_zero_dynamics
from certify.assumptions.findings import CheckReport, Finding
from certify.assumptions.second_opinion import SecondOpinion
from certify.bounds.roots import root_brackets
from certify.foreseen import seen_optimum
from certify.optimum import NoOptimumError, Optimum, optimum
from symbolic.constants import as_rational
from symbolic.internal_model import InternalModel, internal_model
from symbolic.plant import COST_VARIABLE, Agent, Exosystem, Interval, Plant
from symbolic.regulator import solve_regulator
from symbolic.steady_state import NoSteadyState, SteadyState


def check_assumptions(plant: Plant) -> CheckReport:
    """Decide A0 … A6. Raises InputError where the user's own answers use names that they may not.

    What holds is proved here and seen by the independent checker too, but for A6, which depends on the certificate.
    """
    seen = _optimum(plant)
    opinion = SecondOpinion(plant, seen)
    spectrum = check_exosystem(plant.exosystem)
    kinds: dict[Agent, tuple[Finding, ...]] = {}
    decided: list[Finding] = [opinion.on_exosystem(spectrum), opinion.on_network(check_network(plant.digraph))]
    for agent in plant.agents:
        kind = replace(agent, id=0, cost=sympy.S.Zero, guards=replace(agent.guards, cost=()))
        if kind not in kinds:
            kinds[kind] = _dynamics(agent, plant.exosystem, seen, spectrum, opinion)
        decided.append(opinion.on_cost(check_cost(agent), agent.id))
        decided.extend(replace(finding, agent=agent.id) for finding in kinds[kind])
    return CheckReport(tuple(sorted(decided, key=lambda finding: finding.id)))


def _dynamics(
    agent: Agent, exosystem: Exosystem, seen: Optimum | None, spectrum: Finding, opinion: SecondOpinion
) -> tuple[Finding, Finding, Finding, Finding]:
    """A0, A3, A5 and A6 of one agent; they do not depend on its number or its cost."""
    found = solve_regulator(agent, exosystem)
    roots = _roots(agent, found, seen)
    steady_state = found if isinstance(found, SteadyState) and not isinstance(roots, str) else None
    regulator = check_regulator(agent, found, roots)
    if steady_state is not None:
        regulator = opinion.on_steady_state(regulator, agent.id, steady_state)
    return (
        opinion.on_origin(check_origin(agent, exosystem), agent.id),
        regulator,
        _steady_input(agent, exosystem, steady_state, seen, spectrum, opinion),
        check_zero_dynamics(agent, exosystem, None if roots else steady_state, None if seen is None else seen.exact),
    )


def _roots(
    agent: Agent, found: SteadyState | NoSteadyState, seen: Optimum | None
) -> dict[sympy.Symbol, Interval] | str:
    """Around the components of ``z*`` without closed form; a reason where they are not enclosed."""
    if not isinstance(found, SteadyState) or not found.roots:
        return {}
    if seen is None:
        return "the zero of f0 is enclosed around the optimum, which A1 leaves open"
    return root_brackets(agent, found, seen.enclosure)


def _optimum(plant: Plant) -> Optimum | None:
    try:
        return seen_optimum(plant, optimum(plant)) if plant.source else optimum(plant)
    except NoOptimumError:
        return None


def _steady_input(
    agent: Agent,
    exosystem: Exosystem,
    steady_state: SteadyState | None,
    seen: Optimum | None,
    spectrum: Finding,
    opinion: SecondOpinion,
) -> Finding:
    """A5 rests on ``z*`` (A3) and on the spectrum of ``S`` (A4)."""
    if steady_state is None:
        return Finding("A5", agent.id, "unknown", "u* needs the steady state of A3, which was not found")
    if spectrum.verdict != "holds":
        return Finding("A5", agent.id, "unknown", "an internal model needs A4, which was not proved")
    value: sympy.Expr = COST_VARIABLE if seen is None or seen.exact is None else as_rational(seen.exact)
    model = internal_model(agent, exosystem, steady_state, value)
    finding = check_steady_input(agent, steady_state, model)
    if isinstance(model, InternalModel):
        finding = opinion.on_steady_input(finding, agent.id, steady_state, model)
    return finding
