"""The witnesses of one agent's recipe (docs/certificate.md)."""

from __future__ import annotations

from certify.agent_model import AgentModel
from certify.certificate import Json, number, numbers, rows, steady_state
from certify.recipe.design import AgentRecipe


def recipe_witness(model: AgentModel, recipe: AgentRecipe) -> Json:
    matrices, level = recipe.matrices, recipe.level
    return {
        "id": number(model.agent.id),
        "steady_state": steady_state(model.steady_state, model.roots),
        "ell": numbers(model.internal_model.ell),
        "V0": rows(matrices.V0),
        "P1": rows(matrices.P1),
        "P2": rows(matrices.P2),
        "P3": rows(matrices.P3),
        "a0": number(matrices.a0),
        "level": number(level.level),
        "slack": number(level.slack),
        "weight_eta": number(level.found.weight_eta),
        "weight_theta": number(level.found.weight_vartheta),
    }
