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
    output = widen(moment.reference, box[zeros])
    around = increments.zero_ranges(box[:zeros], moment)
    ends = list(known)
    for _ in range(ROUNDS):
        during = tuple([hull(a, b) for a, b in zip(known, ends, strict=True)])
        wanted = _speeds(
            increments, known, ends, [_common(a, b) for a, b in zip(during, around, strict=True)], output, moment
        )
        if not all(isfinite(low) and isfinite(high) for low, high in wanted) or max(map(magnitude, ends)) > WIDEST:
            return None
        if all(
            end[0] <= start[0] + length * low and end[1] >= start[1] + length * high
            for start, end, (low, high) in zip(known, ends, wanted, strict=True)
        ):
            useful = any(a[0] > b[0] or a[1] < b[1] for a, b in zip(during, around, strict=True))
            return (tuple(ends), during) if useful else None
        ends = [_beyond(start, *pair, length) for start, pair in zip(known, wanted, strict=True)]
    return None


def _speeds(
    increments: Increments, known: Ranges, ends: list[Range], zs: list[Range], output: Range, moment: Moment
) -> list[Range]:
    """How fast the lower end of every range has to fall and the upper one to rise."""
    wanted = []
    for k, (start, end) in enumerate(zip(known, ends, strict=True)):
        beside = zs[k]
        zs[k] = _ordered(start[0], end[0])
        low = increments.zero_speed(k, zs, output, moment)[0]
        zs[k] = _ordered(start[1], end[1])
        wanted.append((low, increments.zero_speed(k, zs, output, moment)[1]))
        zs[k] = beside
    return wanted


def _ordered(a: float, b: float) -> Range:
    return (a, b) if a <= b else (b, a)


def _common(a: Range, b: Range) -> Range:
    return max(a[0], b[0]), min(a[1], b[1])


def _beyond(start: Range, low: float, high: float, length: float) -> Range:
    """A little outside of where the ends get to, on a grid of short numbers."""
    extra = length * SHARE * (1 + max(abs(low), abs(high)))
    return (
        floor((start[0] + length * low - extra) / GRAIN) * GRAIN,
        ceil((start[1] + length * high + extra) / GRAIN) * GRAIN,
    )
