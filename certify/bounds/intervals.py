"""Interval arithmetic with rational ends: exact on points, outward to short ends on proper intervals."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from flint import arb, ctx

from certify.bounds.balls import PRECISION, NonFiniteError, lower, to_arb, upper
from certify.bounds.rationals import round_down, round_up, sqrt_down, sqrt_up
from symbolic.plant import Interval

ZERO = Interval(Fraction(0), Fraction(0))
ONE = Interval(Fraction(1), Fraction(1))


def point(value: Fraction | int) -> Interval:
    return Interval(Fraction(value), Fraction(value))


def outward(low: Fraction, high: Fraction) -> Interval:
    """The interval, its ends rounded outward to short dyadic numbers unless it is a point."""
    return Interval(low, high) if low == high else Interval(round_down(low), round_up(high))


def add(x: Interval, y: Interval) -> Interval:
    return outward(x.lo + y.lo, x.hi + y.hi)


def negate(x: Interval) -> Interval:
    return Interval(-x.hi, -x.lo)


def multiply(x: Interval, y: Interval) -> Interval:
    products = (x.lo * y.lo, x.lo * y.hi, x.hi * y.lo, x.hi * y.hi)
    return outward(min(products), max(products))


def hull(x: Interval, y: Interval) -> Interval:
    return Interval(min(x.lo, y.lo), max(x.hi, y.hi))


def sign(x: Interval) -> int:
    """1 or −1 when every number in the interval has that sign, else 0."""
    return (x.lo > 0) - (x.hi < 0)


def power(x: Interval, exponent: Fraction) -> Interval:
    """``x^exponent``. Raises ZeroDivisionError or ValueError where it is not a finite real number."""
    if exponent < 0:
        if sign(x) == 0:
            raise ZeroDivisionError(f"[{x.lo}, {x.hi}] contains zero")
        inverse = outward(1 / x.hi, 1 / x.lo)
        return power(inverse, -exponent)
    if exponent.denominator == 1:
        ends = (x.lo**exponent.numerator, x.hi**exponent.numerator)
        low = min(ends) if exponent.numerator % 2 or sign(x) else Fraction(0)
        return outward(low, max(ends)) if exponent else ONE
    if x.lo < 0:
        raise ValueError("a negative number has no real root")
    if exponent.denominator == 2:
        root = outward(sqrt_down(x.lo), sqrt_up(x.hi))
        return power(root, Fraction(exponent.numerator))
    with ctx.workprec(PRECISION):
        ends_as_balls = [to_arb(end).root(exponent.denominator) ** exponent.numerator for end in (x.lo, x.hi)]
    return outward(max(lower(ends_as_balls[0]), Fraction(0)), upper(ends_as_balls[1]))


def increasing(function: Callable[[arb], arb], x: Interval) -> Interval:
    """The image of an interval under an increasing function. Raises NonFiniteError where it is not finite."""
    with ctx.workprec(PRECISION):
        ends = function(to_arb(x.lo)), function(to_arb(x.hi))
    if not (ends[0].is_finite() and ends[1].is_finite()):
        raise NonFiniteError(f"not finite on [{x.lo}, {x.hi}]")
    low, high = lower(ends[0]), upper(ends[1])
    return Interval(low, high) if low == high else outward(low, high)


def simplest_between(low: Fraction, high: Fraction) -> Fraction:
    """The rational with the smallest denominator in ``[low, high]`` (the walk down the Stern–Brocot tree)."""
    if low > high:
        raise ValueError(f"[{low}, {high}] is empty")
    if low <= 0 <= high:
        return Fraction(0)
    if high < 0:
        return -simplest_between(-high, -low)
    whole = low.numerator // low.denominator
    if whole == low:
        return Fraction(whole)
    if whole + 1 <= high:
        return Fraction(whole + 1)
    return whole + 1 / simplest_between(1 / (high - whole), 1 / (low - whole))
