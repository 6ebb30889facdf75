"""One agent's controller as constants, states and statements: what the printers for C and Python turn into code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import ctx

from certify.export.coordination import CoordinatorProgram
from certify.export.formats import PRECISION, Constant, Exact, Format, constant
from certify.export.modes import Mode, modes
from certify.export.observer import luenberger
from certify.export.statements import Clamp, Let, Quantise, Statement, total
from symbolic.controller import AgentController
from symbolic.errors import InputError
from symbolic.plant import Agent, Interval


@dataclass(frozen=True)
class State:
    """A state of the controller and its value at the start."""

    name: str
    meaning: str
    start: Constant


@dataclass(frozen=True)
class AgentProgram:
    """Everything that the code of one agent is made of.

    ``step`` computes ``written`` from ``y``, ``reference`` and the states and ends with ``next_<state>`` for every
    state; ``missed`` does so without a measurement, from ``written`` of the step before. ``ahead`` says whether
    ``reference`` is that of the next sample (order 2 and more) or of this one. ``measured``: ``x̃_1`` starts at ``y``.
    ``corrections`` maps a state to the gain with which it sees a written value that differs.
    """

    id: int
    format: Format
    period: Fraction
    substeps: int
    reference: Constant
    ahead: bool
    measured: bool
    constants: tuple[Constant, ...]
    states: tuple[State, ...]
    step: tuple[Statement, ...]
    missed: tuple[Statement, ...]
    corrections: Mapping[str, str]
    coordinator: CoordinatorProgram

    @property
    def measured_state(self) -> str | None:
        """The state that starts at the first sample."""
        return "x1" if self.measured else None


def agent_program(
    agent: Agent,
    law: AgentController,
    claim: Mapping[str, Any],
    period: Fraction,
    resolution: Fraction | None,
    format: Format,
    network: CoordinatorProgram,
    coordinator_period: Fraction,
    reference: Constant,
) -> AgentProgram:
    """Of one agent of a verified claim. Raises ``InputError`` if a constant has no place in the format."""
    substeps = coordinator_period / period
    if substeps.denominator != 1:
        raise InputError(
            f"coordinator.period: {coordinator_period} is no whole multiple of agent {agent.id}'s period {period}"
        )
    with ctx.workprec(PRECISION):
        builder = _Builder(agent, law, format, period)
        builder.observe()
        builder.feed_back()
        builder.add_model()
        builder.write(_limit(claim), resolution)
    return AgentProgram(
        agent.id,
        format,
        period,
        int(substeps),
        reference,
        ahead=law.h is not None,
        measured=law.h is not None and agent.initial.observer is None,
        constants=tuple(builder.constants),
        states=tuple(builder.states),
        step=(*builder.step, *builder.advance),
        missed=tuple(builder.missed),
        corrections=builder.corrections,
        coordinator=network,
    )


def middle(side: Interval) -> Fraction:
    """Where the designer's own states start: any point of the certified box will do."""
    return (side.lo + side.hi) / 2


def _limit(claim: Mapping[str, Any]) -> Fraction | None:
    """The bound on the input that the claim contains, if it contains one."""
    asked = claim.get("requirements") or {}
    return None if asked.get("input") is None else Fraction(asked["input"])


