"""Phase 1: the observer peaks and the saturated feedback brings ``ϑ`` down (docs/certificate-direct.md section 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from certify.agent_model import AgentModel
from certify.tube.direct_ranges import move
from certify.tube.increments import Increments, Ranges, Slopes
from certify.tube.observer_error import ObserverError
from certify.tube.ranges import magnitude
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

    z: np.ndarray
    x: np.ndarray
    vartheta: float
    zeta: np.ndarray

    def covers(self, other: Magnitudes) -> bool:
        return bool(np.all(self.flat >= other.flat))

    @property
    def flat(self) -> np.ndarray:
        return np.concatenate([self.z, self.x, [self.vartheta], self.zeta])

    def larger(self, other: Magnitudes, factor: float = 1.0) -> Magnitudes:
        pairs = ((self.z, other.z), (self.x, other.x), (self.zeta, other.zeta))
        z, x, zeta = (np.maximum(a, b) * factor + 1e-9 for a, b in pairs)
        return Magnitudes(z, x, max(self.vartheta, other.vartheta) * factor + 1e-9, zeta)


@dataclass(frozen=True)
class Instant:
    """The state of the comparison system of phase 1; ``speed`` bounds ``|ẋ_n|`` up to now."""

    time: float
    state: Magnitudes
    speed: float
    known: Ranges


@dataclass(frozen=True)
class Reached:
    """``grid[0] = 0``, ``boxes[k]`` holds on step ``k``, ``ends[k]`` bounds ``|ϑ|`` and ``ranges[k]`` ``z`` after it;
    ``start`` bounds ``Y`` at the end of the grid."""

    grid: tuple[float, ...]
    boxes: tuple[Magnitudes, ...]
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
        self.theta, self.K, self.delta, self.nominal_b, self.error = theta, K, delta, nominal_b, error
        im = increments.model.internal_model
        self.psi, self.N, self.b, self.order = np.abs(_row(im.psi)), _row(im.N), increments.b, increments.order
        M = np.array([[float(x) for x in row] for row in im.M]).reshape(len(self.N), len(self.N))
        self.M, self.MN, self.psi_N = np.abs(M), M @ self.N, float(_row(im.psi) @ self.N)

    def run(self, left: Callable[[np.ndarray], float], time_constant: float) -> Reached | Stuck:
        """Steps until ``left`` of the state, the bound of ``|ϑ̃|`` that phase 2 would start with, is least.

        ``time_constant`` sets the length of the first step.
        """
        now = Instant(0.0, self._begin(), 0.0, self.initial.ranges)
        remains, since = left(self.start(now)), 0
        best, best_left = self._reached([now], []), remains
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
                best, best_left = self._reached(instants, boxes), remains
        if best_left > level:
            reason = (
                f"with the saturation level delta = {self.delta:.4g} the feedback stays saturated: "
                f"|ϑ| falls to {best_left:.3g}, not to delta/K = {level:.3g}"
            )
            return Stuck(reason, best_left)
        return best

    def start(self, now: Instant) -> np.ndarray:
        """Bounds of ``Y = (z̄, x̄_1 … x̄_(n−1), ϑ, ζ₀, e)``, ``ζ₀ = η̄ − N x̄_n/b₀``."""
        state = now.state
        apart = max(abs(1 / side - 1 / self.nominal_b) for side in self.b)
        zeta = state.zeta + np.abs(self.N) * apart * state.x[-1]
        if self.error is None:
            error = np.zeros(0)
        else:
            error = self.error.at(now.time, now.speed) if now.time > 0 else self.error.initial
        return np.concatenate([state.z, state.x[:-1], [state.vartheta], zeta, error * MARGIN])

    def _begin(self) -> Magnitudes:
        initial = self.initial
        zeta = initial.eta + np.abs(self.N) * initial.x[-1] / self.b[0]
        return Magnitudes(initial.z, initial.x, float(self.theta @ initial.x), zeta)

    def _reached(self, instants: list[Instant], boxes: list[Magnitudes]) -> Reached:
        now = instants[-1]
        return Reached(
            tuple(item.time for item in instants),
            tuple(boxes),
            tuple(item.state.vartheta for item in instants[1:]),
            tuple(item.known for item in instants[1:] if item.known),
            self.start(now),
            now.known,
        )

    def _step(self, now: Instant, length: float) -> tuple[Instant, Magnitudes] | None:
        moment = self.surroundings.during(0.0, 2.0 ** np.ceil(np.log2(now.time + length)))
        box = now.state.larger(now.state, INFLATION)
        for _ in range(ROUNDS):
            ends, needed = self._rates(now, box, moment, length)
            if box.covers(needed):
                return ends, box
            box = box.larger(needed, INFLATION)
            if not np.all(np.isfinite(box.flat)) or box.flat.max() > LARGEST:
                return None
        return None

    def _rates(self, now: Instant, box: Magnitudes, moment: Moment, length: float) -> tuple[Instant, Magnitudes]:
        """The state after a step in ``box``, and the box that the step needs."""
        state, n = now.state, self.order
        plant = np.concatenate([box.z, box.x])
        moved = move(self.increments, now.known, plant, moment, length) if now.known else None
        known, during = moved or ((), ())
        slopes = self.increments.slopes(box.z, box.x, moment, during)
        internal = self.b[1] * float(self.psi @ box.zeta)
        last = np.append(np.zeros(n - 1), self.psi_N)  # Ψη̄ = Ψζ + ΨN x̄_n/b
        rise = self._slope_bound(slopes, box, moment, 1.0, last) + internal
        shifted = np.append(0.0, self.theta[:-1]) + last
        against = self._slope_bound(slopes, box, moment, 1.0, shifted) + internal + self.theta[0] * moment.rate
        speed, missed, u = self._error(now, box, rise)
        vartheta = self._fall(state.vartheta, against * MARGIN, missed, length)

        x_rate = np.append(box.x[1:], rise + self.b[1] * u)
        if n > 1:  # x̄_(n−1)' = ϑ − Σ_(k<n) θ_k x̄_k as well
            inward = box.vartheta + float(self.theta[:-2] @ box.x[:-2]) - float(self.theta[-2] * state.x[-2])
            x_rate[-2] = min(x_rate[-2], max(inward, 0.0))
        x_rate[0] += moment.rate
        z_rate = [
            sum(magnitude(side) * bound for side, bound in zip(row, plant, strict=False))
            + magnitude(row[-1]) * moment.deviation
            for row in slopes.f0
        ]
        zeta_rate = self.M @ box.zeta + [
            (self._slope_bound(slopes, box, moment, -N, shift) + (abs(N) * moment.rate if n == 1 else 0.0)) / self.b[0]
            for N, shift in zip(self.N, np.outer(self.MN, np.append(np.zeros(n - 1), 1.0)), strict=True)
        ]
        z = state.z + length * MARGIN * np.array(z_rate)
        x = state.x + length * MARGIN * x_rate
        zeta = state.zeta + length * MARGIN * np.array(zeta_rate)
        inside = min(x[-1], box.vartheta + float(self.theta[:-1] @ box.x[:-1]))
        needed = Magnitudes(z, np.append(x[:-1], inside), max(state.vartheta, vartheta), zeta)
        x[-1] = min(x[-1], vartheta + float(self.theta[:-1] @ x[:-1]))
        return Instant(now.time + length, Magnitudes(z, x, vartheta, zeta), speed, known), needed

    def _slope_bound(self, slopes: Slopes, box: Magnitudes, moment: Moment, scale: float, shift: np.ndarray) -> float:
        """A bound of ``|scale·Δf + shift·x̄|``."""
        zeros = self.increments.zeros
        along = [magnitude((scale * lo, scale * hi)) * bound for (lo, hi), bound in zip(slopes.f1, box.z, strict=False)]
        for (lo, hi), extra, bound in zip(slopes.f1[zeros:], shift, box.x, strict=True):
            along.append(magnitude((scale * lo + extra, scale * hi + extra)) * bound)
        return sum(along) + abs(scale) * magnitude(slopes.f1[zeros]) * moment.deviation

    def _error(self, now: Instant, box: Magnitudes, drift: float) -> tuple[float, float, float]:
        """The largest ``|ẋ_n|`` so far, ``ε ≥ |E2 e|`` and ``|ū|`` during a step; ``drift`` bounds ``|ẋ_n − bū|``."""
        u, speed, missed = self.delta, 0.0, 0.0
        for _ in range(2):
            speed = max(now.speed, (drift + self.b[1] * u) * MARGIN)
            missed = 0.0 if self.error is None else self.error.missed(now.time, speed) * MARGIN
            u = min(self.delta, self.K * (box.vartheta + missed))
        return speed, missed, u

    def _fall(self, vartheta: float, against: float, missed: float, length: float) -> float:
        """The least end of a straight line from ``vartheta`` that is above ``|ϑ|' ≤ against − b sat_δ(K(|ϑ| − ε))``."""

        def speed(at: float) -> float:
            push = min(max(self.K * (at - missed), -self.delta), self.delta)
            return against - (self.b[0] if push > 0 else self.b[1]) * push

        if speed(vartheta) >= 0:
            return vartheta + length * speed(vartheta)
        low, high = 0.0, vartheta
        for _ in range(40):
            middle = (low + high) / 2
            if middle - vartheta >= length * speed(middle):
                high = middle
            else:
                low = middle
        return high * (1 + 1e-9)


def _row(entries: tuple[Fraction, ...]) -> np.ndarray:
    return np.array([float(x) for x in entries])


def _short(length: float) -> float:
    """A step with 12 significant bits."""
    mantissa, exponent = np.frexp(length)
    return float(np.ldexp(np.floor(mantissa * 4096) / 4096, exponent))
