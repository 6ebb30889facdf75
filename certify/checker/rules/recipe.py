"""The order of the obligations of the theorem recipe/2 (docs/certificate.md)."""

from __future__ import annotations

from certify.checker.certificate import Certificate
from certify.checker.plant import Plant
from certify.checker.rules import agent_recipe, assumptions, coordinator


def prove(plant: Plant, certificate: Certificate) -> None:
    """Raises ``Rejected`` naming the first obligation that fails."""
    designs = list(zip(plant.agents, certificate.claim.agents, certificate.witness.agents, strict=True))
    for design in designs:
        agent_recipe.prove_design(*design)
    facts = assumptions.prove(plant, certificate)
    envelopes = coordinator.prove(plant, certificate, facts)
    for design, envelope, known in zip(designs, envelopes, facts.agents, strict=True):
        agent_recipe.prove_levels(*design, envelope, known, facts)
