"""Gains that meet the requirements of one agent: a descent from gains that pass, one gain after the other.

What is minimised is by how much the worst requirements are missed, as logarithms of ratios, so that no unit matters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf, log

from certify.tube.loop import LoopGains
from certify.tube.performance import Performance, Performances
from certify.tube.trial import AgentTrials, Trial
from certify.tube.words import in_words, short
from certify.units.scales import Scales
from symbolic.plant import RequestedGains, Requirements

MOST_TRIALS = 90
STRIDES = (2.0, 2**0.5, 2**0.25)  # ratios of gains between trials, from coarse to fine
BETTER = 1e-2  # a change of the score that is worth a step
WEIGHT = 0.05  # of requirements that are met already: room in one is of use to the others
ROUNDED = 1e-7  # how far rounding parts a double root; the checker decides exactly
DIGITS = 2  # of the gains that are tried


Score = Callable[[Trial, Performance], float]


@dataclass(frozen=True)
class Shortfall:
    """One requirement that is missed: what was asked and what the best trial proves, in the words of the plant file."""

    name: str
    asked: float
    proved: float

    @property
    def ratio(self) -> float:
        """Above 1 where it is missed."""
        return self.proved / self.asked if self.asked else inf if self.proved else 1.0


@dataclass(frozen=True)
class Met:
    """A trial that meets every requirement."""

    trial: Trial
    tried: int


@dataclass(frozen=True)
class Missed:
    """The trial that came nearest, what it does and misses, and how soon the reference alone is within the band."""

    trial: Trial
    performance: Performance
    shortfalls: tuple[Shortfall, ...]
    reference: float | None
    tried: int


class Wanted:
    """The requirements of one agent as ratios of what is proved to what is asked."""

    def __init__(self, asked: Requirements) -> None:
        self.asked = asked

    def ratios(self, found: Performance) -> list[Shortfall]:
        """All requirements; those with a ratio above 1 are missed."""
        asked, ratios = self.asked, []
        if asked.settling is not None:
            settled = found.settled(float(asked.settling.band))
            ratios.append(Shortfall("settling", float(asked.settling.time), settled))
        if asked.input is not None:
            ratios.append(Shortfall("input", float(asked.input), found.peak))
        if asked.bandwidth is not None and found.pole > 0:
            ratios.append(Shortfall("bandwidth", float(asked.bandwidth), found.pole * (1 - ROUNDED)))
        return ratios

    def missed(self, found: Performance) -> tuple[Shortfall, ...]:
        return tuple(one for one in self.ratios(found) if one.ratio > 1)

    def score(self, trial: Trial, found: Performance) -> float:
        """0 and less where all are met."""
        logs = [log(max(one.ratio, 1e-9)) if one.ratio < inf else 1e3 for one in self.ratios(found)]
        over = sum(max(entry, 0.0) for entry in logs)
        return over if over > 0 else -1.0 + WEIGHT * sum(logs)


class Descent:
    """Trials of one agent with one design, from one that passed towards a lower score."""

    def __init__(
        self,
        trials: AgentTrials,
        performances: Performances,
        requested: RequestedGains,
        report: Callable[[str], None],
        cap: Fraction | None = None,
        most: int = MOST_TRIALS,
    ) -> None:
        """``h`` is at most ``cap``."""
        self.trials, self.performances, self.requested, self.report = trials, performances, requested, report
        self.cap = cap
        self.known: dict[tuple[LoopGains, Fraction | None], Trial | None] = {}
        self.passed: list[tuple[Trial, Performance]] = []
        self.most = most

    def down(self, start: Trial, score: Score, enough: float) -> tuple[Trial, Performance]:
        """The best trial; it ends at a score of ``enough``, or when no single change is better."""
        best, found, cap = start, self.measured(start), self.cap
        if cap is not None and start.gains.h is not None and start.gains.h > cap:
            below = self._first_below(start, cap)
            if below is not None:
                best, found = below
        for stride in STRIDES:
            improved = True
            while improved and score(best, found) > enough and len(self.known) < self.most:
                improved = False
                for gains, delta in self.moves(best, stride, cap):
                    while score(best, found) > enough and len(self.known) < self.most:
                        trial = self._attempt(gains, delta, best)
                        if trial is None or score(trial, self.measured(trial)) > score(best, found) - BETTER * stride:
                            break
                        ratio = _ratio(best, trial)
                        best, found, improved = trial, self.measured(trial), True
                        gains, delta = _onwards(trial, ratio, cap)
        return best, found

    def measured(self, trial: Trial) -> Performance:
        for known, performance in self.passed:
            if known is trial:
                return performance
        performance = self.performances.of(trial)
        self.passed.append((trial, performance))
        return performance

    def _first_below(self, start: Trial, cap: Fraction) -> tuple[Trial, Performance] | None:
        """Gains at the cap of ``h`` that pass, if any: at the ``K`` of the start and at less."""
        for K in (start.gains.K * factor for factor in (Fraction(1), Fraction(1, 2), Fraction(1, 4), Fraction(1, 8))):
            for g in dict.fromkeys((start.gains.g, *map(Fraction, (3, 2, 1)))):
                trial = self._attempt(LoopGains(self.requested.g or g, self.requested.K or K, cap), None, start)
                if trial is not None:
                    return trial, self.measured(trial)
        return None

    def moves(self, at: Trial, stride: float, cap: Fraction | None) -> Iterator[tuple[LoopGains, Fraction | None]]:
        """Every gain that is free, up and down; ``h`` goes along with ``K``, and alone; then the level ``δ``."""
        g, K, h = at.gains.g, at.gains.K, at.gains.h
        free = self.requested
        for factor in (stride, 1 / stride):
            if free.K is None:
                yield LoopGains(g, _short(K * _exact(factor)), self._capped(h, factor, cap)), free.delta
                if h is not None and free.h is None:
                    yield LoopGains(g, _short(K * _exact(factor)), h), free.delta
            if h is not None and free.h is None:
                yield LoopGains(g, K, self._capped(h, factor, cap)), free.delta
            if free.g is None and at.model.order > 1 and g * _exact(factor) >= 1:
                yield LoopGains(_short(g * _exact(factor)), K, h), free.delta
        if free.delta is None:
            yield at.gains, _level(at.delta, 1 / stride)
            yield at.gains, _level(at.delta, stride)

    def _capped(self, h: Fraction | None, factor: float, cap: Fraction | None) -> Fraction | None:
        if h is None or self.requested.h is not None:
            return h
        wanted = _short(h * _exact(factor))
        return wanted if cap is None else min(wanted, cap)

    def _attempt(self, gains: LoopGains, delta: Fraction | None, like: Trial) -> Trial | None:
        key = gains, delta
        if key not in self.known:
            self.report(self.trials.named(gains))
            result = self.trials.attempt(gains, delta, like)
            self.known[key] = result if isinstance(result, Trial) else None
        return self.known[key]


def meet(
    descents: Sequence[tuple[Descent, Trial]], asked: Requirements, report: Callable[[str], None] = lambda message: None
) -> Met | Missed:
    """Gains that meet the requirements, from the starts in turn (those that do best first), or the nearest miss."""
    wanted = Wanted(asked)
    order = sorted(descents, key=lambda pair: wanted.score(pair[1], pair[0].measured(pair[1])))
    nearest: tuple[float, Descent, Trial, Performance] | None = None
    tried = 0
    for descent, start in order:
        if tried >= MOST_TRIALS:
            break
        trial, found = descent.down(start, wanted.score, 0.0)
        tried += len(descent.known)
        if not wanted.missed(found):
            return Met(trial, tried)
        score = wanted.score(trial, found)
        if nearest is None or score < nearest[0]:
            nearest = score, descent, trial, found
    assert nearest is not None  # there is a start
    _, descent, trial, found = nearest
    band = None if asked.settling is None else float(asked.settling.band)
    reference = None if band is None else reference_settled(descent.performances, band)
    return Missed(trial, found, wanted.missed(found), reference, tried)


def largest_h(performances: Performances, asked: Requirements) -> Fraction | None:
    """The largest observer gain that the bandwidth allows; ``None`` if it allows all, or there is no observer."""
    if asked.bandwidth is None or not performances.fastest > 0:
        return None
    return _short(asked.bandwidth / Fraction(float(performances.fastest)) * (1 + Fraction(ROUNDED)), 3)


def reference_settled(performances: Performances, band: float) -> float:
    """A time from which on ``|y^r − s*| ≤ band``, which no gains of the agent change."""
    outside = performances.surroundings
    tail = float(outside.agent.tail_deviation)
    if tail > band:
        return outside.horizon + log(tail / band) / outside.decay
    late = [k for k, deviation in enumerate(outside.deviation) if deviation > band]
    return float(outside.times[late[-1] + 1]) if late else 0.0


def explained(missed: Missed, asked: Requirements) -> str:
    """Which requirement stands in the way, by how much, and the nearest set that passes, as lines for the file."""
    units, found, passing = missed.trial.model.units, missed.performance, []
    parts = [_sentence(one, missed, asked, units) for one in missed.shortfalls]
    if asked.settling is not None:
        settled, allowed = found.settled(float(asked.settling.band)) * float(units.time), asked.settling.time
        time, band = _larger(settled, allowed * units.time), asked.settling.band * units.output
        passing.append(f'settling = {{ time = {time}, band = "{band}" }}')
    if asked.input is not None:
        passing.append(f"input = {_larger(found.peak * float(units.input), asked.input * units.input)}")
    if asked.bandwidth is not None:
        pole = found.pole * (1 - ROUNDED) * float(units.rate)
        passing.append(f"bandwidth = {_larger(pole, asked.bandwidth * units.rate)}")
    law = f"{in_words(missed.trial.gains, units)}, delta = {short(missed.trial.delta * units.input)}"
    return f"{'; '.join(parts)}; the nearest set that passes: {', '.join(passing)}, with {law} ({missed.tried} trials)"


def _sentence(one: Shortfall, missed: Missed, asked: Requirements, units: Scales) -> str:
    """In the units of the plant file."""
    if one.name == "settling" and asked.settling is not None:
        time, band = float(units.time), asked.settling.band * units.output
        text = f"requirements.settling: |y - s*| <= {band} is proved from t = {one.proved * time:.4g} on, "
        text += f"{one.ratio:.3g} times the {one.asked * time:.4g} asked for" if one.asked else "not from the start"
        if missed.reference is not None and missed.reference > one.asked:
            text += f" (the coordinator alone needs {missed.reference * time:.4g}, whatever the agent's gains)"
        return text
    times = f"{one.ratio:.3g} times what is allowed"
    if one.name == "input":
        return f"requirements.input: |u| <= {one.proved * float(units.input):.4g} is proved, {times}"
    return f"requirements.bandwidth: the observer needs {one.proved * float(units.rate):.4g} rad/s, {times}"


def _larger(proved: float, asked: Fraction) -> str:
    """What is asked where it is met, else four digits that are not below what is proved."""
    if proved <= asked:
        return str(asked) if asked.denominator == 1 else f'"{asked}"'
    return repr(float(f"{proved * 1.0005:.4g}"))


def _ratio(before: Trial, after: Trial) -> tuple[float, float, float, bool]:
    """What the step did to ``g``, ``K``, ``h``; whether it changed ``δ`` alone."""
    h = 1.0 if before.gains.h is None or after.gains.h is None else float(after.gains.h / before.gains.h)
    g, K = float(after.gains.g / before.gains.g), float(after.gains.K / before.gains.K)
    return g, K, h, after.gains == before.gains


def _onwards(
    trial: Trial, ratio: tuple[float, float, float, bool], cap: Fraction | None
) -> tuple[LoopGains, Fraction | None]:
    """The same step once more."""
    g, K, h, level = ratio
    if level:
        return trial.gains, _level(trial.delta, 2**-0.5)
    gains = trial.gains
    further = None if gains.h is None else _short(gains.h * _exact(h))
    if further is not None and cap is not None:
        further = min(further, cap)
    return LoopGains(max(_short(gains.g * _exact(g)), Fraction(1)), _short(gains.K * _exact(K)), further), None


def _level(delta: Fraction, factor: float) -> Fraction:
    return _short(delta * _exact(factor), 3)


def _exact(factor: float) -> Fraction:
    return Fraction(factor).limit_denominator(1000)


def _short(value: Fraction, digits: int = DIGITS) -> Fraction:
    """To a few significant digits, rounded down where that matters little: gains are read by people."""
    power = len(str(int(value))) if value >= 1 else 1 - len(str(int(1 / value)))
    unit = Fraction(10) ** (power - digits)
    return max(value // unit, 1) * unit
