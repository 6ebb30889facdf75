"""Enclosures of the derivatives of elementary functions on intervals, exact at the points where they are rational."""

from __future__ import annotations

from fractions import Fraction

from flint import arb

from certify.bounds import intervals
from certify.bounds.balls import NonFiniteError, lower, to_ends, upper
from certify.bounds.monomials import TailTooShort
from certify.bounds.ranges import cosine, sine
from symbolic.plant import Interval


def power_derivative(p: Fraction, k: int, x: Interval) -> Interval:
    factor = Fraction(1)
    for j in range(k):
        factor *= p - j
    if factor == 0:
        return intervals.ZERO
    if x.lo <= 0:
        raise TailTooShort("the binomial series needs a later start")
    return intervals.multiply(intervals.point(factor), intervals.power(x, p - k))


def log_derivative(k: int, x: Interval) -> Interval:
    if x.lo <= 0:
        raise TailTooShort("the series of the logarithm needs a later start")
    if k == 0:
        return intervals.ZERO if x == intervals.ONE else intervals.increasing(arb.log, x)
    factor = Fraction(1)
    for j in range(1, k):
        factor *= -j
    return intervals.multiply(intervals.point(factor), intervals.power(x, Fraction(-k)))


def sine_derivative(k: int, x: Interval) -> Interval:
    """The ``k``-th derivative of the sine."""
    if x == intervals.ZERO:
        return intervals.point((0, 1, 0, -1)[k % 4])
    ends = to_ends(x)
    found = (sine if k % 2 == 0 else cosine)(ends) if ends is not None else None
    if found is None:
        raise NonFiniteError("an angle that is too large")
    value = Interval(lower(found[0]), upper(found[1]))
    return value if k % 4 < 2 else intervals.negate(value)


def atan_derivative(k: int, x: Interval) -> Interval:
    """Enclosures of ``atan`` and its first three derivatives near zero; exact at zero."""
    square = intervals.power(x, Fraction(2))
    inverse = intervals.power(intervals.add(intervals.ONE, square), Fraction(-1))
    if k == 0:
        return intervals.ZERO if x == intervals.ZERO else intervals.increasing(arb.atan, x)
    if k == 1:
        return inverse
    if k == 2:
        return intervals.multiply(intervals.multiply(intervals.point(-2), x), intervals.power(inverse, Fraction(2)))
    if k == 3:
        numerator = intervals.add(intervals.multiply(intervals.point(6), square), intervals.point(-2))
        return intervals.multiply(numerator, intervals.power(inverse, Fraction(3)))
    raise ValueError(f"the derivative of order {k} is not needed")
