"""One trial of given gains: loop, modes, kernels, reaching phase, tube; the saturation level follows
(docs/certificate-direct.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from certify.agent_model import AgentModel
from certify.coordinator.envelope import Envelope
from certify.float_range import BeyondFloatsError, float_range
from certify.recipe.matrices import observer_matrix
from certify.tube.increments import Increments, Slopes
from certify.tube.kernels import Kernels, kernels
from certify.tube.loop import LoopGains, Nominal, nominal_loop
from certify.tube.modes import Modes, modes
from certify.tube.observer_error import ObserverDecay, ObserverError, observer_decay
from certify.tube.ranges import Range
from certify.tube.reaching import InitialMagnitudes, Reached, Reaching, Stuck, initial_magnitudes
from certify.tube.supersolution import Comparison, Feedback, Tube, TubeFailure, tube
from certify.tube.surroundings import Surroundings

NOMINAL_BITS = 8
DELTA_MARGIN = 1.12
DELTA_GROWTH = 1.4
NEARLY = 0.6
FAR = 3.0
LARGEST_GAIN = Fraction(10) ** 15
DELTA_ROUNDS = 16
TIGHTENINGS = 3  # halvings of the logarithm of a factor of two: to within 9 %
WAY_SHARE = 1 / 8  # of the reference's way, which is a unit of ϑ where agents start at rest
PROGRESS = 1.02  # ratio of times of escape below which a higher saturation level is no help
FIRST_LEVEL = 1 / 16
LARGEST_LEVEL = 20
COARSE = (1 / 12, 1 / 16, 1 / 24, 1 / 32)  # steps of the tube, as shares of the time so far
BLURRED, LATER, LARGER_TAIL = 1 + 1 / 64, 1.1, 2.0
SETTLED = (1 / 10, 1 / 100)


@dataclass(frozen=True)
class Trial:
    """Everything a certificate needs about one agent, in floats except what the claim and the proof fix exactly."""

    model: AgentModel
    gains: LoopGains
    delta: Fraction
    nominal: Nominal
    modes: Modes
    kernels: Kernels
    reached: Reached
    tube: Tube

    @property
    def needed(self) -> float:
        """``K`` times the largest ``|ϑ̃|`` after the first phase, which ``δ`` must not be below."""
        return float(self.gains.K) * float(self.tube.peak[-2])

    @property
    def fits(self) -> bool:
        """The saturation is not active after the first phase."""
        return self.needed * (1 + 1e-9) <= float(self.delta)


@dataclass(frozen=True)
class TrialFailure:
    """The block that fails for these gains; ``escape`` is the time at which the tube grew out of bounds, if it did."""

    gains: LoopGains
    reason: str
    escape: float | None = None


@dataclass(frozen=True)
class _Missed:
    """Why a saturation level does not do, one that might, and the time that the tube reached if it began."""

    reason: str
    next_level: float
    time: float | None = None
    escape: float | None = None


@dataclass(frozen=True)
class _Loop:
    """What does not depend on the saturation level; ``furthest`` is the unit of saturation levels."""

    gains: LoopGains
    modes: Modes
    comparison: Comparison
    furthest: float


class AgentTrials:
    """Trials of one agent's gains; what does not depend on the gains is prepared once."""

    def __init__(self, model: AgentModel, envelope: Envelope, index: int) -> None:
        self.model = model
        self.surroundings = Surroundings(model, envelope, index)
        self.increments = Increments(model)
        self.initial: InitialMagnitudes = initial_magnitudes(model, self.surroundings)
        self.nominal = _nominal(self.increments, self.surroundings)
        self.observer: ObserverDecay | None = None
        if model.order > 1:
            self.observer = observer_decay(observer_matrix(model.observer))

    def attempt(
        self, gains: LoopGains, delta: Fraction | None = None, like: Trial | None = None
    ) -> Trial | TrialFailure:
        """Try one set of gains. A ``delta`` that is left free is the least that does, to within a factor of two; the
        search for it begins at the share of ``K |ϑ(0)|`` that did in the trial ``like``."""
        if max(gains.g if self.model.order > 1 else 0, gains.K, gains.h or 0, delta or 0) > LARGEST_GAIN:
            return TrialFailure(gains, f"gains above {float(LARGEST_GAIN):.0e} are beyond the search's floats")
        try:
            with float_range():
                return self._attempt(gains, delta, like)
        except BeyondFloatsError as obstacle:
            return TrialFailure(gains, str(obstacle))

    def _attempt(self, gains: LoopGains, delta: Fraction | None, like: Trial | None) -> Trial | TrialFailure:
        loop = self.loop(gains)
        if isinstance(loop, TrialFailure):
            return loop
        if delta is not None:
            result = self.at(loop, delta)
            return TrialFailure(gains, result.reason, result.escape) if isinstance(result, _Missed) else result
        share = FIRST_LEVEL if like is None else max(FIRST_LEVEL, float(like.delta) / self._furthest(like.gains))
        return self._least_level(loop, share)

    def tightened(self, trial: Trial) -> Trial:
        """The same gains with a saturation level that is less by up to a factor of two, if one does."""
        loop = _Loop(trial.gains, trial.modes, self._comparison(trial), self._furthest(trial.gains))
        high, low = float(trial.delta), float(trial.delta) / 2
        for _ in range(TIGHTENINGS):
            middle = _short_up(float(np.sqrt(low * high)))
            result = self.at(loop, middle)
            if isinstance(result, Trial):
                trial, high = result, float(middle)
            else:
                low = float(middle)
        return trial

    def coarsened(self, trial: Trial) -> Trial:
        """The same claim with fewer steps in the tube, so that it is checked sooner, if the bounds hardly suffer."""
        reached, comparison, found = trial.reached, self._comparison(trial), [trial]
        for share in COARSE:
            result = self._tube(comparison, reached, trial.delta, trial.gains, share)
            if isinstance(result, Tube) and as_good(result, trial.tube):
                found.append(replace(trial, tube=result))
        return min((one for one in found if one.fits), key=lambda one: len(one.tube.boxes))

    def _least_level(self, loop: _Loop, share: float) -> Trial | TrialFailure:
        """Upwards to a saturation level that does, or downwards by halves from one."""
        level, reason, escape = share * loop.furthest, "", None
        times = [0.0, 0.0]
        for _ in range(DELTA_ROUNDS):
            result = self.at(loop, _short_up(level))
            if isinstance(result, Trial):
                return self._halved(loop, result) if not reason else result
            level, reason, escape = result.next_level, result.reason, result.escape
            if result.time is not None:
                times.append(result.time)
                if result.time <= times[-2] or result.time < PROGRESS * times[-3]:
                    break
            if level > LARGEST_LEVEL * loop.furthest:
                break
        return TrialFailure(loop.gains, reason, escape)

    def _halved(self, loop: _Loop, trial: Trial) -> Trial:
        while trial.delta / 2 > FIRST_LEVEL * loop.furthest:
            result = self.at(loop, trial.delta / 2)
            if isinstance(result, _Missed):
                break
            trial = result
        return trial

    def loop(self, gains: LoopGains) -> _Loop | TrialFailure:
        loop = nominal_loop(self.model, gains, self.nominal)
        found = modes(loop)
        if found is None:
            return TrialFailure(gains, "the nominal loop is not stable")
        majorants = kernels(found, len(loop.columns))
        comparison = Comparison(majorants, self.increments, self._feedback(gains))
        if not np.all(np.isfinite(majorants.coefficients)):
            return TrialFailure(gains, "the kernels of the nominal loop could not be bounded")
        return _Loop(gains, found, comparison, self._furthest(gains))

    def at(self, loop: _Loop, delta: Fraction) -> Trial | _Missed:
        """Both phases with one saturation level."""
        gains, comparison, level = loop.gains, loop.comparison, float(delta)
        K = float(gains.K)
        reached = self._reach(comparison, gains, level)
        if isinstance(reached, Stuck):
            return _Missed(reached.reason, max(level * DELTA_GROWTH, NEARLY * K * reached.vartheta))
        result = self._tube(comparison, reached, delta, gains)
        if isinstance(result, TubeFailure):
            reason, escape = f"at t = {result.time:.4g}: {result.reason}", None if result.settled else result.time
            return _Missed(reason, level * DELTA_GROWTH, result.time, escape)
        trial = Trial(self.model, gains, delta, self.nominal, loop.modes, comparison.kernels, reached, result)
        if trial.fits:
            return trial
        reason = f"the saturation level {level:.4g} is reached: the tube needs {trial.needed:.4g}"
        return _Missed(reason, trial.needed * DELTA_MARGIN)

    def _comparison(self, trial: Trial) -> Comparison:
        return Comparison(trial.kernels, self.increments, self._feedback(trial.gains))

    def _tube(
        self, comparison: Comparison, reached: Reached, delta: Fraction, gains: LoopGains, share: float = 0.0
    ) -> Tube | TubeFailure:
        highest = FAR * float(delta) / float(gains.K)
        return tube(comparison, self.surroundings, reached.start, reached.known, reached.duration, highest, share)

    def _furthest(self, gains: LoopGains) -> float:
        """``K`` times the largest ``|ϑ(0)|``, the unit of saturation levels. Agents may start where they are asked to
        be: then it is what the reference's way to the optimum makes of ``ϑ``, or 1 where that stands still too."""
        theta = self._theta(gains)
        way = float(theta[0]) * float(self.model.references.peak)
        return float(gains.K) * (max(float(theta @ self.initial.x), WAY_SHARE * way) or 1.0)

    def _feedback(self, gains: LoopGains) -> Feedback:
        zeros = self.increments.zeros
        f0 = np.array([[float(x) for x in row] for row in self.nominal.f0]).reshape(zeros, zeros + 1)
        return Feedback(f0, np.array([float(x) for x in self.nominal.f1]), float(self.nominal.b), float(gains.K))

    def _reach(self, comparison: Comparison, gains: LoopGains, delta: float) -> Reached | Stuck:
        """The phase in which the saturation may act, up to where the tube begins."""
        theta, error, time_constant = self._theta(gains), None, 1 / (float(gains.K) * float(self.nominal.b))
        if gains.h is not None:
            if self.observer is None:
                return Stuck("the observer is too slow or too fast to be followed", 0.0)
            scales = float(gains.h) ** np.arange(self.model.order - 1, -1, -1)
            error = ObserverError(self.observer, theta / scales, self.initial.estimate * scales, float(gains.h))
            time_constant = 1 / float(gains.h)
        phase = Reaching(
            self.increments,
            self.surroundings,
            self.initial,
            theta,
            float(gains.K),
            delta,
            float(self.nominal.b),
            error,
        )
        return phase.run(comparison.highest, time_constant)

    def _theta(self, gains: LoopGains) -> np.ndarray:
        """``ϑ = θ x̄``."""
        n = self.model.order
        return np.array([float(gains.g) ** (n - k) * float(self.model.gamma[k - 1]) for k in range(1, n)] + [1.0])


