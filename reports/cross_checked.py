"""How a search for counterexamples ended, in words that do not depend on the speed of the machine."""

from __future__ import annotations

import math
from typing import Any, Literal

from reports.cells import agents as listed
from sims.cross_check import CrossCheck

SECONDS = 15.0

Ending = Literal["refuted", "survived", "inconclusive"]


def ending(found: CrossCheck) -> Ending:
    """``inconclusive`` when at least half of the trajectories could not be integrated."""
    if found.broken is not None:
        return "refuted"
    return "survived" if 2 * found.failed < found.count else "inconclusive"


def sentence(found: CrossCheck, agents: int) -> str:
    """What was simulated and what it showed; which of the ``agents`` were left out for want of time."""
    if found.broken is not None or found.count == 0:
        return found.reason
    said = f"{found.count} trajectories ({_shares(found)}), none breaks the claim"
    if math.isfinite(found.worst_margin):
        said += f", worst margin {found.worst_margin:.2g}"
    if found.failed:
        said += f"; {found.failed} could not be integrated in floats"
    missed = sorted(set(range(1, agents + 1)) - {tried.agent for tried in found.tried})
    return f"{said}; the time did not suffice for agents {listed(missed)}" if missed else said


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
        "budget_seconds": SECONDS,
        "reason": sentence(found, agents),
    }
