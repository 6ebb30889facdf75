"""Bounds of what is not nominal, over boxes of the error coordinates (docs/certificate-direct.md section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from certify.agent_model import AgentModel
from certify.bounds.balls import compile_expression
from certify.tube.ranges import Argument, FloatProgram, Range, floats, magnitude, meet, symmetric, widen
from certify.tube.surroundings import Moment
from certify.tube.tapes import Tape
from symbolic.plant import COST_VARIABLE

REST: Range = (0.0, 0.0)
Ranges = tuple[Range, ...]
Bounds = Sequence[float] | np.ndarray
Rows = Sequence[Sequence[float]]


@dataclass(frozen=True)
class Slopes:
    """Ranges of the secant slopes of ``f0`` in ``(z, x1)`` (one row each) and of ``f1`` in ``(z, x)``."""

    f0: tuple[tuple[Range, ...], ...]
    f1: tuple[Range, ...]


class Increments:
    """The right-hand sides of one agent, compiled, and their slopes over boxes."""

    def __init__(self, model: AgentModel) -> None:
        agent = model.agent
        self.model = model
        self.zeros, self.order = len(agent.zero_states), model.order
        self.symbols = (*agent.zero_states, *agent.chain, COST_VARIABLE, *model.exosystem.states, *agent.parameters)
        self.parameters = [floats(side) for side in agent.parameter_box]
        self.optimum = floats(model.optimum)
        self.b = floats(model.input_gain)
        functions = [FloatProgram(compile_expression(f, self.symbols)) for f in (*agent.zero_dynamics, agent.f)]
        self._f0_slopes = [self._slope_tapes(function, self.zeros + 1) for function in functions[:-1]]
        self._f1_slopes = self._slope_tapes(functions[-1], self.zeros + self.order)
        self._speeds = [self._speed_tape(function) for function in functions[:-1]]

    def slopes(self, z: Bounds, x: Bounds, moment: Moment, known: Ranges = ()) -> Slopes:
        """Slopes over the box of magnitudes ``z, x`` of ``z̄, x̄``. One coordinate after the other moves from ``(z*, s*,
        0 … 0)`` to where it is: ``z`` first, then ``x_1 … x_n``. ``known`` are ranges of ``z`` itself, empty where
        nothing is known."""
        moved = [*self.zero_ranges(z, moment, known), widen(moment.reference, x[0]), *map(symmetric, x[1:])]
        inputs = [*moved, *moment.steady, *moment.v]
        return Slopes(
            tuple([_replayed(row, inputs) for row in self._f0_slopes]),
            _replayed(self._f1_slopes, inputs),
        )

    def _slope_tapes(self, function: FloatProgram, count: int) -> list[tuple[Tape, Range | None]]:
        """Slopes in the first ``count`` coordinates, of where ``z, x`` have moved to, ``z*`` and ``v``; many are the
        same for all."""
        states, disturbances = self.zeros + self.order, len(self.model.exosystem.states)
        inputs = states + self.zeros + disturbances
        rest: list[Argument] = [*range(states, states + self.zeros), self.optimum, *[REST] * (self.order - 1)]
        others: list[Argument] = [self.optimum, *range(states + self.zeros, inputs), *self.parameters]
        tapes = [function.slope(inputs, [*range(k + 1), *rest[k + 1 :], *others], k, rest[k]) for k in range(count)]
        return [(tape, tape.fixed) for tape in tapes]

    def _speed_tape(self, function: FloatProgram) -> Tape:
        """The range of a function of ``z, x_1`` and ``v``."""
        inputs = self.zeros + 1 + len(self.model.exosystem.states)
        states: list[Argument] = [*range(self.zeros + 1), *[REST] * (self.order - 1)]
        return function.enclosure(inputs, [*states, self.optimum, *range(self.zeros + 1, inputs), *self.parameters])

    def zero_ranges(self, z: Bounds, moment: Moment, known: Ranges = ()) -> list[Range]:
        """``[z*] ± ẑ``, cut with what is known of ``z`` itself."""
        around = [widen(steady, bound) for steady, bound in zip(moment.steady, z, strict=True)]
        return [meet(side, other) for side, other in zip(around, known, strict=True)] if known else around

    def zero_speed(self, k: int, zs: Sequence[Range], others: Sequence[Range]) -> Range:
        """The range of ``z_k'`` over ranges of ``z``, and of ``x_1`` and ``v``."""
        return self._speeds[k]([*zs, *others])


def _replayed(tapes: list[tuple[Tape, Range | None]], inputs: list[Range]) -> Ranges:
    return tuple([fixed or tape(inputs) for tape, fixed in tapes])


def residuals(slopes: Slopes, f0: Rows, f1: Sequence[float], zeros: int) -> tuple[list[list[float]], list[float]]:
    """``S`` and ``s`` with ``|q| ≤ S (ẑ, x̂) + s Y`` for the inputs ``q_1 … q_nz, q_f``; nominal slopes ``f0, f1``. The
    rows of ``S`` end where there is nothing more."""
    sides = (*slopes.f0, slopes.f1)
    S = [
        [max(abs(low - middle), abs(high - middle)) for (low, high), middle in zip(row, nominal, strict=True)]
        for row, nominal in zip(sides, (*f0, f1), strict=True)
    ]
    return S, [magnitude(row[zeros]) for row in sides]
