"""Float intervals for the search: estimates with a margin, never bounds."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from flint import arb

from certify.bounds import secants
from certify.bounds.balls import Program
from symbolic.plant import Interval

Range = tuple[float, float]


def floats(side: Interval) -> Range:
    return float(side.lo), float(side.hi)


def hull(first: Range, second: Range) -> Range:
    return min(first[0], second[0]), max(first[1], second[1])


def meet(first: Range, second: Range) -> Range:
    """What lies in both; ``first`` where float errors leave nothing."""
    low, high = max(first[0], second[0]), min(first[1], second[1])
    return (low, high) if low <= high else first


def widen(side: Range, by: float) -> Range:
    return side[0] - by, side[1] + by


def symmetric(bound: float) -> Range:
    return -bound, bound


def magnitude(side: Range) -> float:
    return max(abs(side[0]), abs(side[1]))


def enclose(program: Program, box: Sequence[Range]) -> Range:
    """The natural interval extension; the whole line where it is not defined."""
    ends = program.ends([(arb(lo), arb(hi)) for lo, hi in box])
    return (-inf, inf) if ends is None else (float(ends[0]), float(ends[1]))


def secant(program: Program, box: Sequence[Range], index: int, centre: Range) -> Range:
    """The slope along input ``index`` from ``centre`` to ``box[index]``; the whole line where it is not defined."""
    sides = [(arb(lo), arb(hi)) for lo, hi in box]
    ends = secants.secant(program, sides, index, (arb(centre[0]), arb(centre[1])))
    return (-inf, inf) if ends is None else (float(ends[0]), float(ends[1]))
