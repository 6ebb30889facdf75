"""Small gains for one agent: the least ``K``, the least ``h``, and a balance of the two (theory.md section 6.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import log

from certify.tube.designs import STAGES, observers
from certify.tube.loop import LoopGains
from certify.tube.trial import AgentTrials, Trial, TrialFailure
from symbolic.plant import Agent, RequestedGains

FIRST_G = (Fraction(3), Fraction(2), Fraction(1))
LARGER_G = (Fraction(4), Fraction(6), Fraction(8))
RUNGS_ABOVE = 1
STRIDE = 3
MOST_TRIALS = 60
A_LITTLE = Fraction(5, 4)
CLEARLY_LESS = 0.95
AGREEING = 3  # failures in a row before far larger gains are tried at once
ABOUT = 1.1  # ratio of times of escape that count as the same
_RUNGS = (
    "1 1.5 2 3 4 5 7 8.5 10 12 14 17 20 25 30 35 40 50 60 75 90 100 110 130 145 160 180 200 250 300 375 450 550 700"
    " 1000 1500 2200 3300 5000"
)
LADDER = tuple(Fraction(rung) for rung in _RUNGS.split())
HIGHER = tuple(Fraction(10) ** k for k in (4, 5))
START = LADDER.index(Fraction(300))
RATIOS = tuple(Fraction(k) for k in (5, 6, 7, 8, 10, 12, 14, 17, 20, 25, 30, 35, 40, 50, 60, 100, 200, 400, 1000))
FIRST_RATIOS = tuple(Fraction(k) for k in (25, 100, 400))


Report = Callable[[str], None]
Redesigned = Callable[[Agent], AgentTrials | None]


@dataclass(frozen=True)
class Choice:
    """One point of the trade-off, with the reason for which it is there."""

    label: str
    reason: str
    trial: Trial


@dataclass(frozen=True)
class NoChoice:
    """Nothing passed; the reason is that of the trial that came furthest."""

    reason: str
    tried: int


def search_gains(
    trials: AgentTrials,
    requested: RequestedGains,
    report: Report = lambda message: None,
    redesigned: Redesigned = lambda agent: None,
) -> tuple[Choice, ...] | NoChoice:
    """Certifiable gains, the default first. Requested gains are kept; whatever is left free is searched, the designs
    that ``redesigned`` can prepare included unless ``K`` or ``h`` is given."""
    redesigned, finder = cache(redesigned), _Finder(trials, requested, report)
    first = finder.first()
    if isinstance(first, NoChoice):
        return first
    finders, least_K = [finder], finder.lower_K(first)
    if requested.K is None and requested.h is None:
        finder, least_K = _redesign(finder, least_K, redesigned)
        finders.append(finder)
    finder.lower_h(least_K)
    finder.relax(min(finder.passed, key=_product))
    finder.tighten(_least_delta(finder.passed))
    if requested.K is None and requested.h is None:
        finders += _other_observers(finder, _balanced(finder.passed), redesigned)
    passed = list({id(trial): trial for finder in finders for trial in finder.passed}.values())
    candidates = (
        Choice("balanced", "the least product K·h·∛δ that passed", _balanced(passed)),
        Choice("least K", "the least feedback gain that passed", _least_K(passed)),
        Choice("least h", "the least observer gain that passed", _least_h(passed)),
        Choice("least delta", "the least saturation level, so the least peak of the input", _least_delta(passed)),
    )
    chosen: list[Choice] = []
    for candidate in candidates:
        if all(candidate.trial is not other.trial for other in chosen):
            chosen.append(candidate)
    return tuple(chosen)


def _product(trial: Trial) -> Fraction:
    return trial.gains.K * (trial.gains.h or 1)


def _least_K(passed: Sequence[Trial]) -> Trial:
    return min(passed, key=lambda trial: (trial.gains.K, trial.gains.h or 1, trial.delta))


def _least_h(passed: Sequence[Trial]) -> Trial:
    return min(passed, key=lambda trial: (trial.gains.h or 1, trial.gains.K, trial.delta))


def _least_delta(passed: Sequence[Trial]) -> Trial:
    return min(passed, key=lambda trial: (trial.delta, _product(trial)))


def _balanced(passed: Sequence[Trial]) -> Trial:
    """The least ``K·h·∛δ``: a feedback that is a quarter larger has to spare half of the input's peak."""
    return min(passed, key=lambda trial: _product(trial) ** 3 * trial.delta)


