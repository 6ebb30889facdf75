"""What an agent sees at a time: ranges of the exosystem, the reference and the steady state
(docs/certificate-direct.md section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import product
from math import inf

import numpy as np
import sympy

from certify.agent_model import AgentModel
from certify.bounds.balls import compile_expression
from certify.coordinator.envelope import AgentEnvelope, Envelope
from certify.tube.ranges import FloatProgram, Range, floats, hull, magnitude, meet, widen
from certify.tube.tapes import Tape
from symbolic.plant import COST_VARIABLE, Interval

PARTS = {0: 1, 1: 8, 2: 4}
MANY_PARTS = 2
TAIL_PARTS = {0: 1, 1: 64, 2: 12}
MANY_TAIL_PARTS = 3
MOST_CUT = 6
SAFETY = 1e-9  # of the size of v: what the floats of its flow may be away
AT_ONCE = 1e-12  # relative: two times that floats cannot tell apart
TRAJECTORY_SLACK = Fraction(1, 1000)  # the checker encloses the ranges in its own way


@dataclass(frozen=True)
class Moment:
    """Ranges on one interval of time: ``v``, ``y^r``, ``z*``; ``deviation ≥ |y^r − s*|``, ``rate ≥ |ẏ^r|``."""

    v: tuple[Range, ...]
    reference: Range
    steady: tuple[Range, ...]
    deviation: float
    rate: float


class Surroundings:
    """Moments of one agent, cached: the same intervals come back for many gains."""

    def __init__(self, model: AgentModel, envelope: Envelope, index: int) -> None:
        self.model = model
        self.agent: AgentEnvelope = envelope.agents[index]
        self.times = np.array([float(time) for time in envelope.times])
        self.horizon = float(envelope.horizon)
        self.decay = float(envelope.tail_decay)
        self.optimum = floats(model.optimum)
        self.limits = tuple(floats(side) for side in model.disturbance)
        exosystem = model.exosystem
        self.S = np.array(exosystem.S.tolist(), dtype=float).reshape(len(exosystem.states), len(exosystem.states))
        spectrum, flows = np.linalg.eig(self.S) if len(self.S) else (np.zeros(0), self.S)
        self.spectrum: np.ndarray = spectrum
        self.modes: np.ndarray = flows
        self.inverse_modes = np.linalg.inv(self.modes) if len(self.S) else self.S
        self.sizes = np.array([magnitude(side) for side in self.limits])
        self.curvature = np.abs(self.S @ self.S) @ self.sizes
        ends = [floats(side) for side in exosystem.initial]
        self.centre = np.array([(lo + hi) / 2 for lo, hi in ends])
        self.radius = np.array([(hi - lo) / 2 for lo, hi in ends])
        self.reference = [floats(side) for side in self.agent.reference]
        self.deviation = [float(value) for value in self.agent.deviation]
        self.rate = [float(value) for value in self.agent.rate]
        self.steady = _SteadyRange(model)
        self._known: dict[tuple[float, float], Moment] = {}

    def during(self, start: float, end: float) -> Moment:
        """The moment that covers ``[start, end]``."""
        key = (start, end)
        if key not in self._known:
            v = self._exosystem(start, end)
            reference, deviation, rate = self._reference(start, end)
            self._known[key] = Moment(v, reference, self.steady(v), deviation, rate)
        return self._known[key]

    def later(self) -> Moment:
        """The moment that covers everything after the coordinator's grid."""
        deviation = float(self.agent.tail_deviation)
        reference, steady = widen(self.optimum, deviation), self.steady.later(self.limits)
        return Moment(self.limits, reference, steady, deviation, float(self.agent.tail_rate))

    def at_start(self) -> Moment:
        """The moment ``t = 0`` itself."""
        v = tuple(floats(side) for side in self.model.exosystem.initial)
        moment = self.during(0.0, float(self.times[1]))
        return Moment(v, floats(self.model.agent.initial.reference), self.steady(v), moment.deviation, moment.rate)

    def _exosystem(self, start: float, end: float) -> tuple[Range, ...]:
        if not len(self.S):
            return ()
        (low, high), (later_low, later_high) = self._flow(start), self._flow(end)
        low, high = np.minimum(low, later_low), np.maximum(high, later_high)
        bend = (end - start) ** 2 / 8 * self.curvature
        sides = zip((low - bend).tolist(), (high + bend).tolist(), self.limits, strict=True)
        return tuple((max(lo, limit[0]), min(hi, limit[1])) for lo, hi, limit in sides)

    def _flow(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        flow = ((self.modes * np.exp(self.spectrum * time)) @ self.inverse_modes).real
        middle, spread = flow @ self.centre, np.abs(flow) @ self.radius + SAFETY * self.sizes
        return middle - spread, middle + spread

    def _reference(self, start: float, end: float) -> tuple[Range, float, float]:
        first = max(int(np.searchsorted(self.times, start * (1 - AT_ONCE), side="right")) - 1, 0)
        last = int(np.searchsorted(self.times, end * (1 + AT_ONCE), side="left"))
        inside = slice(min(first, len(self.rate)), min(last, len(self.rate)))
        reference, deviation, rate = (inf, -inf), 0.0, 0.0
        for side, distance, speed in zip(
            self.reference[inside], self.deviation[inside], self.rate[inside], strict=True
        ):
            reference, deviation, rate = hull(reference, side), max(deviation, distance), max(rate, speed)
        if last > len(self.rate):
            later = widen(self.optimum, float(self.agent.tail_deviation))
            reference = hull(reference, later)
            deviation, rate = max(deviation, float(self.agent.tail_deviation)), max(rate, float(self.agent.tail_rate))
        return reference, deviation, rate


class _SteadyRange:
    """The range of ``z*`` over ``s``, ``v`` and the parameters, these cut into parts where they occur."""

    def __init__(self, model: AgentModel) -> None:
        self.model = model
        symbols = (COST_VARIABLE, *model.exosystem.states, *model.agent.parameters)
        self.programs = [FloatProgram(compile_expression(component, symbols)) for component in model.steady_state]
        self.optimum = floats(model.optimum)
        self.tapes = [
            [self._tape(program, parameters) for parameters in self._parts(PARTS, MANY_PARTS)]
            for program in self.programs
        ]
        self.slopes = [
            [FloatProgram(compile_expression(sympy.diff(component, v), symbols)) for v in model.exosystem.states]
            for component in model.steady_state
        ]
        self.extent = np.array([[float(entry) for entry in row] for row in model.extent])
        self._later: dict[tuple[Range, ...], tuple[Range, ...]] = {}

    def __call__(self, v: tuple[Range, ...]) -> tuple[Range, ...]:
        return tuple(reduce(hull, [tape(v) for tape in parts]) for parts in self.tapes)

    def later(self, v: tuple[Range, ...]) -> tuple[Range, ...]:
        """For all phases of the exosystem: also ``|z*(v) − z*(0)| ≤ √(gᵀ extent g)`` with the slopes ``g`` in ``v``."""
        if v not in self._later:
            parts = self._parts(TAIL_PARTS, MANY_TAIL_PARTS)
            self._later[v] = tuple(
                reduce(hull, (self._around(k, v, parameters) for parameters in parts))
                for k in range(len(self.programs))
            )
        return self._later[v]

    def _tape(self, program: FloatProgram, parameters: tuple[Range, ...]) -> Tape:
        """A component as a function of ``v``."""
        inputs = len(self.model.exosystem.states)
        return program.enclosure(inputs, [self.optimum, *range(inputs), *parameters])

    def _around(self, k: int, v: tuple[Range, ...], parameters: tuple[Range, ...]) -> Range:
        whole = self.programs[k].enclose([self.optimum, *v, *parameters])
        middle = self.programs[k].enclose([self.optimum, *[(0.0, 0.0)] * len(v), *parameters])
        g = np.array([magnitude(slope.enclose([self.optimum, *v, *parameters])) for slope in self.slopes[k]])
        return meet(whole, widen(middle, float(np.sqrt(g @ np.abs(self.extent) @ g)) if len(g) else 0.0))

    def _parts(self, counts: dict[int, int], many: int) -> list[tuple[Range, ...]]:
        agent = self.model.agent
        free = {x for component in self.model.steady_state for x in component.free_symbols}
        used = [k for k, name in enumerate(agent.parameters) if name in free and not agent.parameter_box[k].is_point]
        used = sorted(used, key=lambda k: str(agent.parameters[k]))[:MOST_CUT]
        parts = counts.get(len(used), many)
        choices = [_cut(box, parts if k in used else 1) for k, box in enumerate(agent.parameter_box)]
        return [tuple(floats(side) for side in choice) for choice in product(*choices)]


def _cut(box: Interval, parts: int) -> list[Interval]:
    width = (box.hi - box.lo) / parts
    return [Interval(box.lo + k * width, box.lo + (k + 1) * width) for k in range(parts)] if parts > 1 else [box]


def steady_trajectory_range(model: AgentModel) -> np.ndarray:
    """Magnitudes of ``η̄(0) = η(0) − Tτ(0)`` on the initial set, from the ranges of each ``τ_k`` as in the rule."""
    from certify.bounds.suprema import range_bound

    im = model.internal_model
    eta = model.agent.initial.eta.magnitude
    tau = [range_bound(entry, model.initial_exogenous_box).interval for entry in im.tau]
    return np.array([float((eta + _combined(row, tau)) * (1 + TRAJECTORY_SLACK)) for row in im.T])


def _combined(factors: Sequence[Fraction], ranges: Sequence[Interval]) -> Fraction:
    """The largest ``|Σ_k factor_k x_k|`` over independent ``x_k``."""
    ends = [sorted((t * side.lo, t * side.hi)) for t, side in zip(map(Fraction, factors), ranges, strict=True)]
    low, high = (sum((pair[end] for pair in ends), Fraction(0)) for end in (0, 1))
    return max(-low, high)
