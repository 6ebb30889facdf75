"""One trial of given gains: loop, modes, kernels, reaching phase, tube; the saturation level follows
(docs/certificate-direct.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from fractions import Fraction

import numpy as np

from certify.agent_model import AgentModel
from certify.coordinator.envelope import Envelope
from certify.float_range import BeyondFloatsError, float_range
from certify.recipe.matrices import observer_matrix
from certify.tube.increments import Increments
from certify.tube.kernels import Kernels, kernels
from certify.tube.loop import LoopGains, Nominal, nominal_loop
from certify.tube.modes import Modes, NoModes, modes
from certify.tube.nominal import middle_slopes, nudged
from certify.tube.observer_error import ObserverDecay, ObserverError, observer_decay
from certify.tube.reaching import InitialMagnitudes, Reached, Reaching, Stuck, initial_magnitudes
from certify.tube.supersolution import Comparison, Feedback, Tube, TubeFailure, tube
from certify.tube.surroundings import Surroundings
from certify.tube.trial_rule import TrialRule
from certify.tube.words import in_words

RULE = TrialRule()


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


class Stage(IntEnum):
    """What a trial can fail at, in order."""

    LOOP = 0
    MODES = 1
    KERNELS = 2
    PHASE1 = 3
    TUBE = 4
    LEVEL = 5
    TAIL = 6


Progress = tuple[Stage, float]


@dataclass(frozen=True)
class TrialFailure:
    """The block that fails for these gains; ``escape`` is the time at which the tube grew out of bounds, if it did.

    ``progress`` says how far the trial came: the stage, and within the stage a number that grows.
    """

    gains: LoopGains
    reason: str
    escape: float | None = None
    progress: Progress = (Stage.MODES, 0.0)


@dataclass(frozen=True)
class _Missed:
    """Why a saturation level does not do, one that might, and the time that the tube reached if it began."""

    reason: str
    next_level: float
    progress: Progress
    time: float | None = None
    escape: float | None = None


@dataclass(frozen=True)
class _Loop:
    """What does not depend on the saturation level; ``furthest`` is the unit of saturation levels."""

    gains: LoopGains
    nominal: Nominal
    modes: Modes
    comparison: Comparison
    furthest: float


class AgentTrials:
    """Trials of one agent's gains; what does not depend on the gains is prepared once."""

    def __init__(self, model: AgentModel, envelope: Envelope, index: int, rule: TrialRule = RULE) -> None:
        self.model, self.rule = model, rule
        self.surroundings = Surroundings(model, envelope, index)
        self.increments = Increments(model)
        self.initial: InitialMagnitudes = initial_magnitudes(model, self.surroundings)
        self.nominal = middle_slopes(self.increments, self.surroundings, rule.nominal_bits)
        self.observer: ObserverDecay | None = None
        if model.order > 1:
            self.observer = observer_decay(observer_matrix(model.observer))

    def named(self, gains: LoopGains) -> str:
        """The gains in words, in the units of the plant file."""
        return in_words(gains, self.model.units)

    def attempt(
        self, gains: LoopGains, delta: Fraction | None = None, like: Trial | None = None
    ) -> Trial | TrialFailure:
        """Try one set of gains. A ``delta`` that is left free is the least that does, to within a factor of two; the
        search for it begins at the share of ``K |ϑ(0)|`` that did in the trial ``like``."""
        largest = self.rule.largest_gain
        if max(gains.g if self.model.order > 1 else 0, gains.K, gains.h or 0, delta or 0) > largest:
            what = f"gains more than {float(largest):.0e} times what the agent's own rates call for"
            return TrialFailure(gains, f"{what} are beyond the search's floats")
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
            if isinstance(result, _Missed):
                return TrialFailure(gains, result.reason, result.escape, result.progress)
            return result
        first = self.rule.first_level
        share = first if like is None else max(first, float(like.delta) / self._furthest(like.gains))
        return self._least_level(loop, share)

    def tightened(self, trial: Trial) -> Trial:
        """The same gains with a saturation level that is less by up to a factor of two, if one does."""
        loop = _Loop(trial.gains, trial.nominal, trial.modes, self._comparison(trial), self._furthest(trial.gains))
        high, low = float(trial.delta), float(trial.delta) / 2
        for _ in range(self.rule.tightenings):
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
        for share in self.rule.coarse:
            result = self._tube(comparison, reached, trial.delta, trial.gains, share)
            if isinstance(result, Tube) and as_good(result, trial.tube, self.rule):
                found.append(replace(trial, tube=result))
        return min((one for one in found if one.fits), key=lambda one: len(one.tube.boxes))

    def _least_level(self, loop: _Loop, share: float) -> Trial | TrialFailure:
        """Upwards to a saturation level that does, or downwards by halves from one."""
        rule, level, failure = self.rule, share * loop.furthest, TrialFailure(loop.gains, "")
        times = [0.0, 0.0]
        for _ in range(rule.delta_rounds):
            result = self.at(loop, _short_up(level))
            if isinstance(result, Trial):
                return self._halved(loop, result) if not failure.reason else result
            level = result.next_level
            failure = TrialFailure(loop.gains, result.reason, result.escape, result.progress)
            if result.time is not None:
                times.append(result.time)
                if result.time <= times[-2] or result.time < rule.worth_it * times[-3]:
                    break
            if level > rule.largest_level * loop.furthest:
                break
        return failure

    def _halved(self, loop: _Loop, trial: Trial) -> Trial:
        while trial.delta / 2 > self.rule.first_level * loop.furthest:
            result = self.at(loop, trial.delta / 2)
            if isinstance(result, _Missed):
                break
            trial = result
        return trial

    def loop(self, gains: LoopGains) -> _Loop | TrialFailure:
        """With the nominal slopes nudged where the modes of the middle ones hardly span."""
        for nominal in (self.nominal, *(nudged(self.nominal, nudge) for nudge in self.rule.nudges)):
            loop = nominal_loop(self.model, gains, nominal)
            found = modes(loop)
            if found is not NoModes.DEFECTIVE:
                break
        if found is NoModes.UNSTABLE:
            return TrialFailure(gains, "the nominal loop is not stable", progress=(Stage.LOOP, 0.0))
        if isinstance(found, NoModes):
            reason = "the modes of the nominal loop hardly span, also after its slopes were changed a little"
            return TrialFailure(gains, reason, progress=(Stage.MODES, 0.0))
        majorants = kernels(found, len(loop.columns))
        comparison = Comparison(majorants, self.increments, self._feedback(gains, nominal))
        if not np.all(np.isfinite(majorants.coefficients)):
            reason = "the kernels of the nominal loop could not be bounded"
            return TrialFailure(gains, reason, progress=(Stage.KERNELS, 0.0))
        return _Loop(gains, nominal, found, comparison, self._furthest(gains))

    def at(self, loop: _Loop, delta: Fraction) -> Trial | _Missed:
        """Both phases with one saturation level."""
        gains, comparison, level = loop.gains, loop.comparison, float(delta)
        K = float(gains.K)
        units, rule = self.model.units, self.rule
        reached = self._reach(comparison, gains, level)
        if isinstance(reached, Stuck):
            reason, next_level = reached.reason, max(level * rule.delta_growth, rule.nearly * K * reached.vartheta)
            if reached.vartheta > 0:
                left, wanted = (value * float(units.last) for value in (reached.vartheta, level / K))
                reason = (
                    f"with the saturation level delta = {level * float(units.input):.4g} the feedback stays saturated: "
                    f"|ϑ| falls to {left:.3g}, not to delta/K = {wanted:.3g}"
                )
            return _Missed(reason, next_level, (Stage.PHASE1, -reached.vartheta))
        result = self._tube(comparison, reached, delta, gains)
        if isinstance(result, TubeFailure):
            reason = f"at t = {result.time * float(units.time):.4g}: {result.reason}"
            escape = None if result.settled else result.time
            progress = (Stage.TAIL if result.settled else Stage.TUBE, result.time)
            return _Missed(reason, level * rule.delta_growth, progress, result.time, escape)
        trial = Trial(self.model, gains, delta, loop.nominal, loop.modes, comparison.kernels, reached, result)
        if trial.fits:
            return trial
        sizes = level * float(units.input), trial.needed * float(units.input)
        reason = f"the saturation level {sizes[0]:.4g} is reached: the tube needs {sizes[1]:.4g}"
        return _Missed(reason, trial.needed * rule.delta_margin, (Stage.LEVEL, -trial.needed))

    def _comparison(self, trial: Trial) -> Comparison:
        return Comparison(trial.kernels, self.increments, self._feedback(trial.gains, trial.nominal))

    def _tube(
        self, comparison: Comparison, reached: Reached, delta: Fraction, gains: LoopGains, share: float = 0.0
    ) -> Tube | TubeFailure:
        highest = self.rule.far * float(delta) / float(gains.K)
        return tube(comparison, self.surroundings, reached.start, reached.known, reached.duration, highest, share)

    def _furthest(self, gains: LoopGains) -> float:
        """``K`` times the largest ``|ϑ(0)|``, the unit of saturation levels. Agents may start where they are asked to
        be: then it is what the reference's way to the optimum makes of ``ϑ``, or 1 where that stands still too."""
        theta = self._theta(gains)
        way = float(theta[0]) * float(self.model.references.peak)
        return float(gains.K) * (max(float(theta @ self.initial.x), self.rule.way_share * way) or 1.0)

    def _feedback(self, gains: LoopGains, nominal: Nominal) -> Feedback:
        zeros = self.increments.zeros
        f0 = np.array([[float(x) for x in row] for row in nominal.f0]).reshape(zeros, zeros + 1)
        return Feedback(f0, np.array([float(x) for x in nominal.f1]), float(nominal.b), float(gains.K))

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


def as_good(coarse: Tube, fine: Tube, rule: TrialRule = RULE) -> bool:
    """Every output has about the same peak, a tail of the same size, and is below shares of the peak about as soon."""
    if not (np.all(coarse.peak <= rule.blurred * fine.peak) and np.all(coarse.tail <= rule.larger_tail * fine.tail)):
        return False
    times = [[_last_above(tube, share * fine.peak) for share in rule.settled] for tube in (coarse, fine)]
    return bool(np.all(np.array(times[0]) <= rule.later * np.array(times[1])))


def _last_above(tube: Tube, level: np.ndarray) -> np.ndarray:
    """The ends of the last steps on which the outputs may be above the levels; 0 if there are none."""
    above = np.reshape(tube.boxes, (-1, len(level))) > level  # no step at all where everything starts at rest
    return np.max(above * np.array(tube.grid[1:])[:, None], axis=0, initial=0.0)


def _short_up(value: float) -> Fraction:
    """A rational with 8 significant bits, not below ``value``."""
    mantissa, exponent = np.frexp(value)
    return Fraction(int(np.ceil(mantissa * 256))) * Fraction(2) ** (int(exponent) - 8)
