"""The reference of one agent in time (docs/certificate.md section 2): step by step, then a decaying tail."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from certify.checker.intervals import Interval, between, enclose, hull, maximum, symmetric
from certify.checker.rules.mixing import point
from certify.checker.verdict import Undecided


@dataclass(frozen=True)
class AgentEnvelope:
    """``|y_i^r − s*| ≤ peak`` for ever, ``∫ (y_i^r − s*)² ≤ energy``, ``∫ (ẏ_i^r)² ≤ speed_energy``; each a point.

    ``reference`` is what they come from, step by step.
    """

    peak: Interval
    energy: Interval
    speed_energy: Interval
    reference: Reference


@dataclass(frozen=True)
class Range:
    """``y^r ∈ y``, ``|y^r − s*| ≤ distance`` and ``|ẏ^r| ≤ speed`` during some time; the last two are points."""

    y: Interval
    distance: Interval
    speed: Interval


@dataclass(frozen=True)
class Step:
    """The same in units of 2^-128: ``low ≤ y^r ≤ high``."""

    low: int
    high: int
    distance: int
    speed: int


@dataclass(frozen=True)
class Reference:
    """``steps[k]`` is from ``times[k]`` to ``times[k + 1]``, ``times[0] = 0``; after them ``tail_distance`` and
    ``tail_speed`` decay at the rate ``tail_rate``."""

    optimum: Interval
    times: Sequence[Fraction]
    steps: Sequence[Step]
    tail_distance: Interval
    tail_speed: Interval
    tail_rate: Fraction

    @property
    def end(self) -> Fraction:
        """``T0``"""
        return self.times[-1]

    def tail(self) -> Range:
        return Range(self.optimum + symmetric(self.tail_distance), self.tail_distance, self.tail_speed)

    def during(self, start: Fraction, end: Fraction) -> Range:
        """From ``start`` to ``end``: the hull over the steps that meet this time, and over the tail if it does."""
        first = bisect_right(self.times, start) - 1
        met = self.steps[first : max(bisect_left(self.times, end), first + 1)]
        ranges = [_together(met)] if met else []
        if end > self.end or not met:
            ranges.append(self.tail())
        distance = maximum(*(entry.distance for entry in ranges))
        y = _both(hull(*(entry.y for entry in ranges)), self.optimum + symmetric(distance))
        return Range(y, distance, maximum(*(entry.speed for entry in ranges)))


def _together(steps: Sequence[Step]) -> Range:
    y = hull(point(min(step.low for step in steps)), point(max(step.high for step in steps)))
    return Range(
        y, *(point(max(sizes)).upper for sizes in ([step.distance for step in steps], [step.speed for step in steps]))
    )


def _both(x: Interval, y: Interval) -> Interval:
    """The common part of two enclosures of one number."""
    lo, hi = max(x.lo, y.lo), min(x.hi, y.hi)
    if lo > hi:
        raise Undecided("two enclosures of one number have nothing in common")
    return between(lo, hi) if (lo, hi) != (x.lo, x.hi) else enclose(x)
