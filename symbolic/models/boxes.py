"""Enclosures of expressions on boxes with rational ends: exact where there are sums and products alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction

import sympy
from flint import arb, ctx, fmpq

from symbolic.constants import FUNCTION_BALLS, PRECISION, as_fraction, enclose
from symbolic.errors import InputError
from symbolic.interval import Interval

DIGITS = 12  # of the ends of what is not exact: rounded outwards, and short enough to be read in a plant file
INCREASING = (sympy.exp, sympy.log, sympy.sinh, sympy.tanh, sympy.atan)

Box = Mapping[sympy.Symbol, Interval]


def hull(expr: sympy.Expr, box: Box) -> Interval:
    """An interval that contains every value of the expression on the box.

    The sum of products is tried too, and what both say is kept; for an expression that is affine in the box it is the
    exact range. Raises ``InputError`` where a denominator, or what is under a root or logarithm, may be 0.
    """
    first, second = _hull(expr, box), _hull(sympy.expand(expr), box)
    return Interval(max(first.lo, second.lo), min(first.hi, second.hi))


def _hull(expr: sympy.Expr, box: Box) -> Interval:
    if isinstance(expr, sympy.Rational):
        return _point(as_fraction(expr))
    if not expr.free_symbols:
        return _outward(enclose(expr))
    if isinstance(expr, sympy.Symbol):
        return box[expr]
    if isinstance(expr, sympy.Add):
        parts = [_hull(term, box) for term in expr.args]
        return Interval(sum((p.lo for p in parts), Fraction(0)), sum((p.hi for p in parts), Fraction(0)))
    if isinstance(expr, sympy.Mul):
        product = _point(Fraction(1))
        for factor in expr.args:
            product = _product(product, _hull(factor, box))
        return product
    if isinstance(expr, sympy.Pow) and isinstance(expr.exp, sympy.Integer):
        power = _power(_hull(expr.base, box), abs(int(expr.exp)))
        return power if expr.exp > 0 else _reciprocal(power, expr.base)
    if isinstance(expr, sympy.Pow) and isinstance(expr.exp, sympy.Rational):
        return _root(expr, _hull(expr.base, box))
    if expr.func in FUNCTION_BALLS:
        return _function(expr, _hull(expr.args[0], box))
    raise InputError(f"{expr}: {expr.func.__name__} is no function of plant files")


def _function(expr: sympy.Expr, inner: Interval) -> Interval:
    of_ball = FUNCTION_BALLS[expr.func]
    if expr.func is sympy.log and inner.lo <= 0:
        raise InputError(f"{expr}: its argument is not shown to be positive on the initial box")
    if expr.func in INCREASING:
        return _between(of_ball, inner)
    with ctx.workprec(PRECISION):
        value = of_ball(_ball(inner))
    if not value.is_finite():
        raise InputError(f"{expr}: not shown to be finite on the initial box")
    found = _outward(value)
    if expr.func in (sympy.sin, sympy.cos):
        return Interval(max(found.lo, Fraction(-1)), min(found.hi, Fraction(1)))
    return found


def _root(expr: sympy.Pow, base: Interval) -> Interval:
    """A power with a rational exponent is monotone where its base is positive."""
    if base.lo < 0 or (base.lo == 0 and expr.exp < 0):
        raise InputError(f"{expr}: its base is not shown to be positive on the initial box")
    with ctx.workprec(PRECISION):
        exponent = arb(fmpq(int(expr.exp.p), int(expr.exp.q)))
    return _between(lambda end: end**exponent if end != 0 else arb(0), base)


def _between(of_ball: Callable[[arb], arb], inner: Interval) -> Interval:
    """The range of a monotone function."""
    with ctx.workprec(PRECISION):
        low, high = (_outward(of_ball(_ball(_point(end)))) for end in (inner.lo, inner.hi))
    return Interval(min(low.lo, high.lo), max(low.hi, high.hi))


def _ball(inner: Interval) -> arb:
    low, high = (arb(fmpq(end.numerator, end.denominator)) for end in (inner.lo, inner.hi))
    return low.union(high)


def _outward(ball: arb) -> Interval:
    """The ends of a ball, rounded outwards to a short decimal."""
    ends = []
    for end, up in ((ball.lower(), False), (ball.upper(), True)):
        mantissa, exponent = end.man_exp()
        ends.append(_rounded(Fraction(int(mantissa)) * Fraction(2) ** int(exponent), up))
    return Interval(*ends)


def _rounded(value: Fraction, up: bool) -> Fraction:
    if value == 0:
        return value
    size = len(str(abs(value.numerator))) - len(str(value.denominator))
    unit = Fraction(10) ** (size - DIGITS)
    steps = value / unit
    whole = -((-steps.numerator) // steps.denominator) if up else steps.numerator // steps.denominator
    return whole * unit


def _point(value: Fraction) -> Interval:
    return Interval(value, value)


def _product(a: Interval, b: Interval) -> Interval:
    ends = [x * y for x in (a.lo, a.hi) for y in (b.lo, b.hi)]
    return Interval(min(ends), max(ends))


def _power(base: Interval, exponent: int) -> Interval:
    ends = (base.lo**exponent, base.hi**exponent)
    if exponent % 2 == 0 and base.lo < 0 < base.hi:
        return Interval(Fraction(0), max(ends))
    return Interval(min(ends), max(ends))


def _reciprocal(value: Interval, base: sympy.Expr) -> Interval:
    if value.lo <= 0 <= value.hi:
        raise InputError(f"{base}: not shown to keep away from 0 on the initial box, and something is divided by it")
    return Interval(1 / value.hi, 1 / value.lo)
