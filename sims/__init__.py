"""Simulation of the closed loop in floats. Nothing here proves anything; plots are in ``sims.plots``."""

from sims.closed_loop import AgentTrajectory, Trajectory, simulate
from sims.coordinator import estimated_optimum
from sims.ensemble import EnsembleResult, Run, ensemble
from sims.scenario import AgentStart, Scenario, nominal, random_scenario

__all__ = [
    "AgentStart",
    "AgentTrajectory",
    "EnsembleResult",
    "Run",
    "Scenario",
    "Trajectory",
    "ensemble",
    "estimated_optimum",
    "nominal",
    "random_scenario",
    "simulate",
]
