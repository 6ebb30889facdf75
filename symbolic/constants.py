"""Enclosures of exact real constants such as ``sqrt(2)/3`` or ``exp(1)`` by outward-rounded balls."""

from __future__ import annotations

from fractions import Fraction

import sympy
from flint import arb, ctx, fmpq

PRECISION = 256
LARGEST = arb(2) ** 10_000
LARGEST_EXPONENT = 3010  # of ten, for messages

FUNCTION_BALLS = {
    sympy.sin: arb.sin,
    sympy.cos: arb.cos,
    sympy.tan: arb.tan,
    sympy.exp: arb.exp,
    sympy.log: arb.log,
    sympy.tanh: arb.tanh,
    sympy.atan: arb.atan,
    sympy.sinh: arb.sinh,
    sympy.cosh: arb.cosh,
}


def enclose(expr: sympy.Expr) -> arb:
    """A ball around the value of a constant expression; not finite when no finite real value is seen.

    Raises ``ValueError`` for anything but sums, products, rational powers and the functions of plant files on
    rationals, π and e.
    """
    with ctx.workprec(PRECISION):
        return _ball(expr)


def as_fraction(number: sympy.Rational) -> Fraction:
    return Fraction(int(number.p), int(number.q))


def as_rational(number: Fraction) -> sympy.Rational:
    return sympy.Rational(number.numerator, number.denominator)


def _ball(expr: sympy.Expr) -> arb:
    if isinstance(expr, sympy.Rational):
        return arb(fmpq(int(expr.p), int(expr.q)))
    if expr is sympy.pi:
        return arb.pi()
    if expr is sympy.E:
        return arb(1).exp()
    if isinstance(expr, sympy.Add):
        return sum((_ball(term) for term in expr.args), arb(0))
    if isinstance(expr, sympy.Mul):
        product = arb(1)
        for factor in expr.args:
            product *= _ball(factor)
        return product
    if isinstance(expr, sympy.Pow) and isinstance(expr.exp, sympy.Rational):
        root = _ball(expr.base).root(int(expr.exp.q)) if expr.exp.q > 2 else _ball(expr.base)
        root = root.sqrt() if expr.exp.q == 2 else root
        power = _power(root, abs(int(expr.exp.p)))
        return 1 / power if expr.exp.p < 0 else power
    if expr.func in FUNCTION_BALLS:
        return FUNCTION_BALLS[expr.func](_ball(expr.args[0]))
    raise ValueError(f"{expr.func.__name__} is not part of an exact constant")


def _power(base: arb, exponent: int) -> arb:
    """By squaring: ``arb.__pow__`` knows nothing of a ball whose middle is 0."""
    if exponent == 0:
        return arb(1)
    half = _power(base, exponent // 2)
    return half * half * base if exponent % 2 else half * half
