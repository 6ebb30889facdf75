"""Ranges of the zero dynamics' states themselves, beside those of ``z̄`` (docs/certificate-direct.md section 4).

``z̄(0) = z(0) − z*`` is large where the steady state is, though ``z(0)`` is not: products with ``z`` would be bounded by
a value that ``z`` reaches only later.
"""

from __future__ import annotations

from math import ceil, floor, isfinite

from certify.tube.increments import Bounds, Increments, Ranges
from certify.tube.ranges import Range, hull, magnitude, widen
from certify.tube.surroundings import Moment

ROUNDS = 12
GRAIN = 2.0**-24
SHARE = 1e-3
WIDEST = 1e6


def move(
    increments: Increments, known: Ranges, box: Bounds, moment: Moment, length: float
) -> tuple[Ranges, Ranges] | None:
    """Ranges at the end of a step and during it; ``None`` when none are found or they no longer say anything.

    ``box`` begins with magnitudes of ``z̄, x̄``. Each end moves on a straight line that is faster than the flow on its
    face: ``β' ≥ sup f0_k`` over ``z_k ∈ [β(a), β(b)]`` (Müller).
    """
    zeros = increments.zeros
    others = (widen(moment.reference, box[zeros]), *moment.v)
    around = increments.zero_ranges(box[:zeros], moment)
    ends = known
    for _ in range(ROUNDS):
        during = tuple([hull(a, b) for a, b in zip(known, ends, strict=True)])
        zs = [_common(a, b) for a, b in zip(during, around, strict=True)]
        wanted = _speeds(increments, known, ends, zs, others)
        if not all(isfinite(high - low) for low, high in wanted) or max(map(magnitude, ends)) > WIDEST:
            return None
        reached = [
            (start[0] + length * low, start[1] + length * high)
            for start, (low, high) in zip(known, wanted, strict=True)
        ]
        if all(end[0] <= low and end[1] >= high for end, (low, high) in zip(ends, reached, strict=True)):
            useful = any(a[0] > b[0] or a[1] < b[1] for a, b in zip(during, around, strict=True))
            return (ends, during) if useful else None
        ends = tuple([_beyond(side, *pair, length) for side, pair in zip(reached, wanted, strict=True)])
    return None


def _speeds(
    increments: Increments, known: Ranges, ends: Ranges, zs: list[Range], others: tuple[Range, ...]
) -> list[Range]:
    """How fast the lower end of every range has to fall and the upper one to rise."""
    wanted = []
    for k, (start, end) in enumerate(zip(known, ends, strict=True)):
        beside = zs[k]
        zs[k] = _ordered(start[0], end[0])
        low = increments.zero_speed(k, zs, others)[0]
        zs[k] = _ordered(start[1], end[1])
        wanted.append((low, increments.zero_speed(k, zs, others)[1]))
        zs[k] = beside
    return wanted


def _ordered(a: float, b: float) -> Range:
    return (a, b) if a <= b else (b, a)


def _common(a: Range, b: Range) -> Range:
    return max(a[0], b[0]), min(a[1], b[1])


def _beyond(reached: Range, low: float, high: float, length: float) -> Range:
    """A little outside of where the ends get to, on a grid of short numbers."""
    extra = length * SHARE * (1 + max(abs(low), abs(high)))
    return floor((reached[0] - extra) / GRAIN) * GRAIN, ceil((reached[1] + extra) / GRAIN) * GRAIN