def nearest_gains(
    trials: AgentTrials, requested: RequestedGains, report: Report = lambda message: None
) -> Trial | None:
    """The gains that pass and are nearest, in ratios, to requested ones that do not; ``None`` if none pass."""
    finder = _Finder(trials, RequestedGains(), report)
    first = finder.first()
    if isinstance(first, NoChoice):
        return None
    finder.lower_h(finder.lower_K(first))
    wanted = (requested.g, requested.K, requested.delta, requested.h)

    def distance(trial: Trial) -> float:
        had = (trial.gains.g, trial.gains.K, trial.delta, trial.gains.h)
        return sum(
            abs(_log(a) - _log(b))
            for a, b in zip(had, wanted, strict=True)
            if a is not None and b is not None and b > 0
        )

    return min(finder.passed, key=distance)


class _Finder:
    """The search within one design."""

    def __init__(self, trials: AgentTrials, requested: RequestedGains, report: Report) -> None:
        self.trials, self.requested, self.report = trials, requested, report
        self.observed = trials.model.order > 1
        self.passed: list[Trial] = []
        self.latest: dict[Fraction, Trial] = {}
        self.known: dict[LoopGains, Trial | TrialFailure] = {}

    def attempt(self, g: Fraction, K: Fraction, ratio: Fraction) -> Trial | None:
        wanted = self.requested
        K = wanted.K or K
        h = (wanted.h or K * ratio) if self.observed else None
        gains = LoopGains(wanted.g or g, K, h)
        if gains not in self.known:
            self.report(f"g = {gains.g}, K = {gains.K}" + ("" if h is None else f", h = {h}"))
            result = self.trials.attempt(gains, wanted.delta, self.latest.get(gains.g))
            self.known[gains] = result
            if isinstance(result, Trial):
                self.passed.append(result)
                self.latest[gains.g] = result
        found = self.known[gains]
        return found if isinstance(found, Trial) else None

    def adopt(self, trial: Trial) -> Trial | None:
        """The gains and the saturation level of another design's trial."""
        result = self.trials.attempt(trial.gains, trial.delta)
        if not isinstance(result, Trial):
            return None
        self.known[trial.gains] = self.latest[trial.gains.g] = result
        self.passed.append(result)
        return result

    def first(self) -> Trial | NoChoice:
        """Some gains that pass: from moderate ones upwards in ``h/K`` and ``K``, then downwards; a saturation level
        that is given asks for small gains first."""
        several = FIRST_G if self.requested.K is None else tuple(dict.fromkeys(FIRST_G + LARGER_G))
        ladder = (*LADDER[START::STRIDE], *HIGHER, *LADDER[START % STRIDE : START : STRIDE][::-1])
        if self.requested.delta is not None:
            ladder = (*LADDER[START % STRIDE :: STRIDE], *HIGHER)
        for K in ladder if self.requested.K is None else (self.requested.K,):
            for ratio in FIRST_RATIOS if self.observed else FIRST_RATIOS[:1]:
                for g in several if self.observed else (Fraction(1),):
                    found = self.attempt(g, K, ratio)
                    if found is not None:
                        return found
                    if self._hopeless():
                        return self._nothing()
            if len(self.known) >= MOST_TRIALS:
                break
        return self._nothing()

    def _nothing(self) -> NoChoice:
        reasons = [result.reason for result in self.known.values() if isinstance(result, TrialFailure)]
        return NoChoice(reasons[-1], len(self.known))

    def _hopeless(self) -> bool:
        """Whether several tubes, the last with far larger gains, grow out of bounds at about the same time: then it is
        not the gains that make them."""
        if self.requested.K is not None or len(self.known) != AGREEING:
            return False
        self.attempt(Fraction(1), HIGHER[0], FIRST_RATIOS[-1])
        failed = [result for result in self.known.values() if isinstance(result, TrialFailure)]
        escapes = [result.escape for result in failed if result.escape is not None]
        return len(escapes) > AGREEING and max(escapes) < ABOUT * min(escapes)

    def lower_K(self, start: Trial) -> Trial:
        """Bisection on the ladder of ``K`` at the ratio and ``g`` of ``start``; then further down with larger ``g``."""
        best, ratio = start, self._ratio(start)
        if self.requested.K is not None:
            return best
        below, above = -1, _rung(start)
        while above - below > 1:
            middle = (below + above) // 2
            found = self.attempt(start.gains.g, LADDER[middle], ratio)
            if found is None:
                below = middle
            else:
                best, above = found, middle
        return self.step_down(best, LARGER_G if self.observed and self.requested.g is None else ())

    def step_down(self, start: Trial, several: Sequence[Fraction]) -> Trial:
        """Rung by rung at the ratio of ``start``, with one ``g`` after the other."""
        best = start
        for g in several:
            while _rung(best) > 0:
                found = self.attempt(g, LADDER[_rung(best) - 1], self._ratio(start))
                if found is None:
                    break
                best = found
        return best

    def tighten(self, trial: Trial) -> Trial:
        """A smaller saturation level for gains that have passed."""
        if self.requested.delta is not None:
            return trial
        tightened = self.trials.tightened(trial)
        self.passed = [tightened if one is trial else one for one in self.passed]
        return tightened

    def lower_h(self, start: Trial) -> Trial:
        """The least ratio ``h/K``, by bisection, at the least ``K`` and on the rungs above it."""
        best = start
        if start.gains.h is None or self.requested.h is not None:
            return best
        rung = _rung(start)
        for K in dict.fromkeys((start.gains.K, *LADDER[rung + 1 : rung + 1 + RUNGS_ABOVE])):
            wanted = self._ratio(best)
            below, above = -1, next((k for k, ratio in enumerate(RATIOS) if ratio >= wanted), len(RATIOS) - 1)
            while above - below > 1:
                middle = (below + above) // 2
                found = self.attempt(start.gains.g, K, RATIOS[middle])
                if found is None:
                    below = middle
                else:
                    above = middle
                    best = found if (found.gains.h or 0) < (best.gains.h or 0) else best
        return best

    def relax(self, tight: Trial) -> None:
        """A little more ``h`` at the same ``K``: it often needs a far smaller saturation level."""
        self.tighten(tight)
        if tight.gains.h is not None and self.requested.h is None:
            for ratio in RATIOS:
                if self._ratio(tight) < ratio <= A_LITTLE * self._ratio(tight):
                    found = self.attempt(tight.gains.g, tight.gains.K, ratio)
                    if found is not None:
                        self.tighten(found)

    def _ratio(self, trial: Trial) -> Fraction:
        return Fraction(1) if trial.gains.h is None else trial.gains.h / trial.gains.K


