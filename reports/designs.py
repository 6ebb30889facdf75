"""The part of a certified controller that the plant file may leave open: observer, ``γ``, internal model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from certify.statement.exact_numbers import Matrix, Row, exact_matrix, exact_row
from reports import cells
from symbolic.controller import AgentController
from symbolic.design import companion_pair, design_polynomials
from symbolic.plant import Agent, InternalModelChoice, Plant

Claim = Mapping[str, Any]


def designed_plant(plant: Plant, claim: Claim) -> Plant:
    """The plant with the designs of a claim that the checker has accepted for it."""
    theirs = zip(plant.agents, claim["agents"], strict=True)
    return replace(plant, agents=tuple(_designed(agent, *_design(entry)) for agent, entry in theirs))


def chosen_designs(plant: Plant, claim: Claim) -> list[str]:
    """What was chosen and is no default, as lines for a plant file, agents with the same lines together."""
    found: dict[str, list[int]] = {}
    for agent, entry in zip(plant.agents, claim["agents"], strict=True):
        for line in _lines(agent, _designed(agent, *_design(entry))):
            found.setdefault(line, []).append(agent.id)
    return [f"{cells.agents_named(ids).lower()}: {line}" for line, ids in found.items()]


def design_lines(agent: Agent, law: AgentController) -> list[str]:
    """The same for one controller of an agent."""
    return _lines(agent, _designed(agent, law.gamma, law.observer, law.M, law.N))


def _design(entry: Claim) -> tuple[Row, Row, Matrix, Row]:
    return exact_row(entry["gamma"]), exact_row(entry["observer"]), exact_matrix(entry["M"]), exact_row(entry["N"])


def _designed(agent: Agent, gamma: Row, observer: Row, M: Matrix, N: Row) -> Agent:
    return replace(
        agent,
        gamma=gamma if agent.order > 1 else agent.gamma,
        observer=observer if agent.order > 1 else agent.observer,
        internal_model=InternalModelChoice(M, N) if M else agent.internal_model,
    )


def _lines(agent: Agent, designed: Agent) -> list[str]:
    default, chosen, model = design_polynomials(agent), design_polynomials(designed), designed.internal_model
    lines = []
    if chosen.observer != default.observer:
        lines.append(f"observer = {_array(chosen.observer)}")
    if chosen.gamma != default.gamma:
        lines.append(f"gamma = {_array(chosen.gamma)}")
    if model is not None and model != (agent.internal_model or companion_pair(len(model.N))):
        rows = ", ".join(map(_array, model.M))
        lines.append(f"internal_model = {{ M = [{rows}], N = {_array(model.N)} }}")
    return lines


def _array(row: Row) -> str:
    return "[" + ", ".join(str(value) if value.denominator == 1 else f'"{value}"' for value in row) + "]"
