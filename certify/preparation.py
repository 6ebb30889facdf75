"""What every route starts from: optimum, derivation, exosystem, necessary conditions, coordinator, agents."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import sympy

from certify.agent_model import AgentModel, References
from certify.assumptions.findings import CheckReport
from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds
from certify.bounds.roots import root_brackets, with_roots
from certify.coordinator.design import CoordinatorDesign, design_coordinator, gradients_at
from certify.coordinator.nominal import cost_gradient
from certify.coordinator.resolution import FINE, Resolution
from certify.coordinator.stability import Unstable
from certify.curvature import Curvature, cost_curvature
from certify.float_range import BeyondFloatsError, float_range
from certify.foreseen import foreseen_refusal, seen_optimum
from certify.gains.linear_stability import LinearVerdict, necessary_condition
from certify.gains.requested import left_open, requested_controller
from certify.internal_trajectory import internal_model_data
from certify.optimum import NoOptimumError, Optimum, optimum
from certify.results import AgentResult, Status
from certify.unproved import unproved_feature
from symbolic.derivation import AgentDerivation, Derivation, derive, derive_agent
from symbolic.internal_model import InternalModel
from symbolic.plant import COST_VARIABLE, Agent, Interval, Plant
from symbolic.steady_state import SteadyState

Report = Callable[[str], None]


@dataclass(frozen=True)
class Prepared:
    """The network ready for a route; ``models[i]`` is a reason where agent ``i`` cannot be treated exactly."""

    plant: Plant
    optimum: Optimum
    derivation: Derivation
    disturbance: ExosystemBounds
    coordinator: CoordinatorDesign
    models: tuple[AgentModel | str, ...]
    linear: dict[int, LinearVerdict]

    def redesigned(self, index: int, agent: Agent) -> AgentModel | str:
        """The model of agent ``index`` with the design (observer, ``γ``, ``M``, ``N``) that ``agent`` fixes."""
        derived = derive_agent(agent, self.plant, self.derivation.s_star)
        return _agent_model(self.plant, index, derived, self.optimum, self.disturbance, self.coordinator)


@dataclass(frozen=True)
class Stopped:
    """No route can start, or the requested gains are refuted."""

    status: Status
    reason: str
    agents: tuple[AgentResult, ...] = ()


def prepare(
    plant: Plant,
    check: CheckReport,
    report: Report,
    optional: frozenset[str] = frozenset(),
    resolution: Resolution = FINE,
    proved: frozenset[str] = frozenset(),
) -> Prepared | Stopped:
    """Everything up to the choice of gains; the exact linear condition on requested gains comes first.

    An assumption in ``optional`` may be ``unknown`` (its proof is part of the route), but must not fail. ``proved`` are
    the tables of the plant file that the route proves beside the plant itself.
    """
    blocking = _blocking(check, optional)
    if blocking is not None:
        return blocking
    try:
        found = optimum(plant)
    except NoOptimumError as error:
        return Stopped("inconclusive", str(error))
    refusal = unproved_feature(plant, proved) or foreseen_refusal(plant)
    if refusal:
        return Stopped("inconclusive", refusal)
    found = seen_optimum(plant, found)
    s_star = COST_VARIABLE if found.exact is None else sympy.Rational(found.exact.numerator, found.exact.denominator)
    derivation = derive(plant, s_star)
    disturbance = exosystem_bounds(plant.exosystem)
    if not isinstance(disturbance, ExosystemBounds):
        return Stopped("inconclusive", f"exosystem: {disturbance.reason}")
    if disturbance.Q is None:
        return Stopped("inconclusive", "exosystem: S keeps no quadratic form with rational entries")

    linear = _necessary(plant, derivation, found, disturbance)
    refuted = [result for result in linear if result.status == "refuted"]
    if refuted:
        return Stopped("refuted", refuted[0].reason, linear)

    curvatures = [_curvature(agent.cost) for agent in plant.agents]
    gradients = gradients_at([cost_gradient(agent.cost) for agent in plant.agents], found.enclosure)
    if any(curvature.lo < curvature.hi for curvature in curvatures):
        resolution = FINE  # on long steps c'' is enclosed too widely
    try:
        with float_range():
            coordinator = design_coordinator(plant, found.enclosure, gradients, curvatures, report, resolution)
    except BeyondFloatsError as obstacle:
        return Stopped("inconclusive", f"coordinator: {obstacle}", linear)
    if isinstance(coordinator, Unstable):
        return Stopped("inconclusive", f"coordinator: {coordinator.reason}", linear)
    models = tuple(
        _agent_model(plant, index, derived, found, disturbance, coordinator)
        for index, derived in enumerate(derivation.agents)
    )
    verdicts = {result.id: result.linear for result in linear if result.linear is not None}
    return Prepared(plant, found, derivation, disturbance, coordinator, models, verdicts)


def _agent_model(
    plant: Plant,
    index: int,
    derived: AgentDerivation,
    found: Optimum,
    disturbance: ExosystemBounds,
    coordinator: CoordinatorDesign,
) -> AgentModel | str:
    references, steady, model = coordinator.envelope.agents[index], derived.steady_state, derived.internal_model
    if not isinstance(steady, SteadyState) or not isinstance(model, InternalModel):
        return "there is no steady state or internal model"
    data = internal_model_data(model, steady.u_star, plant.exosystem)
    if data is None:
        return "the internal model has irrational entries, and the exact steps of this route need rational ones"
    roots = root_brackets(derived.agent, steady, found.enclosure)
    if isinstance(roots, str):
        return roots
    return AgentModel(
        agent=with_roots(derived.agent, roots),
        exosystem=plant.exosystem,
        steady_state=steady.z_star,
        internal_model=data,
        gamma=derived.design.gamma,
        observer=derived.design.observer,
        optimum=found.enclosure,
        disturbance=disturbance.box,
        extent=disturbance.extent,
        references=References(references.peak, references.energy, references.rate_energy),
        roots=tuple(map(roots.get, derived.agent.zero_states)),
    )


def _curvature(cost: sympy.Expr) -> Interval:
    curvature = cost_curvature(cost)
    assert isinstance(curvature, Curvature)  # A1 holds, or the preparation has stopped before
    return Interval(curvature.lower, curvature.upper)


def _necessary(
    plant: Plant, derivation: Derivation, found: Optimum, disturbance: ExosystemBounds
) -> tuple[AgentResult, ...]:
    """The exact linear condition on requested gains, agent by agent; none for an agent whose gains are not all fixed.

    Where the file leaves a design open, the condition is that of the default and refutes nothing.
    """
    results = []
    for derived in derivation.agents:
        controller = requested_controller(derived, plant.gains_of(derived.id))
        if controller is None:
            continue
        assert isinstance(derived.steady_state, SteadyState)
        if derived.steady_state.roots:  # a point of the box around z* is no steady state, and refutes nothing
            continue
        verdict = necessary_condition(
            derived.agent, controller, derived.steady_state, found, disturbance.sharp, plant.exosystem.states
        )
        choices = left_open(derived)
        if verdict.status == "refuted" and choices:
            words = f"with the default of {' and '.join(choices)}, which the file leaves open, {verdict.reason}"
            verdict = replace(verdict, status="inconclusive", reason=words)
        status: Status = "refuted" if verdict.status == "refuted" else "inconclusive"
        results.append(AgentResult(derived.id, status, f"agent {derived.id}: {verdict.reason}", linear=verdict))
    return tuple(results)


def _blocking(check: CheckReport, optional: frozenset[str]) -> Stopped | None:
    """The first assumption that fails, else the first that is needed and unknown."""
    failed = [finding for finding in check.findings if finding.verdict == "fails"]
    unknown = [finding for finding in check.findings if finding.verdict == "unknown" and finding.id not in optional]
    if not failed and not unknown:
        return None
    wrong = (failed or unknown)[0]
    where = "" if wrong.agent is None else f", agent {wrong.agent}"
    return Stopped("refuted" if failed else "inconclusive", f"{wrong.id}{where}: {wrong.reason}")
