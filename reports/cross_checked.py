"""How a search for counterexamples ended, in words that do not depend on the speed of the machine."""

from __future__ import annotations

import math
from typing import Any, Literal

from sims.cross_check import CrossCheck

TRAJECTORIES = 10_000  # of all agents together: what two cores simulate in the time that the search for gains takes
LEAST = 32  # of each agent: two vertices and more of W and of the boxes of starts

Ending = Literal["refuted", "survived", "inconclusive"]


def ending(found: CrossCheck) -> Ending:
    """``inconclusive`` when at least half of the trajectories could not be integrated."""
    if found.broken is not None:
        return "refuted"
    return "survived" if 2 * found.failed < found.count else "inconclusive"


def sentence(found: CrossCheck, agents: int) -> str:
    """What was simulated and what it showed; how much of it a time limit left out."""
    if found.broken is not None or found.count == 0:
        return found.reason
    said = f"{found.count} trajectories ({_shares(found)}), none breaks the claim"
    if math.isfinite(found.worst_margin):
        said += f", worst margin {found.worst_margin:.2g}"
    if found.failed:
        said += f"; {found.failed} could not be integrated in floats"
    return f"{said}; the time limit left out the rest of {found.asked * agents}" if limited(found, agents) else said


def share_of_each(agents: int) -> int:
    """Trajectories per agent where nothing else is asked."""
    return max(LEAST, -(-TRAJECTORIES // agents))


def limited(found: CrossCheck, agents: int) -> bool:
    """Whether a time limit has cut the search short."""
    return found.broken is None and 0 < found.count < found.asked * agents


def _shares(found: CrossCheck) -> str:
    """How many per agent."""
    shares = {tried.trajectories for tried in found.tried}
    least, most = min(shares), max(shares)
    return f"{most} of each agent" if least == most else f"{least} to {most} of each agent"


def search_fields(found: CrossCheck | None, agents: int) -> dict[str, Any]:
    """The search as JSON; ``left out`` without one."""
    if found is None:
        return {"status": "left out", "trajectories": 0, "margin": None, "reason": "nothing was searched"}
    margin = found.worst_margin if math.isfinite(found.worst_margin) else None
    return {
        "status": ending(found),
        "trajectories": found.count,
        "margin": margin,
        "agents": [{"id": tried.agent, "trajectories": tried.trajectories} for tried in found.tried],
        "asked": found.asked,
        "limited": limited(found, agents),
        "reason": sentence(found, agents),
    }
