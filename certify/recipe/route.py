"""Route "recipe", agent by agent (theory.md section 5)."""

from __future__ import annotations

from certify.agent_model import AgentModel
from certify.certificate import Json
from certify.preparation import Prepared
from certify.recipe.certificate import recipe_witness
from certify.recipe.design import AgentInconclusive, AgentRecipe, design_agent
from certify.recipe.matrices import MatricesInconclusive, lyapunov_matrices
from certify.results import AgentResult
from symbolic.controller import AgentController
from symbolic.steady_state import SteadyState


def recipe_agent(prepared: Prepared, index: int) -> tuple[AgentResult, AgentController | None, Json | None]:
    """The result, controller and witness of one agent; the latter two are ``None`` without a certificate."""
    derived, model = prepared.derivation.agents[index], prepared.models[index]
    linear = prepared.linear.get(derived.id)
    if isinstance(model, str):
        return AgentResult(derived.id, "inconclusive", model, linear=linear), None, None
    assert isinstance(derived.steady_state, SteadyState)
    recipe = _design(model, derived.steady_state, prepared)
    if isinstance(recipe, AgentInconclusive):
        return AgentResult(derived.id, "inconclusive", recipe.reason, linear=linear), None, None
    return _result(recipe, prepared, index), recipe.controller, recipe_witness(model, recipe)


def _design(model: AgentModel, steady: SteadyState, prepared: Prepared) -> AgentRecipe | AgentInconclusive:
    matrices = lyapunov_matrices(model, steady)
    if isinstance(matrices, MatricesInconclusive):
        return AgentInconclusive(model.agent.id, matrices.reason)
    return design_agent(model, matrices, prepared.plant.gains_of(model.agent.id))


def _result(recipe: AgentRecipe, prepared: Prepared, index: int) -> AgentResult:
    output, coordinator = recipe.output, prepared.coordinator
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
        prepared.linear.get(recipe.controller.id),
    )
