"""Phase 1: the observer peaks and the saturated feedback brings ``ϑ`` down (docs/certificate-direct.md section 4)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, isfinite, log2
from operator import ge, mul

import numpy as np

from certify.agent_model import AgentModel
from certify.tube.direct_ranges import move
from certify.tube.increments import Increments, Ranges, Slopes
from certify.tube.observer_error import ObserverError
from certify.tube.ranges import Range, magnitude
from certify.tube.surroundings import Moment, Surroundings, steady_trajectory_range

INFLATION = 1.05
MARGIN = 1.0005
ROUNDS = 30
FIRST_STEP = 0.25
GROWTH = 1.07
MOST_STEPS = 200
PATIENCE = 8
FALLING = 0.998
ENOUGH = 0.3
LARGEST = 1e9
ROUNDING = 1e-12


@dataclass(frozen=True)
class InitialMagnitudes:
    """``|z̄(0)|, |x̄(0)|, |η̄(0)|``, ``|x_k(0) − x̃_k(0)|`` and the ranges of ``z(0)`` over the initial set."""

    z: np.ndarray
    x: np.ndarray
    eta: np.ndarray
    estimate: np.ndarray
    ranges: Ranges


def initial_magnitudes(model: AgentModel, surroundings: Surroundings) -> InitialMagnitudes:
    start, agent = surroundings.at_start(), model.agent
    ranges = tuple((float(side.lo), float(side.hi)) for side in agent.initial.z)
    z = [max(abs(hi - steady[0]), abs(lo - steady[1])) for (lo, hi), steady in zip(ranges, start.steady, strict=True)]
    x = [float(side.magnitude) for side in agent.initial.x]
    first, reference = agent.initial.x[0], agent.initial.reference
    x[0] = float(max(abs(first.hi - reference.lo), abs(first.lo - reference.hi)))
    if agent.initial.observer is None:
        estimate = [0.0, *(float(side.magnitude) for side in agent.initial.x[1:])]
    else:
        pairs = zip(agent.initial.x, agent.initial.observer, strict=True)
        estimate = [float(max(abs(a.hi - o.lo), abs(a.lo - o.hi))) for a, o in pairs]
    return InitialMagnitudes(np.array(z), np.array(x), steady_trajectory_range(model), np.array(estimate), ranges)


@dataclass(frozen=True)
class Magnitudes:
    """Bounds of ``|z̄|, |x̄|, |ϑ|`` and ``|ζ|`` with ``ζ = η̄ − N x̄_n/b``."""

    z: tuple[float, ...]
    x: tuple[float, ...]
    vartheta: float
    zeta: tuple[float, ...]

    def covers(self, other: Magnitudes) -> bool:
        return all(map(ge, self.flat, other.flat))

    @property
    def flat(self) -> tuple[float, ...]:
        return (*self.z, *self.x, self.vartheta, *self.zeta)

    def larger(self, other: Magnitudes, factor: float = 1.0) -> Magnitudes:
        pairs = ((self.z, other.z), (self.x, other.x), (self.zeta, other.zeta))
        z, x, zeta = (tuple([max(a, b) * factor + 1e-9 for a, b in zip(*pair, strict=True)]) for pair in pairs)
        return Magnitudes(z, x, max(self.vartheta, other.vartheta) * factor + 1e-9, zeta)


@dataclass(frozen=True)
class Instant:
    """The state of the comparison system of phase 1; ``speed`` bounds ``|ẋ_n|`` up to now, ``push`` ``|ū|`` on the
    step that ends here."""

    time: float
    state: Magnitudes
    speed: float
    known: Ranges
    push: float = 0.0


@dataclass(frozen=True)
class Reached:
    """``grid[0] = 0``, ``boxes[k]`` holds on step ``k`` and ``pushes[k]`` bounds ``|ū|`` on it, ``vartheta[k]`` bounds
    ``|ϑ|`` and ``ranges[k]`` ``z`` after it; ``start`` bounds ``Y`` at the end of the grid."""

    grid: tuple[float, ...]
    boxes: tuple[Magnitudes, ...]
    pushes: tuple[float, ...]
    vartheta: tuple[float, ...]
    ranges: tuple[Ranges, ...]
    start: np.ndarray
    known: Ranges

    @property
    def duration(self) -> float:
        return self.grid[-1]


@dataclass(frozen=True)
class Stuck:
    """Phase 1 does not end; ``vartheta`` is the least bound of ``|ϑ̃|`` that was reached."""

    reason: str
    vartheta: float


class Reaching:
    """Phase 1 of one agent for given ``g, K, δ``; ``error`` is ``None`` for ``n = 1``, where nothing is estimated."""

    def __init__(
        self,
        increments: Increments,
        surroundings: Surroundings,
        initial: InitialMagnitudes,
        theta: np.ndarray,
        K: float,
        delta: float,
        nominal_b: float,
        error: ObserverError | None,
    ) -> None:
        self.increments, self.surroundings, self.initial = increments, surroundings, initial
        self.theta: list[float] = theta.tolist()
        self.K, self.delta, self.error = K, delta, error
        im = increments.model.internal_model
        self.b, self.order = increments.b, increments.order
        self.psi, self.N = [abs(float(entry)) for entry in im.psi], [float(entry) for entry in im.N]
        self.M = [[abs(float(entry)) for entry in row] for row in im.M]
        self.MN = [float(sum(map(mul, row, im.N), Fraction(0))) for row in im.M]
        self.psi_N = float(sum(map(mul, im.psi, im.N), Fraction(0)))
        self.apart = max(abs(1 / side - 1 / nominal_b) for side in self.b)

    def run(self, left: Callable[[np.ndarray], float], time_constant: float) -> Reached | Stuck:
        """Steps until ``left`` of the state, the bound of ``|ϑ̃|`` that phase 2 would start with, is least.

        ``time_constant`` sets the length of the first step.
        """
        now = Instant(0.0, self._begin(), 0.0, self.initial.ranges)
        remains, since = left(self.start(now)), 0
        best, best_left = 0, remains
        instants, boxes, length = [now], [], FIRST_STEP * time_constant
        level = self.delta / self.K
        for _ in range(MOST_STEPS):
            if best_left <= ENOUGH * level or since > PATIENCE:
                break
            length = _short(length)
            found = self._step(now, length)
            if found is None:
                break
            now, box = found
            instants.append(now)
            boxes.append(box)
            length *= GROWTH
            before, remains = remains, left(self.start(now))
            since = 0 if remains < FALLING * before else since + 1
            if remains < best_left:
                best, best_left = len(boxes), remains
        if best_left > level:
            return Stuck("the feedback stays saturated", best_left)
        return self._reached(instants[: best + 1], boxes[:best])

    def start(self, now: Instant) -> np.ndarray:
        """Bounds of ``Y = (z̄, x̄_1 … x̄_(n−1), ϑ, ζ₀, e)``, ``ζ₀ = η̄ − N x̄_n/b₀``."""
        state = now.state
        zeta = [bound + abs(N) * self.apart * state.x[-1] for bound, N in zip(state.zeta, self.N, strict=True)]
        known = [*state.z, *state.x[:-1], state.vartheta, *zeta]
        if self.error is None:
            return np.array(known)
        error = self.error.at(now.time, now.speed) if now.time > 0 else self.error.initial
        return np.concatenate([known, error * MARGIN])

    def _begin(self) -> Magnitudes:
        x = self.initial.x.tolist()
        zeta = [eta + abs(N) * x[-1] / self.b[0] for eta, N in zip(self.initial.eta.tolist(), self.N, strict=True)]
        return Magnitudes(tuple(self.initial.z.tolist()), tuple(x), _dot(self.theta, x), tuple(zeta))

    def _reached(self, instants: list[Instant], boxes: list[Magnitudes]) -> Reached:
        now = instants[-1]
        return Reached(
            tuple(item.time for item in instants),
            tuple(boxes),
            tuple(item.push for item in instants[1:]),
            tuple(item.state.vartheta for item in instants[1:]),
            tuple(item.known for item in instants[1:] if item.known),
            self.start(now),
            now.known,
        )

    def _step(self, now: Instant, length: float) -> tuple[Instant, Magnitudes] | None:
        moment = self.surroundings.during(0.0, 2.0 ** ceil(log2(now.time + length)))
        box = now.state.larger(now.state, INFLATION)
        for _ in range(ROUNDS):
            ends, needed = self._rates(now, box, moment, length)
            if box.covers(needed):
                return ends, box
            box = box.larger(needed, INFLATION)
            if not all(map(isfinite, box.flat)) or max(box.flat) > LARGEST:
                return None
        return None

    def _rates(self, now: Instant, box: Magnitudes, moment: Moment, length: float) -> tuple[Instant, Magnitudes]:
        """The state after a step in ``box``, and the box that the step needs."""
        state, theta, wide = now.state, self.theta, length * MARGIN
        moved = move(self.increments, now.known, (*box.z, *box.x), moment, length) if now.known else None
        known, during = moved or ((), ())
        slopes = self.increments.slopes(box.z, box.x, moment, during)
        sizes, last = [magnitude(side) for side in slopes.f1], slopes.f1[-1]
        internal = self.b[1] * _dot(self.psi, box.zeta)
        still = sizes[self.increments.zeros] * moment.deviation
        others = still + _dot(sizes, (*box.z, *box.x[:-1]))  # of |Δf|, all but what x̄_n adds
        rise = others + _shifted(last, 1.0, self.psi_N) * box.x[-1] + internal  # Ψη̄ = Ψζ + ΨN x̄_n/b
        against = still + _dot(sizes, box.z) + self._along_vartheta(slopes, box) + internal + theta[0] * moment.rate
        speed, missed, u = self._error(now, box, rise)
        vartheta = self._fall(state.vartheta, against * MARGIN, missed, length)

        zeta_rate = [
            _dot(row, box.zeta) + (abs(N) * others + _shifted(last, -N, MN) * box.x[-1]) / self.b[0]
            for row, N, MN in zip(self.M, self.N, self.MN, strict=True)
        ]
        if self.order == 1:
            zeta_rate = [a + abs(N) * moment.rate / self.b[0] for a, N in zip(zeta_rate, self.N, strict=True)]
        z = _along(state.z, wide, self._zero_rates(slopes, box, moment))
        x = _along(state.x, wide, self._x_rates(state, box, moment, rise + self.b[1] * u))
        zeta = tuple(_along(state.zeta, wide, zeta_rate))
        inside = min(x[-1], box.vartheta + _dot(theta[:-1], box.x))
        needed = Magnitudes(tuple(z), (*x[:-1], inside), max(state.vartheta, vartheta), zeta)
        end = min(x[-1], vartheta + _dot(theta[:-1], x))
        return Instant(now.time + length, Magnitudes(tuple(z), (*x[:-1], end), vartheta, zeta), speed, known, u), needed

    def _zero_rates(self, slopes: Slopes, box: Magnitudes, moment: Moment) -> list[float]:
        bounds = (*box.z, box.x[0])
        return [_dot(map(magnitude, row), bounds) + magnitude(row[-1]) * moment.deviation for row in slopes.f0]

    def _x_rates(self, state: Magnitudes, box: Magnitudes, moment: Moment, last: float) -> list[float]:
        rates = [*box.x[1:], last]
        if self.order > 1:  # x̄_(n−1)' = ϑ − Σ_(k<n) θ_k x̄_k as well
            inward = box.vartheta + _dot(self.theta[:-2], box.x) - self.theta[-2] * state.x[-2]
            rates[-2] = min(rates[-2], max(inward, 0.0))
        rates[0] += moment.rate
        return rates

    def _along_vartheta(self, slopes: Slopes, box: Magnitudes) -> float:
        """A bound of what ``x̄`` adds to ``|ϑ' − bū|``."""
        shifts = [0.0, *self.theta[:-1]]
        shifts[-1] += self.psi_N
        sides = zip(slopes.f1[self.increments.zeros :], shifts, box.x, strict=True)
        return sum([_shifted(side, 1.0, shift) * most for side, shift, most in sides])

    def _error(self, now: Instant, box: Magnitudes, drift: float) -> tuple[float, float, float]:
        """The largest ``|ẋ_n|`` so far, ``ε ≥ |E2 e|`` and ``|ū|`` during a step; ``drift`` bounds ``|ẋ_n − bū|``."""
        u, speed, missed = self.delta, 0.0, 0.0
        for _ in range(2):
            speed = max(now.speed, (drift + self.b[1] * u) * MARGIN)
            missed = 0.0 if self.error is None else self.error.missed(now.time, speed) * MARGIN
            u = min(self.delta, self.K * (box.vartheta + missed))
        return speed, missed, u

    def _fall(self, vartheta: float, against: float, missed: float, length: float) -> float:
        """The least end of a straight line from ``vartheta`` that is above ``|ϑ|' ≤ against − b sat_δ(K(|ϑ| − ε))``.

        Where it falls, it is the root of a piecewise linear function that grows.
        """
        push = min(max(self.K * (vartheta - missed), -self.delta), self.delta)
        rate = against - (self.b[0] if push > 0 else self.b[1]) * push
        if rate >= 0:
            return vartheta + length * rate
        free = vartheta + length * against
        b = self.b[0] if free >= missed else self.b[1]
        end = (free + length * b * self.K * missed) / (1 + length * b * self.K)
        if abs(self.K * (end - missed)) > self.delta:
            end = free - length * b * (self.delta if end > missed else -self.delta)
        return (max(end, 0.0) + ROUNDING * vartheta) * (1 + 1e-9)


def _dot(first: Iterable[float], second: Iterable[float]) -> float:
    """Over as many as both have."""
    return sum(map(mul, first, second), 0.0)


def _shifted(side: Range, scale: float, shift: float) -> float:
    """``|scale·D + shift|`` over the range of ``D``."""
    return max(abs(scale * side[0] + shift), abs(scale * side[1] + shift))


def _along(start: Iterable[float], length: float, rates: Iterable[float]) -> list[float]:
    return [at + length * rate for at, rate in zip(start, rates, strict=True)]


def _short(length: float) -> float:
    """A step with 12 significant bits."""
    mantissa, exponent = np.frexp(length)
    return float(np.ldexp(np.floor(mantissa * 4096) / 4096, exponent))