def _redesign(finder: _Finder, start: Trial, redesigned: Redesigned) -> tuple[_Finder, Trial]:
    """The design that passes with the least ``K`` at the ratio of ``start``, or that leaves the saturation most of its
    level; none with a lower certified rate at the gains that are compared. One thing is changed after the other."""
    best = start
    for stage in STAGES:
        for agent in stage(best.model.agent, best.model.internal_model.order):
            trials = redesigned(agent)
            if trials is None:
                continue
            finder.report(f"another design: {stage.__name__.replace('_', ' ')}")
            other = _Finder(trials, finder.requested, finder.report)
            found = other.adopt(best)
            if found is None or found.tube.tail_rate < start.tube.tail_rate:
                continue
            lower = other.step_down(found, (best.gains.g,))
            slow = lower.tube.tail_rate < start.tube.tail_rate
            if (lower is not found and not slow) or found.needed < CLEARLY_LESS * best.needed:
                finder, best = other, found if slow else lower
    return finder, best if best is start else finder.step_down(best, tuple(g for g in LARGER_G if g > best.gains.g))


def _other_observers(finder: _Finder, start: Trial, redesigned: Redesigned) -> list[_Finder]:
    """Other observers at gains that have passed, and at the next lower ratio ``h/K``: it is there that they differ."""
    finders = []
    for agent in observers(start.model.agent, start.model.internal_model.order):
        trials = redesigned(agent)
        if trials is None:
            continue
        finder.report("another design: observers")
        other = _Finder(trials, finder.requested, finder.report)
        found = other.adopt(start)
        if found is None or found.tube.tail_rate < start.tube.tail_rate:
            continue
        other.tighten(found)
        lower = [ratio for ratio in RATIOS if ratio < other._ratio(found)]
        further = other.attempt(found.gains.g, found.gains.K, lower[-1]) if lower else None
        if further is not None:
            other.tighten(further)
        finders.append(other)
    return finders


def _log(value: Fraction) -> float:
    """Also of numbers that no float holds."""
    return log(value.numerator) - log(value.denominator)


def _rung(trial: Trial) -> int:
    """The place of its ``K`` on the ladder, or of the next one above."""
    return next((k for k, K in enumerate(LADDER) if trial.gains.K <= K), len(LADDER))
