"""What a plant file may ask for and no theorem of this checker speaks about: never ignored, always a rejection."""

from __future__ import annotations

from collections.abc import Set
from fractions import Fraction

from certify.checker.plant import Plant
from certify.checker.requested import Requirements

PAPERS_COORDINATOR = {"gradient_gain": Fraction(1), "mixing_gain": Fraction(1), "mixing_time": Fraction(0)}
PAPERS_COORDINATOR["softening"] = Fraction(0)


def unproved_feature(plant: Plant, spoken_of: Set[str]) -> str:
    """The first such key in words, or nothing; ``spoken_of`` are the tables that the claim is about."""
    for key, proved in PAPERS_COORDINATOR.items():
        value = getattr(plant.coordinator, key)
        if value not in (None, proved):
            return f"coordinator.{key} = {value}, only about {proved}"
    for agent in plant.agents:
        if plant.implementation_of(agent.id) is not None:
            return "a sampled controller: [implementation]"
        if "requirements" not in spoken_of and plant.requirements_of(agent.id) != Requirements():
            return f"the [requirements] of agent {agent.id}"
    return ""
