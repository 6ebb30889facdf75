"""A1: every cost is C² with ``0 < ϖ ≤ c''(s) ≤ l`` for all real ``s`` (theory.md section 2)."""

from __future__ import annotations

from certify.assumptions.findings import Finding, unless_holds
from certify.curvature import Curvature, CurvatureFailure, cost_curvature, domain_failure
from symbolic.plant import Agent

__all__ = ["Curvature", "CurvatureFailure", "check_cost", "cost_curvature"]


def check_cost(agent: Agent) -> Finding:
    """Decide A1 for one agent, every part of the cost's text included.

    Evidence: ``varpi`` and ``l`` as exact rationals, or where it fails.
    """
    found = next(filter(None, map(domain_failure, agent.guards.cost)), None) or cost_curvature(agent.cost)
    if isinstance(found, CurvatureFailure):
        verdict = unless_holds(found.verdict)
        return Finding("A1", agent.id, verdict, found.reason, {"cost": str(agent.cost), **found.evidence})
    return Finding(
        "A1",
        agent.id,
        "holds",
        "the second derivative of the cost has positive bounds over the whole real line",
        {"cost": str(agent.cost), "varpi": str(found.lower), "l": str(found.upper), "method": found.method},
    )
