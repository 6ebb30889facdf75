"""The network as a claim has it: prepared once more with its coordinator and its designs, to prove more about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from certify.assumptions.check import check_assumptions
from certify.preparation import Prepared, Report, Stopped, prepare
from certify.routes import ROUTES
from certify.statement.exact_numbers import exact, exact_matrix, exact_row
from symbolic.plant import Agent, CoordinatorChoice, InternalModelChoice, Plant, RequestedGains


def claimed_network(plant: Plant, claim: Mapping[str, Any], report: Report) -> Prepared | Stopped:
    """For a claim of the direct route that the checker has verified for ``plant``; its gains are left out."""
    names = [field.name for field in fields(CoordinatorChoice) if field.name in claim]
    choice = CoordinatorChoice(**{name: exact(claim[name]) for name in names})
    agents = tuple(_designed(agent, entry) for agent, entry in zip(plant.agents, claim["agents"], strict=True))
    designed, route = replace(plant, agents=agents, gains=(), coordinator=choice), ROUTES["direct"]
    return prepare(
        designed, check_assumptions(plant), report, route.proved_on_the_way, route.resolution, proved=route.proves
    )


def claimed_gains(entry: Mapping[str, Any]) -> RequestedGains:
    """The gains of one agent of a claim."""
    h = None if entry["h"] is None else exact(entry["h"])
    return RequestedGains(exact(entry["g"]), exact(entry["K"]), exact(entry["delta"]), h)


def _designed(agent: Agent, entry: Mapping[str, Any]) -> Agent:
    M, observed = exact_matrix(entry["M"]), agent.order > 1
    return replace(
        agent,
        gamma=exact_row(entry["gamma"]) if observed else agent.gamma,
        observer=exact_row(entry["observer"]) if observed else agent.observer,
        internal_model=InternalModelChoice(M, exact_row(entry["N"])) if M else agent.internal_model,
    )
