"""A proved network written down as claim and witnesses (docs/certificate.md): what is common to all routes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from certify.agent_model import Matrix
from certify.certificate import SCHEMA, Json, number, numbers, rows
from certify.coordinator.design import CoordinatorDesign
from symbolic.controller import COORDINATOR_KEYS, AgentController
from symbolic.plant import Interval, Plant, Requirements


def network_certificate(
    theorem: str,
    plant: Plant,
    optimum: Interval,
    invariant: Matrix,
    coordinator: CoordinatorDesign,
    agents: Sequence[tuple[AgentController, Json]],
    versions: Mapping[str, str],
    requirements: bool = False,
) -> Json:
    """The certificate of a network all of whose agents passed, each with its controller and witness; ``invariant`` is
    ``Q``. With ``requirements`` the claim repeats those of the plant."""
    gains = coordinator.gains
    return {
        "schema": SCHEMA,
        "theorem": theorem,
        "producer": dict(versions),
        "claim": {
            "plant_sha256": plant.sha256,
            **{key: number(getattr(gains, key)) for key in COORDINATOR_KEYS},
            "agents": [
                _controller(controller) | (_requirements(plant.requirements_of(controller.id)) if requirements else {})
                for controller, _ in agents
            ],
        },
        "witness": {
            "optimum": [number(optimum.lo), number(optimum.hi)],
            "left_null_vector": numbers(coordinator.r),
            "exosystem": {"Q": rows(invariant)} if invariant else None,
            "coordinator": coordinator.witness,
            "agents": [witness for _, witness in agents],
        },
    }


def _controller(controller: AgentController) -> dict[str, Any]:
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


def _requirements(asked: Requirements) -> Json:
    settling = asked.settling
    return {
        "requirements": {
            "settling": None if settling is None else {"time": number(settling.time), "band": number(settling.band)},
            "input": None if asked.input is None else number(asked.input),
            "bandwidth": None if asked.bandwidth is None else number(asked.bandwidth),
        }
    }
