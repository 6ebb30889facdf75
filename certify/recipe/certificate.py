"""A proved recipe written down as claim and witnesses (docs/certificate.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from certify.certificate import RECIPE, SCHEMA, Json, expression, number, numbers, rows
from certify.coordinator.design import CoordinatorDesign
from certify.agent_model import AgentModel, Matrix
from certify.recipe.design import AgentRecipe
from symbolic.controller import AgentController
from symbolic.plant import Interval, Plant


def recipe_certificate(
    plant: Plant,
    optimum: Interval,
    invariant: Matrix,
    coordinator: CoordinatorDesign,
    agents: Sequence[tuple[AgentModel, AgentRecipe]],
    versions: Mapping[str, str],
) -> Json:
    """The certificate of a network all of whose agents passed; ``invariant`` is ``Q`` (empty without exosystem)."""
    model = coordinator.model
    return {
        "schema": SCHEMA,
        "theorem": RECIPE,
        "producer": dict(versions),
        "claim": {
            "plant_sha256": plant.sha256,
            "alpha1": number(model.alpha1),
            "alpha2": number(model.alpha2),
            "agents": [controller_json(recipe.controller) for _, recipe in agents],
        },
        "witness": {
            "optimum": [number(optimum.lo), number(optimum.hi)],
            "exosystem": {"Q": rows(invariant)} if invariant else None,
            "coordinator": {
                "P": rows(coordinator.comparison.P),
                "multiplier": numbers(coordinator.comparison.multiplier),
                "rate": number(coordinator.comparison.rate),
                "mixing_rate": number(coordinator.comparison.mixing_rate),
                "step": number(coordinator.mixing.step),
                "steps": number(coordinator.mixing.steps),
            },
            "agents": [_witness(agent, recipe) for agent, recipe in agents],
        },
    }


def controller_json(controller: AgentController) -> dict[str, Any]:
    return {
        "id": number(controller.id),
        "g": number(controller.g),
        "K": number(controller.K),
        "delta": number(controller.delta),
        "h": None if controller.h is None else number(controller.h),
        "gamma": numbers(controller.gamma),
        "observer": numbers(controller.observer),
        "M": rows(controller.M),
        "N": numbers(controller.N),
        "psi": numbers(controller.psi),
    }


def _witness(model: AgentModel, recipe: AgentRecipe) -> dict[str, Any]:
    matrices, level = recipe.matrices, recipe.level
    return {
        "id": number(model.agent.id),
        "steady_state": [expression(component) for component in model.steady_state],
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
