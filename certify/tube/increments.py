"""Bounds of what is not nominal, over boxes of the error coordinates (docs/certificate-direct.md section 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy

from certify.agent_model import AgentModel
from certify.bounds.balls import Program, compile_expression
from certify.tube.ranges import Range, enclose, floats, hull, magnitude, symmetric, widen
from certify.tube.surroundings import Moment
from symbolic.plant import COST_VARIABLE

REST: Range = (0.0, 0.0)


@dataclass(frozen=True)
class Slopes:
    """Ranges of the slopes of ``f0`` in ``(z, x1)`` (one row each) and of ``f1`` in ``(z, x)``."""

    f0: tuple[tuple[Range, ...], ...]
    f1: tuple[Range, ...]


class Increments:
    """The compiled partial derivatives of one agent."""

    def __init__(self, model: AgentModel) -> None:
        agent = model.agent
        self.model = model
        self.zeros, self.order = len(agent.zero_states), model.order
        self.symbols = (*agent.zero_states, *agent.chain, COST_VARIABLE, *model.exosystem.states, *agent.parameters)
        self.parameters = [floats(side) for side in agent.parameter_box]
        self.optimum = floats(model.optimum)
        self.f1 = [self._slope(agent.f, x) for x in (*agent.zero_states, *agent.chain)]
        self.f0 = [[self._slope(f0, x) for x in (*agent.zero_states, agent.chain[0])] for f0 in agent.zero_dynamics]
        self.b = floats(model.input_gain)

    def _slope(self, expression: sympy.Expr, x: sympy.Symbol) -> Program:
        return compile_expression(sympy.diff(expression, x), self.symbols)

    def slopes(self, z: np.ndarray, x: np.ndarray, moment: Moment) -> Slopes:
        """Slopes over the box of magnitudes ``z, x`` of ``z̄, x̄``, coordinate by coordinate: ``x_n`` first, ``z``
        last."""
        zs = [widen(steady, bound) for steady, bound in zip(moment.steady, z, strict=True)]
        moved = [hull(self.optimum, widen(moment.reference, x[0])), *(symmetric(bound) for bound in x[1:])]
        rest = [self.optimum] + [REST] * (self.order - 1)
        others = [self.optimum, *moment.v, *self.parameters]
        along = [
            enclose(self.f1[self.zeros + k], [*zs, *moved[: k + 1], *rest[k + 1 :], *others]) for k in range(self.order)
        ]
        at_rest = [*zs, *rest, *others]
        f1 = [*(enclose(self.f1[k], at_rest) for k in range(self.zeros)), *along]
        f0 = [
            (*(enclose(slope, at_rest) for slope in row[:-1]), enclose(row[-1], [*zs, moved[0], *rest[1:], *others]))
            for row in self.f0
        ]
        return Slopes(tuple(f0), tuple(f1))


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
