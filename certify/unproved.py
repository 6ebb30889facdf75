"""What a plant file may ask for and no theorem here speaks about yet: such a plant is inconclusive, never ignored."""

from __future__ import annotations

from collections.abc import Set

from symbolic.plant import Plant, Requirements

PAPERS_COORDINATOR = {"gradient_gain": 1, "mixing_gain": 1, "mixing_time": 0, "softening": 0}


def unproved_feature(plant: Plant, proved: Set[str]) -> str:
    """The reason, naming the key and what may be written instead; empty if everything asked for can be proved.
    ``proved`` are the tables that the route can prove."""
    for key, theirs in PAPERS_COORDINATOR.items():
        value = getattr(plant.coordinator, key)
        if value not in (None, theirs):
            return f"coordinator.{key} = {value}: nothing is proved about it yet; {theirs} or leaving it out is"
    if plant.implementations:
        return (
            "[implementation]: nothing is proved about a sampled controller yet; without the table a continuous one is"
        )
    for agent in plant.agents:
        if "requirements" not in proved and plant.requirements_of(agent.id) != Requirements():
            return f"[requirements] of agent {agent.id}: this route proves nothing about them; --route direct does"
    return ""
