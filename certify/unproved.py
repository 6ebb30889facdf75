"""What a plant file may ask for and no theorem here speaks about yet: such a plant is inconclusive, never ignored."""

from __future__ import annotations

from collections.abc import Set

from symbolic.plant import Plant, Requirements


def unproved_feature(plant: Plant, proved: Set[str]) -> str:
    """The reason, naming the key and what may be written instead; empty if everything asked for can be proved.
    ``proved`` are the tables that the route can prove."""
    if plant.implementations:
        return (
            "[implementation]: nothing is proved about a sampled controller yet; without the table a continuous one "
            "is, and certify export --period samples it, unproved"
        )
    for agent in plant.agents:
        if "requirements" not in proved and plant.requirements_of(agent.id) != Requirements():
            return f"[requirements] of agent {agent.id}: this route proves nothing about them; --route direct does"
    return ""
