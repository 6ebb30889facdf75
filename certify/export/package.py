"""From a verified certificate to the programs of its agents (docs/export.md)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from certify.export.agent_program import AgentProgram, State, agent_program, middle
from certify.export.coordination import Coordinator, coordinator, coordinator_program
from certify.export.formats import DOUBLE, FORMATS, Arithmetic, Constant, constant
from certify.export.periods import coordinator_period, longest_round, round_number, sampling_period
from certify.export.sampled_stability import SampledLoop, sampled_loops
from symbolic.controller import Controller, CoordinatorGains
from symbolic.errors import InputError
from symbolic.plant import Plant


@dataclass(frozen=True)
class Options:
    """What the user asks for; ``None`` is taken from the plant file, or chosen where that is silent."""

    period: Fraction | None = None
    coordinator_period: Fraction | None = None
    arithmetic: Arithmetic | None = None


@dataclass(frozen=True)
class Package:
    """The programs with what is to be said about them."""

    programs: tuple[AgentProgram, ...]
    digest: str
    theorem: str
    notice: tuple[str, ...]


def package(
    plant: Plant, claim: Mapping[str, Any], digest: str, theorem: str, controller: Controller, options: Options
) -> Package:
    """The programs of a claim that was verified, ``digest`` its sha256. Raises ``InputError`` for periods that do not
    fit."""
    if len(plant.agents) < 2:
        raise InputError("a network of one agent has nobody to exchange messages with; the export needs two")
    asked = [plant.implementation_of(agent.id) for agent in plant.agents]
    chosen = options.period is None and all(part is None for part in asked)
    loops = sampled_loops(plant, controller)
    gains = controller.coordinator
    longest = longest_round(plant, gains)
    common = options.period
    if chosen:
        common = min(sampling_period(plant.agents, controller.agents, loops), round_number(longest))
    periods = [common if part is None or common is not None else part.period for part in asked]
    for agent, loop, period in zip(plant.agents, loops, _known(periods), strict=True):
        _require_stable(agent.id, loop, period)
    rounds = options.coordinator_period or plant.coordinator.period
    if rounds is None:
        rounds = coordinator_period(longest, max(_known(periods)))
    shared = coordinator(plant, gains, rounds)
    entries = {int(entry["id"]): entry for entry in claim["agents"]}
    programs = []
    for agent, law, part, period in zip(plant.agents, controller.agents, asked, _known(periods), strict=True):
        arithmetic = options.arithmetic or (part.arithmetic if part is not None else None) or DOUBLE.name
        start = constant("REFERENCE_0", "y^r at the start", middle(agent.initial.reference), DOUBLE)
        programs.append(
            agent_program(
                agent,
                law,
                entries[agent.id],
                period,
                None if part is None else part.input_resolution,
                FORMATS[arithmetic],
                coordinator_program(plant, shared, agent.id),
                rounds,
                start,
            )
        )
    return Package(tuple(programs), digest, theorem, tuple(_notice(plant, theorem, chosen, shared, gains)))


def _require_stable(agent: int, loop: SampledLoop, period: Fraction) -> None:
    if loop.looks_stable(period):
        return
    shorter = loop.shorter(period)
    advice = "; no shorter one is stable either" if shorter is None else f"; {float(shorter):.2g} looks stable"
    raise InputError(
        f"period: with {period} the linearised sampled loop of agent {agent} is unstable (spectral radius "
        f"{loop.radius(period):.5g}, an estimate){advice}"
    )


def _known(periods: Sequence[Fraction | None]) -> list[Fraction]:
    return [period for period in periods if period is not None]


def _notice(plant: Plant, theorem: str, chosen: bool, shared: Coordinator, claimed: CoordinatorGains) -> list[str]:
    """What is proved about this code and what is not."""
    by = "a rule of thumb (docs/export.md)" if chosen else "the user"
    waits = shared.hold * shared.period
    longer = (
        [f"The references wait {float(waits):.4g} for the mixing layer, the claim's {float(claimed.mixing_time):.4g}."]
        if waits > claimed.mixing_time + shared.period
        else []
    )
    return [
        f"The theorem {theorem} proves the claim for the controller in continuous time.",
        f"Nothing is proved about sampling: the period was chosen by {by}.",
        "Nor about delay, noise, converters, rounding, or messages that are late or lost.",
        *longer,
        f"Units: those of the plant file (sha256 {plant.sha256}), periods in its unit of time.",
    ]


def json_text(package: Package) -> str:
    """All numbers of the programs: exact value, hexadecimal float, and a bound of the rounding."""
    return json.dumps({"claim": package.digest, "notice": list(package.notice), "agents": [
        _agent(program) for program in package.programs
    ]}, indent=1) + "\n"  # fmt: skip


def _agent(program: AgentProgram) -> dict[str, Any]:
    network = program.coordinator
    return {
        "id": program.id,
        "arithmetic": program.format.name,
        "period": str(program.period),
        "coordinator": {
            "period": str(program.period * program.substeps),
            "samples": program.substeps,
            "hold": network.hold,
            "mixing": network.mixing,
            "constants": [_number(c) for c in (*network.constants, program.reference)],
            "weights": [
                {"agent": j, **_number(c)} for j, c in zip(network.neighbours, network.weights, strict=True)
            ],
            "slope": {
                "constants": [_number(c) for c in network.slope_constants],
                "statements": [f"{let.name} = {let.expression}" for let in network.slope],
            },
        },
        "reference": "of the next sample" if program.ahead else "of this sample",
        "constants": [_number(c) for c in program.constants],
        "states": [_state(state, program) for state in program.states],
        "step": [_said(statement) for statement in program.step],
        "missed": [_said(statement) for statement in program.missed],
    }  # fmt: skip


def _state(state: State, program: AgentProgram) -> dict[str, Any]:
    start = "y" if state.name == program.measured_state else _number(state.start)
    return {"name": state.name, "meaning": state.meaning, "start": start}


def _number(c: Constant) -> dict[str, Any]:
    return {
        "name": c.name,
        "meaning": c.meaning,
        "float": c.number,
        "hexadecimal": c.hexadecimal,
        "exact": str(c.value),
        "rounding": str(c.error if c.error.denominator < 10**12 or c.error == 0 else _above(c.error)),
    }


def _above(error: Fraction) -> Fraction:
    """A short number that is not below: the next power of two."""
    power = Fraction(1)
    while power >= error:
        power /= 2
    return power * 2


def _said(statement: Any) -> str:
    if hasattr(statement, "expression"):
        return f"{statement.name} = {statement.expression}"
    if hasattr(statement, "bound"):
        return f"{statement.name} = {statement.source} limited to +-{statement.bound}"
    return f"{statement.name} = {statement.source} rounded to a multiple of {statement.step}"
