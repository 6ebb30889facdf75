"""What a plant file may ask for and no theorem of this checker speaks about: never ignored, always a rejection."""

from __future__ import annotations

from collections.abc import Set

from certify.checker.plant import Plant
from certify.checker.requested import Requirements


def unproved_feature(plant: Plant, spoken_of: Set[str]) -> str:
    """The first such key in words, or nothing; ``spoken_of`` are the tables that the claim is about."""
    for agent in plant.agents:
        if plant.implementation_of(agent.id) is not None:
            return "a sampled controller: [implementation]"
        if "requirements" not in spoken_of and plant.requirements_of(agent.id) != Requirements():
            return f"the [requirements] of agent {agent.id}"
    return ""
