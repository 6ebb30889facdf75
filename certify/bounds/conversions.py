"""Exact rationals to outward-rounded balls and back; never through a float."""

from __future__ import annotations

from fractions import Fraction

from flint import arb, ctx, fmpq

from certify.bounds.ranges import Ends
from symbolic.plant import Interval

PRECISION = 128
_LARGEST_EXPONENT = 1 << 20


class NonFiniteError(ArithmeticError):
    """A value is infinite, undefined or too large to be written down as a rational."""


def to_arb(value: Fraction | int | Interval) -> arb:
    """The ball of a rational, or a ball around an interval (looser than its ends by about 1e-9 of the radius)."""
    with ctx.workprec(PRECISION):
        if isinstance(value, Interval):
            return rational_ball(value.lo).union(rational_ball(value.hi))
        return rational_ball(Fraction(value))


def rational_ball(value: Fraction) -> arb:
    """The ball of a rational at the precision that is set."""
    return arb(fmpq(value.numerator, value.denominator))


def ball_power(ball: arb, exponent: int) -> arb:
    """``x^exponent`` for an integer exponent.

    python-flint's ``**`` goes through the logarithm when the middle of a ball is exactly 0, and ends as NaN.
    """
    if exponent <= 0 or not ball.mid().is_zero():
        return ball**exponent
    size = ball.abs_upper() ** exponent
    return size.union(-size if exponent % 2 else arb(0))


def to_ends(value: Fraction | Interval) -> Ends:
    """Exact dyadic ends that enclose a rational or an interval."""
    low, high = (value.lo, value.hi) if isinstance(value, Interval) else (value, value)
    with ctx.workprec(PRECISION):
        return rational_ball(low).lower(), rational_ball(high).upper()


def upper(ball: arb) -> Fraction:
    """An exact rational that is ``>=`` every number in the ball; raises ``NonFiniteError`` if there is none."""
    _require_finite(ball)
    with ctx.workprec(PRECISION):
        return _dyadic(ball.upper(), 1)


def lower(ball: arb) -> Fraction:
    """An exact rational that is ``<=`` every number in the ball; raises ``NonFiniteError`` if there is none."""
    _require_finite(ball)
    with ctx.workprec(PRECISION):
        return _dyadic(ball.lower(), -1)


def _require_finite(ball: arb) -> None:
    if not ball.is_finite():
        raise NonFiniteError("the value is not a finite number")


def _dyadic(end: arb, direction: int) -> Fraction:
    """An exact ball as a rational; magnitudes below ``2^-1048576`` go to zero or, outward, to a tiny number."""
    mantissa, exponent = (int(part) for part in end.man_exp())
    if exponent > _LARGEST_EXPONENT:
        raise NonFiniteError("the value is too large to be written down")
    if exponent < -_LARGEST_EXPONENT - PRECISION:
        outward = mantissa * direction > 0
        return Fraction(direction if outward else 0, 1 << _LARGEST_EXPONENT)
    return Fraction(mantissa << exponent) if exponent >= 0 else Fraction(mantissa, 1 << -exponent)


def to_interval(ball: arb) -> Interval:
    """The interval with exact ends of a ball; raises ``NonFiniteError`` for a ball that is not finite."""
    return Interval(lower(ball), upper(ball))
