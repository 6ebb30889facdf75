"""Small gains for one agent: the least ``K``, the least ``h``, and a balance of the two (theory.md section 6.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import log

from certify.tube.designs import STAGES, observers
from certify.tube.loop import LoopGains
from certify.tube.nothing import explained
from certify.tube.search_rule import SearchRule
from certify.tube.trial import AgentTrials, Trial, TrialFailure
from symbolic.plant import Agent, RequestedGains

RULE = SearchRule()

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
    rule: SearchRule = RULE,
) -> tuple[Choice, ...] | NoChoice:
    """Certifiable gains, the default first. Requested gains are kept; whatever is left free is searched, the designs
    that ``redesigned`` can prepare included unless ``K`` or ``h`` is given."""
    redesigned, finder = cache(redesigned), Finder(trials, requested, report, rule)
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
    trials: AgentTrials, requested: RequestedGains, report: Report = lambda message: None, rule: SearchRule = RULE
) -> Trial | None:
    """The gains that pass and are nearest, in ratios, to requested ones that do not; ``None`` if none pass."""
    finder = Finder(trials, RequestedGains(), report, rule)
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


class Finder:
    """The search within one design."""

    def __init__(self, trials: AgentTrials, requested: RequestedGains, report: Report, rule: SearchRule = RULE) -> None:
        self.trials, self.requested, self.report, self.rule = trials, requested, report, rule
        self.observed = trials.model.order > 1
        self.passed: list[Trial] = []
        self.latest: dict[Fraction, Trial] = {}
        self.least_rate = 0.0
        self.known: dict[LoopGains, Trial | TrialFailure] = {}

    def of(self, trials: AgentTrials) -> Finder:
        """The same search within another design."""
        other = Finder(trials, self.requested, self.report, self.rule)
        other.least_rate = self.least_rate
        return other

    def attempt(self, g: Fraction, K: Fraction, ratio: Fraction) -> Trial | None:
        wanted = self.requested
        K = wanted.K or K
        h = (wanted.h or K * ratio) if self.observed else None
        gains = LoopGains(wanted.g or g, K, h)
        if wanted.h is None and h is not None and h < gains.g:
            return None  # an observer that is slower than the surface is no use
        if gains not in self.known:
            self.report(self.trials.named(gains))
            result = self.trials.attempt(gains, wanted.delta, self.latest.get(gains.g))
            if isinstance(result, Trial) and result.tube.tail_rate < self.least_rate:
                result = TrialFailure(gains, "the certified rate is far below that of other gains")
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
        """Some gains that pass: moderate ones, then far ones on both sides; a saturation level that is given asks for
        small gains first."""
        rule, wanted = self.rule, self.requested
        several = rule.first_g if wanted.K is None else (*rule.first_g, *rule.larger_g)
        ladder = rule.first_K if wanted.delta is None else rule.first_K_below_a_limit
        for K in ladder if wanted.K is None else (wanted.K,):
            for ratio in rule.first_ratios if self.observed else rule.first_ratios[:1]:
                for g in several if self.observed else (Fraction(1),):
                    found = self.attempt(g, K, ratio)
                    if found is not None:
                        self.least_rate = float(rule.slower) * found.tube.tail_rate
                        return found
                    if self._hopeless():
                        return self._nothing()
            if len(self.known) >= rule.most_trials:
                break
        return self._nothing()

    def _nothing(self) -> NoChoice:
        failed = [result for result in self.known.values() if isinstance(result, TrialFailure)]
        return NoChoice(explained(self.trials, failed), len(self.known))

    def _hopeless(self) -> bool:
        """Whether several tubes, the last with far larger gains, grow out of bounds at about the same time: then it is
        not the gains that make them."""
        rule = self.rule
        if self.requested.K is not None or len(self.known) != rule.agreeing:
            return False
        self.attempt(Fraction(1), rule.far, rule.first_ratios[-1])
        failed = [result for result in self.known.values() if isinstance(result, TrialFailure)]
        escapes = [result.escape for result in failed if result.escape is not None]
        return len(escapes) > rule.agreeing and max(escapes) < rule.about * min(escapes)

    def lower_K(self, start: Trial) -> Trial:
        """Down the ladder of ``K`` at the ratio and ``g`` of ``start``, in steps that double until one fails, then by
        bisection; then further down with larger ``g``."""
        best, ratio, ladder = start, self._ratio(start), self.rule.ladder
        if self.requested.K is not None:
            return best
        above, lowest, stride = self._rung(start), ladder.index(self.rule.least_K) - 1, self.rule.first_stride
        below = lowest
        while above - 1 > lowest:
            place = max(above - stride, lowest + 1)
            found = self.attempt(start.gains.g, ladder.rung(place), ratio)
            if found is None:
                below = place
                break
            best, above, stride = found, place, 2 * stride
        while above - below > 1:
            middle = (below + above) // 2
            found = self.attempt(start.gains.g, ladder.rung(middle), ratio)
            if found is None:
                below = middle
            else:
                best, above = found, middle
        return self.step_down(best, self.rule.larger_g if self.observed and self.requested.g is None else ())

    def step_down(self, start: Trial, several: Sequence[Fraction]) -> Trial:
        """Rung by rung at the ratio of ``start``, with one ``g`` after the other."""
        best, ladder = start, self.rule.ladder
        for g in several:
            while self.rule.least_K < best.gains.K:
                found = self.attempt(g, ladder.rung(self._rung(best) - 1), self._ratio(start))
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
        best, rule = start, self.rule
        if start.gains.h is None or self.requested.h is not None:
            return best
        rung, ratios = self._rung(start), rule.ratios
        higher = (rule.ladder.rung(rung + k) for k in range(1, rule.rungs_above + 1))
        for K in dict.fromkeys((start.gains.K, *higher)):
            wanted = self._ratio(best)
            below, above = -1, next((k for k, ratio in enumerate(ratios) if ratio >= wanted), len(ratios) - 1)
            while above - below > 1:
                middle = (below + above) // 2
                found = self.attempt(start.gains.g, K, ratios[middle])
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
            for ratio in self.rule.ratios:
                if self._ratio(tight) < ratio <= self.rule.a_little * self._ratio(tight):
                    found = self.attempt(tight.gains.g, tight.gains.K, ratio)
                    if found is not None:
                        self.tighten(found)

    def _ratio(self, trial: Trial) -> Fraction:
        return Fraction(1) if trial.gains.h is None else trial.gains.h / trial.gains.K

    def _rung(self, trial: Trial) -> int:
        """The place of its ``K`` on the ladder, or of the next one above."""
        return self.rule.ladder.index(trial.gains.K)


def _redesign(finder: Finder, start: Trial, redesigned: Redesigned) -> tuple[Finder, Trial]:
    """The design that passes with the least ``K`` at the ratio of ``start``, or that leaves the saturation most of its
    level; none with a lower certified rate at the gains that are compared. One thing is changed after the other."""
    best, rule = start, finder.rule
    for stage in STAGES:
        for agent in stage(best.model.agent, best.model.internal_model.order):
            trials = redesigned(agent)
            if trials is None:
                continue
            finder.report(f"another design: {stage.__name__.replace('_', ' ')}")
            other = finder.of(trials)
            found = other.adopt(best)
            if found is None or found.tube.tail_rate < start.tube.tail_rate:
                continue
            lower = other.step_down(found, (best.gains.g,))
            slow = lower.tube.tail_rate < start.tube.tail_rate
            if (lower is not found and not slow) or found.needed < rule.clearly_less * best.needed:
                finder, best = other, found if slow else lower
    if best is start:
        return finder, best
    return finder, finder.step_down(best, tuple(g for g in rule.larger_g if g > best.gains.g))


def _other_observers(finder: Finder, start: Trial, redesigned: Redesigned) -> list[Finder]:
    """Other observers at gains that have passed, and at lower ratios ``h/K``: it is there that they differ."""
    finders = []
    for agent in observers(start.model.agent, start.model.internal_model.order):
        trials = redesigned(agent)
        if trials is None:
            continue
        finder.report("another design: observers")
        other = finder.of(trials)
        found = other.adopt(start)
        if found is None or found.tube.tail_rate < start.tube.tail_rate:
            continue
        other.tighten(found)
        for ratio in reversed([ratio for ratio in finder.rule.ratios if ratio < other._ratio(found)]):
            further = other.attempt(found.gains.g, found.gains.K, ratio)
            if further is None:
                break
            other.tighten(further)
        finders.append(other)
    return finders


def _log(value: Fraction) -> float:
    """Also of numbers that no float holds."""
    return log(value.numerator) - log(value.denominator)
