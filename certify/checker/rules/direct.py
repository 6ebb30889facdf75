"""The order of the obligations of the theorem direct/3 (docs/certificate-direct.md)."""

from __future__ import annotations

from functools import cache
from typing import cast

from certify.checker.certificate import Certificate, DirectClaim
from certify.checker.plant import Plant
from certify.checker.rules import agent_direct, assumptions, coordinator, observer


def prove(plant: Plant, certificate: Certificate) -> None:
    """Raises ``Rejected`` naming the first obligation that fails."""
    claim, witness = cast(DirectClaim, certificate.claim), certificate.witness  # the reader's kind for this theorem
    designs = list(zip(plant.agents, claim.agents, witness.agents, strict=True))
    for design in designs:
        agent_direct.prove_design(*design)
    facts = assumptions.prove(plant, certificate)
    Q = witness.exosystem.Q if witness.exosystem else []
    exosystem = agent_direct.Exosystem(plant.S or [], Q, facts.v_at_start, facts.v)
    envelopes, tabulate = coordinator.prove(plant, certificate, facts), cache(observer.tabulate)
    for design, envelope, known in zip(designs, envelopes, facts.agents, strict=True):
        agent_direct.prove_tube(*design, envelope.reference, exosystem, known, tabulate)