class _Builder:
    """Collects the program in the order in which it runs."""

    def __init__(self, agent: Agent, law: AgentController, format: Format, period: Fraction) -> None:
        self.agent, self.law, self.format, self.period = agent, law, format, period
        self.modes: tuple[Mode, ...] = modes(law, period, middle(agent.initial.eta))
        self.constants: list[Constant] = []
        self.states: list[State] = []
        self.step: list[Statement] = []
        self.advance: list[Statement] = []
        self.missed: list[Statement] = []
        self.corrections: dict[str, str] = {}

    def constant(self, name: str, meaning: str, exact: Exact) -> str:
        self.constants.append(constant(name, meaning, exact, self.format))
        return name

    def state(self, name: str, meaning: str, start: Exact) -> str:
        self.states.append(
            State(name, meaning, constant(f"{name.upper()}_0", f"{name} at the start", start, self.format))
        )
        return name

    def observe(self) -> None:
        """The estimate of the next sample."""
        law, n = self.law, len(self.law.gamma) + 1
        if law.h is None:
            return
        found = luenberger(law.observer, law.h, self.period)
        starts = self.agent.initial.observer
        for k in range(1, n + 1):
            start = Fraction(0) if starts is None else middle(starts[k - 1])
            self.state(f"x{k}", f"estimate of x{k}", start)
        powers = [self.constant(f"E_{j}", f"tau^{j}/{j}!", found.transition[j]) for j in range(1, n)]
        gains = [
            self.constant(f"L_{k}", f"gain of the observer, row {k}", value) for k, value in enumerate(found.gain, 1)
        ]
        self.step.append(Let("innovation", "y - x1", "what the measurement says beyond the estimate"))
        for k in range(1, n + 1):
            moved = total([f"x{k}", *(f"{powers[j - 1]} * x{k + j}" for j in range(1, n - k + 1))])
            self.step.append(Let(f"next_x{k}", f"{moved} + {gains[k - 1]} * innovation"))
            self.missed.append(Let(f"next_x{k}", moved))

    def feed_back(self) -> None:
        """``sat_δ(K ϑ̃)``."""
        law, n = self.law, len(self.law.gamma) + 1
        gamma = (*law.gamma, Fraction(1))
        weights = [law.K * law.g ** (n - k) * gamma[k - 1] for k in range(1, n + 1)]
        names = [self.constant(f"K_{k}", f"K g^{n - k} gamma_{k}", weight) for k, weight in enumerate(weights, 1)]
        estimates = ["y"] if law.h is None else [f"next_x{k}" for k in range(1, n + 1)]
        self.step.append(Let("offset", f"{estimates[0]} - reference"))
        terms = [f"{name} * {value}" for name, value in zip(names, ["offset", *estimates[1:]], strict=True)]
        self.step.append(Let("demand", total(terms), "K theta"))
        self.constant("DELTA", "saturation level delta", law.delta)
        self.step.append(Clamp("feedback", "demand", "DELTA"))

    def add_model(self) -> None:
        """``Ψη`` is the sum of the first states of the modes."""
        place = 0
        for number, mode in enumerate(self.modes, 1):
            names = []
            for start in mode.start:
                place += 1
                names.append(self.state(f"m{place}", f"internal model, mode {number}", start))
            self._rotate(number, mode, names)
        firsts = [f"m{place}" for place in self._firsts()]
        if firsts:
            self.step.append(Let("model", total(firsts), "the input that the internal model has learned"))
            self.step.append(Let("demanded", "model - feedback"))
        else:
            self.step.append(Let("demanded", "-feedback"))

    def _firsts(self) -> list[int]:
        places, place = [], 1
        for mode in self.modes:
            places.append(place)
            place += len(mode.start)
        return places

    def _rotate(self, number: int, mode: Mode, names: list[str]) -> None:
        about = "the constant part" if mode.frequency is None else f"frequency {float(mode.frequency.mid()):.6g} rad/s"
        gains = [
            self.constant(f"G_{name[1:]}", f"input of mode {number} ({about})", value)
            for name, value in zip(names, mode.gain, strict=True)
        ]
        if mode.frequency is None:
            rows = [names[0]]
        else:
            c = self.constant(f"COS_{number}", f"cosine of mode {number} in one period", mode.cosine)
            s = self.constant(f"SIN_{number}", f"sine of mode {number} in one period", mode.sine)
            a, b = names
            rows = [f"{c} * {a} + {s} * {b}", f"{c} * {b} - {s} * {a}"]
        for name, gain, moved in zip(names, gains, rows, strict=True):
            self.advance.append(Let(f"next_{name}", f"{moved} + {gain} * excess"))
            self.corrections[name] = gain

    def write(self, limit: Fraction | None, resolution: Fraction | None) -> None:
        """Limit and round as the converter does, so that the internal model hears what the plant gets."""
        source = "demanded"
        if limit is not None:
            self.constant("LIMIT", "certified bound of the input", limit)
            self.step.append(Clamp("limited", source, "LIMIT"))
            source = "limited"
        if resolution is not None:
            self.constant("RESOLUTION", "step of the converter", resolution)
            self.step.append(Quantise("rounded", source, "RESOLUTION"))
            source = "rounded"
        self.step.append(Let("written", source))
        if self.modes:
            self.advance.insert(0, Let("excess", "written - model"))
            firsts = total(f"m{place}" for place in self._firsts())
            self.missed.append(Let("model", firsts))
            self.missed += self.advance
