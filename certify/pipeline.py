"""From a plant to a certificate: assumptions → coordinates → matrix inequalities → levels → thresholds → certificate."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from importlib.metadata import version
from typing import Any, Literal

import sympy

from certify.assumptions.check import check_assumptions
from certify.assumptions.findings import CheckReport
from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds
from certify.certificate import Json, claim_digest, number
from certify.coordinator.design import CoordinatorDesign, design_coordinator, gradients_at
from certify.coordinator.envelope import Envelope
from certify.coordinator.nominal import cost_gradient
from certify.coordinator.stability import Unstable
from certify.curvature import Curvature, cost_curvature
from certify.gains.linear_stability import LinearVerdict, necessary_condition
from certify.gains.requested import requested_controller
from certify.optimum import NoOptimumError, Optimum, optimum
from certify.agent_model import AgentModel, References
from certify.recipe.certificate import recipe_certificate
from certify.recipe.design import AgentInconclusive, AgentRecipe, design_agent
from certify.internal_trajectory import internal_model_data
from certify.recipe.matrices import MatricesInconclusive, lyapunov_matrices
from symbolic.derivation import AgentDerivation, Derivation, derive
from symbolic.internal_model import InternalModel
from symbolic.plant import COST_VARIABLE, Interval, Plant
from symbolic.steady_state import SteadyState

Status = Literal["certified", "refuted", "inconclusive"]
Report = Callable[[str], None]


@dataclass(frozen=True)
class AgentResult:
    """What was found for one agent; the dictionaries are empty when it has no certificate.

    ``constants`` ``ς1 … ς11`` and the Jacobian bounds, ``thresholds`` ``g, K, mu, a, delta, T, h1, h2, h3, h``,
    ``matrices`` ``V0, P1, P2, P3``; ``linear`` is the verdict of the necessary condition on requested gains.
    """

    id: int
    status: Status
    reason: str
    constants: dict[str, Fraction] = field(default_factory=dict)
    thresholds: dict[str, Fraction] = field(default_factory=dict)
    matrices: dict[str, tuple[tuple[Fraction, ...], ...]] = field(default_factory=dict)
    linear: LinearVerdict | None = None


@dataclass(frozen=True)
class GainsResult:
    """The outcome of a route: ``certificate`` is there iff ``status == "certified"``; ``summary`` has the JSON shape of spec.md."""

    status: Status
    reason: str
    route: str
    certificate: Json | None
    summary: dict[str, Any]
    agents: tuple[AgentResult, ...] = ()
    envelope: Envelope | None = None
    coordinator: CoordinatorDesign | None = None


def design_gains(
    plant: Plant, route: str = "recipe", progress: Report = lambda message: None, check: CheckReport | None = None
) -> GainsResult:
    """Gains with a certificate, or what stands in the way. Gains fixed in the plant file are kept and decided as they are."""
    check = check if check is not None else check_assumptions(plant)
    if check.status != "holds":
        return _blocked(check, route)
    try:
        found = optimum(plant)
    except NoOptimumError as error:
        return _without_certificate("inconclusive", str(error), route)
    s_star = COST_VARIABLE if found.exact is None else sympy.Rational(found.exact.numerator, found.exact.denominator)
    derivation = derive(plant, s_star)
    disturbance = exosystem_bounds(plant.exosystem)
    if not isinstance(disturbance, ExosystemBounds):
        return _without_certificate("inconclusive", f"exosystem: {disturbance.reason}", route)
    if disturbance.Q is None:
        return _without_certificate("inconclusive", "exosystem: S keeps no quadratic form with rational entries", route)

    linear = _necessary(plant, derivation, found, disturbance)
    refuted = [result for result in linear if result.status == "refuted"]
    if refuted:
        return _without_certificate("refuted", refuted[0].reason, route, linear)

    curvatures = [_curvature(agent.cost) for agent in plant.agents]
    gradients = gradients_at([cost_gradient(agent.cost) for agent in plant.agents], found.enclosure)
    coordinator = design_coordinator(plant, found.enclosure, gradients, curvatures, progress)
    if isinstance(coordinator, Unstable):
        return _without_certificate("inconclusive", f"coordinator: {coordinator.reason}", route, linear)

    verdicts = {result.id: result.linear for result in linear}
    passed: list[tuple[AgentModel, AgentRecipe]] = []
    results: list[AgentResult] = []
    for index, derived in enumerate(derivation.agents):
        progress(f"agent {derived.id}: levels and thresholds")
        model = _agent_model(plant, index, derived, found, disturbance, coordinator.envelope)
        recipe = AgentInconclusive(derived.id, model) if isinstance(model, str) else _recipe(model, derived, plant)
        results.append(_result(recipe, coordinator, index, verdicts.get(derived.id)))
        if isinstance(recipe, AgentRecipe):
            passed.append((model, recipe))
    open_agents = [result for result in results if result.status != "certified"]
    if open_agents:
        reason = "; ".join(f"agent {result.id}: {result.reason}" for result in open_agents)
        return _without_certificate("inconclusive", reason, route, tuple(results), coordinator)
    certificate = recipe_certificate(plant, found.enclosure, disturbance.Q, coordinator, passed, tool_versions())
    return GainsResult(
        "certified",
        "every obligation was proved with directed rounding",
        route,
        certificate,
        _summary("certified", route, certificate, results),
        tuple(results),
        coordinator.envelope,
        coordinator,
    )


def tool_versions() -> dict[str, str]:
    names = ("consensus-certify", "sympy", "cvxpy", "clarabel", "python-flint", "numpy")
    return {"python": platform.python_version(), **{name: version(name) for name in names}}


def _agent_model(
    plant: Plant, index: int, derived: AgentDerivation, found: Optimum, disturbance: ExosystemBounds, envelope: Envelope
) -> AgentModel | str:
    """The agent as the recipe sees it, or why it cannot."""
    references, steady, model = envelope.agents[index], derived.steady_state, derived.internal_model
    if not isinstance(steady, SteadyState) or not isinstance(model, InternalModel):
        return "there is no steady state or internal model"
    data = internal_model_data(model, steady.u_star, plant.exosystem)
    if data is None:
        return "the internal model has irrational entries, and the exact steps of this route need rational ones"
    return AgentModel(
        agent=plant.agents[index],
        exosystem=plant.exosystem,
        steady_state=steady.z_star,
        internal_model=data,
        gamma=derived.design.gamma,
        observer=derived.design.observer,
        optimum=found.enclosure,
        disturbance=disturbance.box,
        references=References(references.peak, references.energy, references.rate_energy),
    )


def _recipe(model: AgentModel, derived: AgentDerivation, plant: Plant) -> AgentRecipe | AgentInconclusive:
    assert isinstance(derived.steady_state, SteadyState)
    matrices = lyapunov_matrices(model, derived.steady_state)
    if isinstance(matrices, MatricesInconclusive):
        return AgentInconclusive(derived.id, matrices.reason)
    return design_agent(model, matrices, plant.gains)


def _curvature(cost: sympy.Expr) -> Interval:
    curvature = cost_curvature(cost)
    assert isinstance(curvature, Curvature)  # A1 holds, or the route has stopped before
    return Interval(curvature.lower, curvature.upper)


def _necessary(
    plant: Plant, derivation: Derivation, found: Optimum, disturbance: ExosystemBounds
) -> tuple[AgentResult, ...]:
    """The exact linear condition on requested gains, agent by agent; empty when neither ``K`` nor ``h`` is fixed."""
    if plant.gains.K is None and plant.gains.h is None:
        return ()
    results = []
    for derived in derivation.agents:
        controller = requested_controller(derived, plant.gains)
        if controller is None:
            continue
        assert isinstance(derived.steady_state, SteadyState)
        verdict = necessary_condition(
            derived.agent, controller, derived.steady_state, found, disturbance.sharp, plant.exosystem.states
        )
        status: Status = "refuted" if verdict.status == "refuted" else "inconclusive"
        results.append(AgentResult(derived.id, status, f"agent {derived.id}: {verdict.reason}", linear=verdict))
    return tuple(results)


def _result(
    recipe: AgentRecipe | AgentInconclusive, coordinator: CoordinatorDesign, index: int, linear: LinearVerdict | None
) -> AgentResult:
    if isinstance(recipe, AgentInconclusive):
        return AgentResult(recipe.id, "inconclusive", recipe.reason, linear=linear)
    output = recipe.output
    thresholds = {
        "g": recipe.controller.g,
        "K": recipe.controller.K,
        "mu": coordinator.weight(index, recipe.level.found.varsigma[10], recipe.level.found.varsigma[11]),
        "a": recipe.feedback.smallest,
        "delta": output.delta,
        "T": output.T,
        "h1": output.h1,
        "h2": output.h2,
        "h3": output.h3,
        "h": output.h,
        "level": recipe.level.level,
        "rate": min(output.rate, coordinator.envelope.tail_decay),
    }
    matrices = {name: getattr(recipe.matrices, name) for name in ("V0", "P1", "P2", "P3")}
    return AgentResult(
        recipe.controller.id,
        "certified",
        "",
        recipe.constants,
        {name: value for name, value in thresholds.items() if value is not None},
        {name: matrix for name, matrix in matrices.items() if matrix},
        linear,
    )


def _summary(status: Status, route: str, certificate: Json, results: list[AgentResult]) -> dict[str, Any]:
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
    gains = {"alpha1": claim["alpha1"], "alpha2": claim["alpha2"], "agents": agents}
    return {"status": status, "route": route, "gains": gains, "claim": {**claim, "sha256": claim_digest(certificate)}}


def _blocked(check: CheckReport, route: str) -> GainsResult:
    wrong = next(finding for finding in check.findings if finding.verdict == ("fails" if check.status == "fails" else "unknown"))
    where = "" if wrong.agent is None else f", agent {wrong.agent}"
    status: Status = "refuted" if check.status == "fails" else "inconclusive"
    return _without_certificate(status, f"{wrong.id}{where}: {wrong.reason}", route)


def _without_certificate(
    status: Status,
    reason: str,
    route: str,
    agents: tuple[AgentResult, ...] = (),
    coordinator: CoordinatorDesign | None = None,
) -> GainsResult:
    summary = {"status": status, "route": route, "gains": None, "claim": None}
    envelope = None if coordinator is None else coordinator.envelope
    return GainsResult(status, reason, route, None, summary, agents, envelope, coordinator)
