"""Between this package's numbers and python-flint's balls, which only the rules of direct/3 use.

A comparison of balls holds only if it holds for all their members; one with a ball that is not finite never holds.
"""

from __future__ import annotations

from fractions import Fraction

from flint import arb, arb_mat, ctx, fmpq, fmpq_mat

from certify.checker.intervals import Interval
from certify.checker.linear import Matrix
from certify.checker.verdict import Undecided, show

BITS = 128

precision = ctx.workprec


def ball(value: Fraction) -> arb:
    return arb(fmpq(value.numerator, value.denominator))


def above(value: Interval) -> arb:
    """The upper end, exactly."""
    return arb((value.b, value.e))


def interval(x: arb) -> Interval:
    """The least interval around a ball (after rounding). Raises ``Undecided`` if it is not finite."""
    if not x.is_finite():
        raise Undecided("a ball that is not finite")
    middle, exponent = map(int, x.mid().man_exp())
    radius, scale = map(int, x.rad().man_exp())
    return Interval(middle, middle, exponent) + Interval(-radius, radius, scale)


def middle(x: arb) -> arb:
    """The exact middle of a ball. Raises ``Undecided`` if it is not finite."""
    if not x.is_finite():
        raise Undecided("a ball that is not finite")
    return x.mid()


def shown(x: arb) -> str:
    """The upper end of a ball, for a message."""
    return show(interval(x).hi) if x.is_finite() else str(x)


def exact(A: Matrix) -> fmpq_mat:
    return fmpq_mat(len(A), len(A[0]), [fmpq(entry.numerator, entry.denominator) for row in A for entry in row])


def balls(A: fmpq_mat) -> arb_mat:
    """A matrix of balls around the rational entries."""
    return arb_mat(A)
