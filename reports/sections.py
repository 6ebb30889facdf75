"""The report's sections as plain data for the templates: strings, numbers and lists only."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import isfinite
from typing import Any

from certify.routes import DEFAULT, ROUTES
from certify.statement.claim import CertifiedGains
from certify.statement.controller import certified_controller
from certify.statement.numbers import fraction, scientific, shown
from reports import cells, tables
from reports.agent_types import coordinates_section
from reports.attraction import attraction_section
from reports.coordinator_section import coordinator_section
from reports.cross_checked import ending, sentence
from reports.figures import style, svg
from reports.gains_sections import claim_section, gains_section, numbers_section, stability_rows
from reports.network_figure import draw_network
from reports.paper_notes import notes_for
from reports.performance_figures import LOOPS_UP_TO
from reports.provenance import reproducibility_section
from reports.region_sections import region_section
from reports.simulation import simulation_section
from reports.study import Conclusion, Study, conclusion
from reports.typst_math import matrix, number, number_text, typst
from sims.closed_loop import Trajectory
from sims.cross_check import CrossCheck
from sims.loop_response import LoopResponse, loop_response
from symbolic.controller import CoordinatorGains
from symbolic.network import cuts, is_balanced
from symbolic.plant import Agent, Digraph, Exosystem, Interval, Plant
from symbolic.steady_state import SteadyState

DRAWN_UP_TO = 200
OPTIMUM_DIGITS = 13
NETWORK_SIZES = ((2, (4.4, 1.2)), (16, (5.4, 2.9)), (DRAWN_UP_TO, (6.4, 4.4)))  # most agents, inches


def document_data(study: Study) -> dict[str, Any]:
    """Everything the templates show. Of a certificate that does not stand, that is its gains and no bound."""
    ended = conclusion(study)
    certified = study.certified
    stands = ended.status == "certified" or certified is None
    return {
        "name": cells.text(study.plant.name, 120)["text"],
        "date": None if study.date is None else study.date.isoformat(),
        "status": ended.status,
        "verified": ended.verified,
        "reason": cells.text(ended.reason, 1500) if ended.reason else None,
        "route": cells.text(_route(study, certified)),
        "texts": _texts(study, certified),
        "optimum": _optimum(study),
        "plant": plant_section(study.plant),
        "network": network_section(study.plant.digraph),
        "check": None
        if study.check is None
        else {"status": study.check.status, "rows": tables.assumptions_table(study.check)},
        "types": None if study.derivation is None else coordinates_section(study.derivation, study.plant.agents),
        "coordinator": coordinator_section(_coordinator(study, certified)),
        "gains": gains_section(study, certified, stands),
        "region": _region(study, certified, ended),
        "stability": None if study.gains is None else stability_rows(study.gains),
        "numbers": numbers_section(study.gains, certified) if stands else numbers_section(None, None),
        "claim": claim_section(study, certified),
        "simulation": None
        if study.trajectory is None
        else simulation_section(study.trajectory, study.simulated, certified, study.seed, stands),
        "attraction": attraction_section(study.slices) if ended.verified else None,
        "search": None if study.search is None else _search(study.search, study),
        "notes": [
            {
                "id": n.id,
                "printed": n.printed,
                "truth": n.truth,
                "consequence": n.here(_route(study, certified)),
            }
            for n in notes_for(study.plant)
        ],
        "reproducibility": reproducibility_section(study),
    }


def _route(study: Study, certified: CertifiedGains | None) -> str:
    if certified is not None:
        return certified.route
    return study.gains.route if study.gains else "–"


def _coordinator(study: Study, certified: CertifiedGains | None) -> CoordinatorGains | None:
    if certified is not None:
        return certified.coordinator
    return None if study.simulated is None else study.simulated.coordinator


def _texts(study: Study, certified: CertifiedGains | None) -> str:
    """The route whose words templates/routes.typ has for this report."""
    route = _route(study, certified)
    return route if route in ROUTES else DEFAULT


def _region(study: Study, certified: CertifiedGains | None, ended: Conclusion) -> dict[str, Any] | None:
    """Bounds are stated only where the checker has verified the certificate."""
    if study.bounds is None or certified is None or not ended.verified:
        return None
    runs: tuple[Trajectory, ...] = ()
    if study.trajectory is not None and study.simulated is not None and certified.same_as(study.simulated):
        runs = (study.trajectory, *study.runs)
    return region_section(study.bounds, certified, study.plant, study.gains, runs, _responses(study))


def _responses(study: Study) -> list[LoopResponse]:
    """The open loops of agents that differ, the first few of them."""
    optimum = study.optimum if study.optimum is not None else None
    if optimum is None and study.optimum_enclosure is not None:
        optimum = (study.optimum_enclosure.lo + study.optimum_enclosure.hi) / 2
    if study.derivation is None or optimum is None:
        return []
    controller = certified_controller(study.found_certificate or {}, study.plant, "the certificate")
    found: list[LoopResponse] = []
    for agent, derived, law in zip(study.plant.agents, study.derivation.agents, controller.agents, strict=True):
        if len(found) < LOOPS_UP_TO and isinstance(derived.steady_state, SteadyState):
            response = loop_response(agent, law, derived.steady_state, float(optimum))
            found += [] if response is None else [response]
    return found


def _search(found: CrossCheck, study: Study) -> dict[str, Any]:
    margin = shown(Fraction(found.worst_margin), 2, "down").text if isfinite(found.worst_margin) else "–"
    return {
        "status": ending(found),
        "trajectories": cells.text(found.count),
        "margin": cells.text(margin),
        "reason": cells.text(sentence(found, len(study.plant.agents))),
        "asked": cells.text(found.asked),
        "bounded": study.bounds is not None,
    }


def _optimum(study: Study) -> cells.Cell | None:
    if study.optimum is not None:
        return cells.math(f"= {number(fraction(study.optimum))}")
    if study.optimum_enclosure is not None:
        return cells.math(f"in {_around(study.optimum_enclosure)}")
    return None


def _around(enclosure: Interval) -> str:
    """``m ± ρ`` that contains the enclosure, ``m`` its middle to thirteen digits."""
    middle = scientific((enclosure.lo + enclosure.hi) / 2, OPTIMUM_DIGITS)
    radius = max(enclosure.hi - Fraction(middle), Fraction(middle) - enclosure.lo)
    return f"{number_text(middle)} plus.minus {number_text(scientific(radius, 1, 'up'))}"


def network_section(digraph: Digraph) -> dict[str, Any]:
    """The drawing and what it shows."""
    found = cuts(digraph)
    drawn = digraph.agents <= DRAWN_UP_TO
    if drawn:
        width, height = next(size for most, size in NETWORK_SIZES if digraph.agents <= most)
        with style():
            figure = draw_network(digraph, width, height)
        picture = {"svg": svg(figure), "width": 72 * width}
    else:
        picture = {"svg": None, "width": 0}
    size = _counted(digraph.agents, "agent"), _counted(len(digraph.edges), "directed edge")
    return {
        **picture,
        "summary": cells.text(", ".join(size)),
        "connected": not found,
        "balanced": is_balanced(digraph),
        "weighted": any(edge.weight != 1 for edge in digraph.edges),
        "cut": cells.text(f"Not strongly connected: {found[0]}.") if found else None,
    }


def _counted(count: int, name: str) -> str:
    return f"{count} {name}" if count == 1 else f"{count} {name}s"


def plant_section(plant: Plant) -> dict[str, Any]:
    """Exosystem, agents, initial sets, digest."""
    return {
        "sha256": plant.sha256,
        "S": cells.math(
            matrix([[typst(entry) for entry in plant.exosystem.S.row(k)] for k in range(plant.exosystem.S.rows)])
        )
        if plant.exosystem.states
        else None,
        "initial": _exosystem_start(plant.exosystem),
        "rows": tables.plant_rows(plant),
        "boxes": [
            [cells.text(cells.agents(agent.id for agent in group)), *_boxes(group[0])]
            for group in tables.grouped(plant.agents, lambda agent: agent.initial)
        ],
    }


def _exosystem_start(exosystem: Exosystem) -> str:
    parts = [
        f"{typst(name)} (0) {_relation(side)}" for name, side in zip(exosystem.states, exosystem.initial, strict=True)
    ]
    return ", quad ".join(parts)


def _relation(side: Interval) -> str:
    return f"{'=' if side.is_point else 'in'} {cells.interval(side)}"


def _boxes(agent: Agent) -> list[cells.Cell]:
    initial = agent.initial
    observer = cells.text("measured") if initial.observer is None else _product(initial.observer)
    if agent.order == 1:
        observer = cells.text("–")
    return [
        _product(initial.z),
        _product(initial.x),
        observer,
        cells.math(cells.interval(initial.eta)),
        cells.math(cells.interval(initial.reference)),
    ]


def _product(box: Sequence[Interval]) -> cells.Cell:
    """The box as a power of an interval where all sides agree."""
    if not box:
        return cells.text("–")
    if len(set(box)) > 1:
        return cells.math(" times ".join(map(cells.interval, box)))
    power = f"^({len(box)})" if len(box) > 1 and not box[0].is_point else ""
    return cells.math(cells.interval(box[0]) + power)
