"""Whether a plant can be simulated, and how a run ended, in words; what the command line and the door share."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sims.closed_loop import Trajectory
    from symbolic.derivation import Derivation
    from symbolic.plant import Plant

LAST = 0.05  # of the run, over which the error at its end is taken: a single instant may be a zero of an oscillation
BUDGET = 1000  # trajectories of a search for each agent: some ten seconds for a small plant


def obstacle(plant: Plant, derivation: Derivation) -> str:
    """Why the closed loop cannot be simulated; empty if it can.

    Without A2 some ``1/ξ_i^i`` grows for ever, and no integrator follows it; without A1 there may be no optimum.
    """
    from certify.assumptions.a1_costs import check_cost
    from certify.assumptions.a2_network import check_network

    for finding in (check_network(plant.digraph), *map(check_cost, plant.agents)):
        if finding.verdict == "fails":
            return f"not simulated, {finding.id} fails: {finding.reason}"
    if derivation.verdict != "holds":
        return "not simulated: no steady state or no internal model was found (see certify derive)"
    return ""


def sentence(trajectory: Trajectory) -> str:
    """How the run ended, for people."""
    if trajectory.status != "completed":
        return f"{trajectory.status}: {trajectory.reason}"
    error = trajectory.final_error(LAST * trajectory.end)
    return (
        f"max |y_i - s*| = {error:.2e} over the last twentieth of {trajectory.end:.4g} s, s* = {trajectory.optimum:.6g}"
    )
