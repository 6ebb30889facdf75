"""The controller that a certificate is about."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from certify.statement.exact_numbers import exact, exact_matrix, exact_row
from symbolic.controller import COORDINATOR_KEYS, AgentController, Controller, CoordinatorGains
from symbolic.errors import InputError
from symbolic.plant import Plant


def certified_controller(certificate: Mapping[str, Any], plant: Plant, source: str) -> Controller:
    """The controller of a certificate's claim. Raises ``InputError`` when the claim does not fit the plant file."""
    try:
        claim = certificate["claim"]
        if claim["plant_sha256"] != plant.sha256:
            raise InputError(f"{source}: claim.plant_sha256: the certificate is about another plant file")
        laws = tuple(_law(entry) for entry in claim["agents"])
        constants = CoordinatorGains(**{key: exact(claim[key]) for key in COORDINATOR_KEYS})
        controller = Controller(constants, laws)
    except InputError:
        raise
    except (ArithmeticError, KeyError, TypeError, ValueError) as error:
        reason = f"is not of the documented shape ({type(error).__name__}: {error})"
        raise InputError(f"{source}: claim: {reason}") from error
    if not _fits(controller, plant):
        raise InputError(f"{source}: claim.agents: the sizes are not those of the plant's agents")
    return controller


def _law(entry: Mapping[str, Any]) -> AgentController:
    return AgentController(
        id=int(exact(entry["id"])),
        gamma=exact_row(entry["gamma"]),
        observer=exact_row(entry["observer"]),
        M=exact_matrix(entry["M"]),
        N=exact_row(entry["N"]),
        psi=exact_row(entry["psi"]),
        g=exact(entry["g"]),
        K=exact(entry["K"]),
        delta=exact(entry["delta"]),
        h=None if entry["h"] is None else exact(entry["h"]),
    )


def _fits(controller: Controller, plant: Plant) -> bool:
    if [law.id for law in controller.agents] != [agent.id for agent in plant.agents]:
        return False
    for law, agent in zip(controller.agents, plant.agents, strict=True):
        observed = agent.order > 1
        size = len(law.N)
        chain = (len(law.gamma), len(law.observer), law.h is not None)
        if chain != (agent.order - 1, agent.order if observed else 0, observed):
            return False
        if [len(row) for row in law.M] != [size] * size or len(law.psi) != size:
            return False
    return True
