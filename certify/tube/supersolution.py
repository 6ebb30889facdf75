"""Phase 2 and the tail: the comparison system on a time grid (docs/certificate-direct.md sections 5, 6)."""

from __future__ import annotations

from dataclasses import dataclass
from operator import mul

import numpy as np

from certify.tube.direct_ranges import move
from certify.tube.increments import Increments, Ranges, residuals
from certify.tube.kernels import Kernels
from certify.tube.surroundings import Moment, Surroundings

INFLATION = 1.01
DRIVE_MARGIN = 1.001
STEP_MARGIN = 1e-2
SUBSTEPS = 10
FIRST_STEP = 1.0
LARGEST_STEP = 0.2
BENT = 1.2
SHRINK = 0.8
SLACK = 2e-3
TIGHT = 1.01
GUESS = 0.01
PROBES = 60
SMALLEST_STEP_RATIO = 1e-2
GROWTH = 1.3
MOST_STEPS = 1000
LARGEST = 1e6
LATER: tuple[float, ...] = (
    1.0,
    2.0,
    4.0,
)  # time constants of the slowest mode: the tube goes on while a tail from rest would hold
TAIL_SHARES = (0.9, 0.5, 0.2, 0.05, 0.01)  # of the slower of loop and references: less is easier, and settles later

Instants = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Feedback:
    """Float views of the nominal slopes and of the gain that multiplies the input gain's uncertainty."""

    f0: np.ndarray
    f1: np.ndarray
    b: float
    K: float


@dataclass(frozen=True)
class Tube:
    """``grid`` has one entry more than ``boxes``; ``boxes[k]`` bounds the outputs ``z̄, x̄, ϑ̃, υ`` on step ``k``;
    ``ranges[k]`` is where ``z`` is at the end of step ``k``, for as long as that is worth knowing."""

    grid: tuple[float, ...]
    boxes: tuple[np.ndarray, ...]
    ranges: tuple[Ranges, ...]
    tail: np.ndarray
    tail_rate: float

    @property
    def peak(self) -> np.ndarray:
        return np.max([*self.boxes, self.tail], axis=0)


@dataclass(frozen=True)
class TubeFailure:
    """Where the tube could not be continued; ``settled`` if all of it is there but the tail."""

    time: float
    reason: str
    settled: bool = False


class Comparison:
    """``p_ia' = −μ_a p_ia + Σ_j c_ija |q_j|`` with ``|q|`` bounded over boxes."""

    def __init__(self, kernels: Kernels, increments: Increments, feedback: Feedback) -> None:
        self.kernels, self.increments, self.feedback = kernels, increments, feedback
        self.plant = increments.zeros + increments.order
        times = np.append(0.0, np.geomspace(0.1 / kernels.rates[-1], 1 / kernels.rates[0], PROBES))
        self.decays = np.exp(-np.outer(times, kernels.rates))
        low, high = increments.b
        self.gain_error = max(abs(low - feedback.b), abs(high - feedback.b))
        driven, started = np.split(kernels.coefficients, [kernels.inputs], axis=1)
        self._driven, self._started = np.ascontiguousarray(driven.transpose(0, 2, 1)), started
        self._f0, self._f1 = feedback.f0.tolist(), feedback.f1.tolist()
        self._highest = self.decays @ started[self.plant].T

    def start(self, state: np.ndarray) -> np.ndarray:
        return np.einsum("ila,l->ia", self._started, state)

    def highest(self, state: np.ndarray) -> float:
        """An estimate of the largest ``|ϑ̃|`` that ``Y`` leads to by itself."""
        return float((self._highest @ state).max())

    def inputs(self, box: np.ndarray, moment: Moment, known: Ranges = ()) -> np.ndarray:
        """Bounds of ``q_1 … q_nz, q_f, q_y`` over a box of outputs."""
        zeros = self.increments.zeros
        bounds = box.tolist()
        slopes = self.increments.slopes(bounds[:zeros], bounds[zeros : self.plant], moment, known)
        S, s = residuals(slopes, self._f0, self._f1, zeros)
        q = [sum(map(mul, row, bounds)) + extra * moment.deviation for row, extra in zip(S, s, strict=True)]
        q[zeros] += self.gain_error * bounds[self.plant + 1]
        return np.array([*q, moment.rate]) * DRIVE_MARGIN

    def drive(self, q: np.ndarray) -> np.ndarray:
        return self._driven @ q

    def step(
        self, p: np.ndarray, box: np.ndarray, moment: Moment, known: Ranges, instants: Instants
    ) -> tuple[np.ndarray, np.ndarray]:
        """The state after the step and the bounds of the outputs during it, given a box for it and its ``instants``."""
        level = self.drive(self.inputs(box, moment, known)) / self.kernels.rates
        apart = p - level
        left, bends = instants
        sums = level.sum(axis=1)[:, None] + apart @ left.T
        over = (np.maximum(-apart, 0) + STEP_MARGIN * np.abs(apart)) @ bends.T
        reached = (np.maximum(sums[:, :-1], sums[:, 1:]) + over).max(axis=1)
        return level + apart * left[-1], reached

    def instants(self, length: float) -> Instants:
        """``e^{−μ_a τ_k}`` at ``τ_0 = 0, τ_k = Δ 2^{k−SUBSTEPS}``, and how far a rising term is above its chord between
        them."""
        times = length * np.append(0.0, 2.0 ** np.arange(1 - SUBSTEPS, 1))
        left, turns = np.exp(-np.outer(times, self.kernels.rates)), np.outer(np.diff(times), self.kernels.rates)
        return left, left[:-1] * np.minimum(-np.expm1(-turns), turns**2 / 8)


