"""The frequency response of one agent's loop, opened at its actuator, with the margins at corners of ``W``.

The loop is linearised at the steady state with the exosystem at rest and the saturation inactive, and frozen there:
estimates in floats, of which nothing is proved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np
import sympy
from numpy.typing import NDArray

from certify.gains.loop_matrix import assemble, plant_slopes
from sims.signals import Array
from symbolic.controller import AgentController
from symbolic.plant import COST_VARIABLE, Agent
from symbolic.steady_state import SteadyState

POINTS = 600
MOST_CORNERS = 16
AT_REST = 0.1  # of the real part: the first frequency is far below every mode
BEYOND = 30.0  # times the slowest and the fastest mode: where the response has become a straight line

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Margins:
    """``phase`` in degrees, ``gain`` and ``reduction`` as factors by which the loop gain may grow and shrink, ``delay``
    in seconds, ``distance`` the least ``|1 + L|``; infinite where nothing limits them."""

    phase: float
    gain: float
    reduction: float
    delay: float
    distance: float


@dataclass(frozen=True)
class LoopResponse:
    """``L(iω)`` at corners of ``W``, shape ``(corners, frequencies)``; ``frequencies`` in rad/s.

    ``margins`` are the least over the corners.
    """

    agent: int
    frequencies: Array
    values: Complex
    margins: Margins


def loop_response(agent: Agent, law: AgentController, steady: SteadyState, optimum: float) -> LoopResponse | None:
    """``None`` where the linearised loop is not stable at a corner: then margins mean nothing."""
    slopes = plant_slopes(agent, steady)
    last = len(agent.zero_states) + agent.order - 1
    loops, modes = [], []
    for corner in _corners(agent):
        values = [_value(entry, corner, optimum) for entry in slopes.entries]
        closed = np.array(assemble(agent, law, values).at(law.h), dtype=float)
        feedback = _feedback(agent, law, len(closed))
        entry = np.zeros(len(closed))
        entry[last] = float(values[-1])
        poles = np.linalg.eigvals(closed)
        if poles.real.max() >= 0:
            return None
        loops.append((closed - np.outer(entry, feedback), entry, feedback))
        modes += np.abs(poles).tolist()
    frequencies = np.geomspace(min(modes) / BEYOND, max(modes) * BEYOND, POINTS)
    values_at = np.array([[_response(*loop, omega) for omega in frequencies] for loop in loops])
    each = [margins(frequencies, row) for row in values_at]
    least = Margins(*(min(getattr(one, key) for one in each) for key in Margins.__dataclass_fields__))
    return LoopResponse(agent.id, frequencies, values_at, least)


def margins(frequencies: Array, values: Complex) -> Margins:
    """Of a stable loop, from its response on a grid: crossings are interpolated."""
    size, angle = np.log(np.abs(values)), np.unwrap(np.angle(values))
    phase = delay = gain = reduction = np.inf
    for k in np.flatnonzero(np.diff(np.sign(size))):
        share = size[k] / (size[k] - size[k + 1])
        at = angle[k] + share * (angle[k + 1] - angle[k])
        away = abs((at + np.pi + np.pi) % (2 * np.pi) - np.pi)
        omega = frequencies[k] * (frequencies[k + 1] / frequencies[k]) ** share
        phase, lag = min(phase, away), (at + np.pi) % (2 * np.pi)
        delay = min(delay, lag / omega)
    turns = np.floor((angle - np.pi) / (2 * np.pi))  # changes where the negative real axis is crossed
    factors = []
    for k in np.flatnonzero(np.diff(turns)):
        border = (max(turns[k], turns[k + 1]) * 2 + 1) * np.pi
        share = (border - angle[k]) / (angle[k + 1] - angle[k])
        factors.append(np.exp(-(size[k] + share * (size[k + 1] - size[k]))))
    if values[0].real < 0 and abs(values[0].imag) < AT_REST * abs(values[0].real):
        factors.append(1 / abs(values[0]))  # a finite response at rest crosses the axis there
    for factor in factors:
        if factor > 1:
            gain = min(gain, factor)
        else:
            reduction = min(reduction, 1 / factor)
    return Margins(
        float(np.degrees(phase)), float(gain), float(reduction), float(delay), float(np.abs(1 + values).min())
    )


def _corners(agent: Agent) -> Iterator[dict[sympy.Symbol, Fraction]]:
    """The first vertices of ``W``, and its centre."""
    sides = [(side.lo,) if side.is_point else (side.lo, side.hi) for side in agent.parameter_box]
    for number, corner in enumerate(product(*sides)):
        if number == MOST_CORNERS:
            return
        yield dict(zip(agent.parameters, corner, strict=True))


def _value(entry: sympy.Expr, corner: dict[sympy.Symbol, Fraction], optimum: float) -> Fraction:
    known = {name: sympy.Rational(value.numerator, value.denominator) for name, value in corner.items()}
    rest = dict.fromkeys(entry.free_symbols - known.keys() - {COST_VARIABLE}, 0)
    return Fraction(float(entry.xreplace(known).subs({**rest, COST_VARIABLE: optimum})))


def _feedback(agent: Agent, law: AgentController, size: int) -> Array:
    """The row of ``u`` in the states ``(z, x, x̃, η)``."""
    zeros, n = len(agent.zero_states), agent.order
    measured = zeros if n == 1 else zeros + n
    row = np.zeros(size)
    for k, weight in enumerate((*law.gamma, Fraction(1))):
        row[measured + k] = -float(law.K * law.g ** (n - 1 - k) * weight)
    row[measured + n :] = [float(entry) for entry in law.psi]
    return row


def _response(A: Array, b: Array, c: Array, omega: float) -> complex:
    return complex(-(c @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, b)))
