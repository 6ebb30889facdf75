"""The controllers that are simulated: that of a certificate, or one of moderate gains that certifies nothing."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from certify.gains.requested import requested_controller
from symbolic.controller import AgentController, Controller
from symbolic.derivation import Derivation
from symbolic.errors import InputError
from symbolic.plant import Plant, RequestedGains

# moderate gains that settle the example (theory.md section 7, scale of the recipe), where the plant file fixes none
ALPHA = Fraction(5)
MODERATE = RequestedGains(g=Fraction(5), K=Fraction(100), delta=Fraction(1000), h=Fraction(500))
_EXACT = re.compile(r"-?[0-9]{1,4000}(/[0-9]{1,4000})?")


def demonstration_controller(plant: Plant, derivation: Derivation) -> Controller:
    """The plant file's gains, and moderate ones where it fixes none. Nothing is proved about them."""
    laws = []
    for derived in derivation.agents:
        given = plant.gains_of(derived.id)
        gains = RequestedGains(
            given.g or MODERATE.g, given.K or MODERATE.K, given.delta or MODERATE.delta, given.h or MODERATE.h
        )
        law = requested_controller(derived, gains)
        if law is None:
            raise InputError(f"agent {derived.agent.id}: its internal model is not rational, so it cannot be simulated")
        laws.append(law)
    return Controller(plant.coordinator.alpha1 or ALPHA, plant.coordinator.alpha2 or ALPHA, tuple(laws))


def certified_controller(certificate: Mapping[str, Any], plant: Plant, source: str) -> Controller:
    """The controller of a certificate's claim. Raises ``InputError`` when the claim does not fit the plant file."""
    try:
        claim = certificate["claim"]
        if claim["plant_sha256"] != plant.sha256:
            raise InputError(f"{source}: claim.plant_sha256: the certificate is about another plant file")
        laws = tuple(_law(entry) for entry in claim["agents"])
        controller = Controller(_number(claim["alpha1"]), _number(claim["alpha2"]), laws)
    except (ArithmeticError, KeyError, TypeError) as error:
        reason = f"is not of the documented shape ({type(error).__name__}: {error})"
        raise InputError(f"{source}: claim: {reason}") from error
    if not _fits(controller, plant):
        raise InputError(f"{source}: claim.agents: the sizes are not those of the plant's agents")
    return controller


def _law(entry: Mapping[str, Any]) -> AgentController:
    return AgentController(
        id=int(_number(entry["id"])),
        gamma=_row(entry["gamma"]),
        observer=_row(entry["observer"]),
        M=tuple(_row(row) for row in entry["M"]),
        N=_row(entry["N"]),
        psi=_row(entry["psi"]),
        g=_number(entry["g"]),
        K=_number(entry["K"]),
        delta=_number(entry["delta"]),
        h=None if entry["h"] is None else _number(entry["h"]),
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


def _row(entries: list[str]) -> tuple[Fraction, ...]:
    return tuple(_number(entry) for entry in entries)


def _number(text: str) -> Fraction:
    """Only the documented notation: ``Fraction`` itself would also take ``1e999999999``."""
    if not _EXACT.fullmatch(text):
        raise TypeError("a number is a string p or p/q")
    return Fraction(text)