def tube(
    comparison: Comparison,
    surroundings: Surroundings,
    state: np.ndarray,
    known: Ranges,
    begin: float,
    highest: float,
    share: float = 0.0,
) -> Tube | TubeFailure:
    """Boxes from ``begin`` to the end of the coordinator's grid or as far as the tail needs, and the tail; or the time
    at which no box was found. ``state`` bounds ``Y``, ``known`` are ranges of ``z`` at ``begin``; it is given up when
    ``|ϑ̃|`` passes ``highest``. A step may be as long as ``share`` of the time so far, if that is more than the usual
    limit."""
    p = comparison.start(state)
    time, length = begin, FIRST_STEP / float(comparison.kernels.rates.max())
    shortest = length * SMALLEST_STEP_RATIO
    grid = [time]
    boxes: list[np.ndarray] = []
    ranges: list[Ranges] = []
    guess, horizon, later = np.zeros(len(p)), surroundings.horizon, list(LATER)
    while True:
        if time >= horizon:
            tail = _tail(comparison, surroundings, p)
            if not isinstance(tail, str) and (not later or (boxes and np.all(tail[0] <= np.max(boxes, axis=0)))):
                return Tube(tuple(grid), tuple(boxes), tuple(ranges), *tail)
            if isinstance(tail, str) and (
                not later or isinstance(_tail(comparison, surroundings, np.zeros_like(p)), str)
            ):
                return TubeFailure(time, tail, settled=True)
            horizon = time + later.pop(0) / float(comparison.kernels.rates[0])
        if len(boxes) >= MOST_STEPS:
            return TubeFailure(time, f"the increments leave room for steps of {length:.1e} s only")
        length = min(length, max(LARGEST_STEP, share * time), max(horizon - time, shortest) * 1.001)
        length = _short(length)
        found = _box(comparison, p, guess, surroundings.during(time, time + length), known, length)
        if found is None:
            length, guess = length / 2, np.zeros(len(p))
            if length < shortest:
                return TubeFailure(time, "the increments outrun the loop")
            continue
        before, (p, box, known, rounds) = p, found
        boxes.append(box)
        guess = box * (1 + GUESS)
        if known:
            ranges.append(known)
        time = time + length
        grid.append(time)
        if box[comparison.plant] > highest:
            return TubeFailure(time, "the saturation level is passed by far")
        bent = np.any(box > BENT * INFLATION * np.maximum(before.sum(axis=1), p.sum(axis=1)) + 1e-6)
        length *= SHRINK if bent else GROWTH if rounds < 6 else 1.0


def _short(length: float) -> float:
    """A step with 12 significant bits, so that the grid stays short."""
    mantissa, exponent = np.frexp(length)
    return float(np.ldexp(np.floor(mantissa * 4096) / 4096, exponent))


def _box(
    comparison: Comparison, p: np.ndarray, guess: np.ndarray, moment: Moment, known: Ranges, length: float
) -> tuple[np.ndarray, np.ndarray, Ranges, int] | None:
    """The state, the box and the ranges after a step; a box that holds is tried once more as tight as it turned out."""
    box = np.maximum(p.sum(axis=1) * INFLATION, guess) + 1e-9
    instants, held = comparison.instants(length), None
    for rounds in range(60):
        moved = move(comparison.increments, known, box.tolist(), moment, length) if known else None
        ends, during = moved or ((), ())
        following, reached = comparison.step(p, box, moment, during, instants)
        if (reached <= box).all():
            if held is not None or (reached * TIGHT >= box).all():
                return following, box, ends, rounds
            held = following, box, ends, rounds
            box = np.minimum(reached * (1 + SLACK) + 1e-9, box)
        elif held is not None:
            return held
        else:
            box = np.maximum(box, reached * INFLATION)
            if not box.max() <= LARGEST:
                return None
    return None


def _tail(comparison: Comparison, surroundings: Surroundings, p: np.ndarray) -> tuple[np.ndarray, float] | str:
    moment, rates = surroundings.later(), comparison.kernels.rates
    for share in TAIL_SHARES:
        rate = share * min(surroundings.decay, float(rates[0]))
        left = np.maximum(p, 0).sum(axis=1)
        box = left * 1.05 + 1e-9
        for _ in range(200):
            reached = left + (comparison.drive(comparison.inputs(box, moment)) / (rates - rate)).sum(axis=1)
            if np.all(reached <= box):
                return box, rate
            box = np.maximum(box, reached * INFLATION)
            if box.max() > LARGEST:
                break
    return "no tail: the loop gain of the increments is not below one for every phase of the exosystem"
