"""From a plant to a certificate: assumptions → coordinates → matrix inequalities → levels → thresholds →
certificate."""

from __future__ import annotations

import platform
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

from certify.assumptions.check import check_assumptions
from certify.assumptions.findings import CheckReport
from certify.certificate import Json, certificate_bytes, claim_digest, number
from certify.checker import check as independent_check
from certify.float_range import BeyondFloatsError, float_range
from certify.network_certificate import COORDINATOR_KEYS, network_certificate
from certify.preparation import Prepared, Report, Stopped, prepare
from certify.results import AgentResult, GainsResult, Status
from certify.routes import ROUTES, Route
from certify.workers import in_processes, processors
from symbolic.controller import AgentController
from symbolic.plant import Plant

__all__ = ["AgentResult", "GainsResult", "design_gains", "tool_versions"]

Outcome = tuple[AgentResult, AgentController | None, Json | None]


def design_gains(
    plant: Plant,
    route: str = "recipe",
    progress: Report = lambda message: None,
    check: CheckReport | None = None,
    share: Callable[[float], None] = lambda done: None,
) -> GainsResult:
    """Gains with a certificate, or what stands in the way. Gains fixed in the plant file are kept and decided as they
    are. ``progress`` is told what the search is at, ``share`` what part of the agents is done."""
    check = check if check is not None else check_assumptions(plant)
    way = ROUTES[route]
    prepared = prepare(plant, check, progress, way.proved_on_the_way, way.resolution, way.proves)
    if isinstance(prepared, Stopped):
        return _without_certificate(prepared.status, prepared.reason, route, prepared.agents)
    outcomes = _searched(way, prepared, progress, share)
    results = tuple(result for result, _, _ in outcomes)
    open_agents = [result for result in results if result.status != "certified"]
    if open_agents:
        reason = "; ".join(f"agent {result.id}: {result.reason}" for result in open_agents)
        return _without_certificate("inconclusive", reason, route, results, prepared)
    found, disturbance, coordinator = prepared.optimum, prepared.disturbance, prepared.coordinator
    parts = [
        (controller, witness) for _, controller, witness in outcomes if controller is not None and witness is not None
    ]
    certificate = network_certificate(
        way.theorem,
        plant,
        found.enclosure,
        disturbance.Q or (),
        coordinator,
        parts,
        tool_versions(),
        requirements="requirements" in way.proves,
    )
    progress("checking the certificate")
    verdict = independent_check(plant.source, certificate_bytes(certificate))
    if verdict.status != "verified":
        complaint = f"the checker does not accept the certificate: {verdict.obligation}: {verdict.detail}"
        return _without_certificate("inconclusive", complaint, route, results, prepared)
    return GainsResult(
        "certified",
        "every obligation was proved by the independent checker",
        route,
        certificate,
        _summary("certified", route, certificate, results),
        results,
        coordinator.envelope,
        coordinator,
    )


def tool_versions() -> dict[str, str]:
    names = ("consensus-certify", "sympy", "cvxpy", "clarabel", "python-flint", "numpy")
    return {"python": platform.python_version(), **{name: version(name) for name in names}}


def _searched(route: Route, prepared: Prepared, progress: Report, share: Callable[[float], None]) -> list[Outcome]:
    """The agents do not see each other, so long searches run in parallel."""

    def search(index: int, say: Report) -> Outcome:
        try:
            with float_range():
                return route.search(prepared, index, say)
        except BeyondFloatsError as obstacle:
            return AgentResult(prepared.derivation.agents[index].id, "inconclusive", str(obstacle)), None, None

    workers = processors() if route.long else 1
    outcomes: list[Outcome] = []
    for outcome in in_processes(search, range(len(prepared.models)), workers, progress):
        outcomes.append(outcome)
        share(len(outcomes) / len(prepared.models))
    return outcomes


def _summary(status: Status, route: str, certificate: Json, results: tuple[AgentResult, ...]) -> dict[str, Any]:
    claim = certificate["claim"]
    agents = [
        {
            "id": result.id,
            **{key: entry[key] for key in ("g", "K", "delta", "h")},
            "level": number(result.thresholds["level"]),
            "rate": number(result.thresholds["rate"]),
        }
        for entry, result in zip(claim["agents"], results, strict=True)
    ]
    gains = {**{key: claim[key] for key in COORDINATOR_KEYS}, "agents": agents}
    return {"status": status, "route": route, "gains": gains, "claim": {**claim, "sha256": claim_digest(certificate)}}


def _without_certificate(
    status: Status, reason: str, route: str, agents: tuple[AgentResult, ...] = (), prepared: Prepared | None = None
) -> GainsResult:
    summary = {"status": status, "route": route, "gains": None, "claim": None}
    coordinator = None if prepared is None else prepared.coordinator
    envelope = None if coordinator is None else coordinator.envelope
    return GainsResult(status, reason, route, None, summary, agents, envelope, coordinator)
