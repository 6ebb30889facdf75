"""Bounds of what is not nominal, over boxes of the error coordinates (docs/certificate-direct.md section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from certify.agent_model import AgentModel
from certify.bounds.balls import compile_expression
from certify.tube.ranges import FloatProgram, Range, floats, magnitude, meet, symmetric, widen
from certify.tube.surroundings import Moment
from symbolic.plant import COST_VARIABLE

REST: Range = (0.0, 0.0)
Ranges = tuple[Range, ...]


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
        self.f1 = FloatProgram(compile_expression(agent.f, self.symbols))
        self.f0 = [FloatProgram(compile_expression(f0, self.symbols)) for f0 in agent.zero_dynamics]
        self.b = floats(model.input_gain)

    def slopes(self, z: np.ndarray, x: np.ndarray, moment: Moment, known: Ranges = ()) -> Slopes:
        """Slopes over the box of magnitudes ``z, x`` of ``z̄, x̄``. One coordinate after the other moves from ``(z*, s*,
        0 … 0)`` to where it is: ``z`` first, then ``x_1 … x_n``. ``known`` are ranges of ``z`` itself, empty where
        nothing is known."""
        rest = [*moment.steady, self.optimum, *[REST] * (self.order - 1)]
        moved = [*self.zero_ranges(z, moment, known), widen(moment.reference, x[0]), *map(symmetric, x[1:])]
        others = [self.optimum, *moment.v, *self.parameters]

        def row(function: FloatProgram, count: int) -> tuple[Range, ...]:
            return tuple(function.secant([*moved[: k + 1], *rest[k + 1 :], *others], k, rest[k]) for k in range(count))

        return Slopes(tuple(row(f0, self.zeros + 1) for f0 in self.f0), row(self.f1, self.zeros + self.order))

    def zero_ranges(self, z: np.ndarray, moment: Moment, known: Ranges = ()) -> list[Range]:
        """``[z*] ± ẑ``, cut with what is known of ``z`` itself."""
        around = [widen(steady, bound) for steady, bound in zip(moment.steady, z, strict=True)]
        return [meet(side, other) for side, other in zip(around, known, strict=True)] if known else around

    def zero_speed(self, k: int, zs: Sequence[Range], output: Range, moment: Moment) -> Range:
        """The range of ``z_k'`` over ranges of ``z`` and ``x_1``."""
        rest = [output] + [REST] * (self.order - 1)
        return self.f0[k].enclose([*zs, *rest, self.optimum, *moment.v, *self.parameters])


def residuals(slopes: Slopes, f0: np.ndarray, f1: np.ndarray, zeros: int) -> tuple[np.ndarray, np.ndarray]:
    """``S`` and ``s`` with ``|q| ≤ S (ẑ, x̂) + s Y`` for the inputs ``q_1 … q_nz, q_f``; nominal slopes ``f0, f1``."""
    width = len(f1)
    S, s = np.zeros((zeros + 1, width)), np.zeros(zeros + 1)
    for k, row in enumerate(slopes.f0):
        for j in range(zeros + 1):
            S[k, j] = magnitude(minus(row[j], f0[k, j]))
        s[k] = magnitude(row[zeros])
    for j in range(width):
        S[zeros, j] = magnitude(minus(slopes.f1[j], f1[j]))
    s[zeros] = magnitude(slopes.f1[zeros])
    return S, s


def minus(side: Range, nominal: float) -> Range:
    """The range minus the nominal value."""
    return side[0] - nominal, side[1] - nominal