def _nominal(increments: Increments, surroundings: Surroundings) -> Nominal:
    """Middle slopes at rest, over every phase of the exosystem and all parameters."""
    zeros, order = increments.zeros, increments.order
    rest: Slopes = increments.slopes(np.zeros(zeros), np.zeros(order), surroundings.later())
    low, high = increments.b
    return Nominal(
        tuple(tuple(_middle(side) for side in row) for row in rest.f0),
        tuple(_middle(side) for side in rest.f1),
        _middle((low, high)),
    )


def as_good(coarse: Tube, fine: Tube) -> bool:
    """Every output has about the same peak, a tail of the same size, and is below shares of the peak about as soon."""
    if not (np.all(coarse.peak <= BLURRED * fine.peak) and np.all(coarse.tail <= LARGER_TAIL * fine.tail)):
        return False
    times = [[_last_above(tube, share * fine.peak) for share in SETTLED] for tube in (coarse, fine)]
    return bool(np.all(np.array(times[0]) <= LATER * np.array(times[1])))


def _last_above(tube: Tube, level: np.ndarray) -> np.ndarray:
    """The ends of the last steps on which the outputs may be above the levels; 0 if there are none."""
    above = np.array(tube.boxes) > level
    return np.max(above * np.array(tube.grid[1:])[:, None], axis=0)


def _middle(side: Range) -> Fraction:
    return Fraction(round((side[0] + side[1]) / 2 * 2**NOMINAL_BITS), 2**NOMINAL_BITS)


def _short_up(value: float) -> Fraction:
    """A rational with 8 significant bits, not below ``value``."""
    mantissa, exponent = np.frexp(value)
    return Fraction(int(np.ceil(mantissa * 256))) * Fraction(2) ** (int(exponent) - 8)
