"""Does a function keep away from zero on a box? Rational intervals with unbounded ends, and Sturm's theorem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice, product

import sympy

from symbolic.constants import as_fraction, as_rational, enclose
from symbolic.identity import Box, printed, sample_points, value_at
from symbolic.plant import Interval

Range = tuple[Fraction | None, Fraction | None]  # closed; None is an unbounded end
EVERYTHING: Range = (None, None)
_ZERO: Range = (Fraction(0), Fraction(0))
MAX_BOXES = 400
MAX_CORNERS = 256
_LINE_SAMPLES = (Fraction(0), Fraction(1), Fraction(-1), Fraction(10), Fraction(-10))
_FUNCTION_RANGES: dict[type, Range] = {
    sympy.sin: (Fraction(-1), Fraction(1)),
    sympy.cos: (Fraction(-1), Fraction(1)),
    sympy.tanh: (Fraction(-1), Fraction(1)),
    sympy.atan: (Fraction(-2), Fraction(2)),
    sympy.exp: (Fraction(0), None),
    sympy.cosh: (Fraction(1), None),
}
_INCREASING = (sympy.exp, sympy.sinh, sympy.tanh, sympy.atan)


@dataclass(frozen=True)
class Nonvanishing:
    """``holds``: no zero on the box. ``fails``: a zero exists; ``at`` is one, or two points with different signs."""

    verdict: str
    reason: str = ""
    at: tuple[Mapping[str, str], ...] = field(default=())


def nonvanishing(expr: sympy.Expr, box: Box) -> Nonvanishing:
    """Is ``expr ≠ 0`` everywhere on the box (an ``Interval`` or ``None`` = the real line for every symbol)?

    Irreducible factors are decided one by one: one variable by Sturm's theorem, several by interval arithmetic
    with bisection; zeros are shown by exact values or a change of sign on the (connected) box.
    """
    unknown: Nonvanishing | None = None
    for factor in _factors(expr):
        answer = _factor_nonvanishing(factor, box)
        if answer.verdict == "fails":
            return answer
        if answer.verdict == "unknown":
            unknown = answer
    return unknown or Nonvanishing("holds")


def enclosure(expr: sympy.Expr, box: Mapping[sympy.Symbol, Range]) -> Range:
    """An interval that contains every value of the expression on the box."""
    if isinstance(expr, sympy.Symbol):
        return box[expr]
    if isinstance(expr, sympy.Rational):
        value = as_fraction(expr)
        return value, value
    if not expr.free_symbols:
        return _constant(expr)
    if isinstance(expr, sympy.Add):
        result = _ZERO
        for term in expr.args:
            result = _sum(result, enclosure(term, box))
        return result
    if isinstance(expr, sympy.Mul):
        result = (Fraction(1), Fraction(1))
        for factor in expr.args:
            result = _product(result, enclosure(factor, box))
        return result
    if isinstance(expr, sympy.Pow) and isinstance(expr.exp, sympy.Integer):
        power = _power(enclosure(expr.base, box), abs(int(expr.exp)))
        return power if expr.exp > 0 else _reciprocal(power)
    if isinstance(expr, sympy.Pow) and isinstance(expr.exp, sympy.Rational):
        return Fraction(0), None
    least, greatest = _FUNCTION_RANGES.get(expr.func, EVERYTHING)
    if expr.func in _INCREASING:
        lo, hi = enclosure(expr.args[0], box)
        least = least if lo is None else _constant(expr.func(as_rational(lo)))[0]
        greatest = greatest if hi is None else _constant(expr.func(as_rational(hi)))[1]
    return least, greatest


def as_range(interval: Interval | None) -> Range:
    return EVERYTHING if interval is None else (interval.lo, interval.hi)


def _factors(expr: sympy.Expr) -> list[sympy.Expr]:
    if isinstance(expr, sympy.Mul):
        return [factor for part in expr.args for factor in _factors(part)]
    if isinstance(expr, sympy.exp):
        return []
    if not expr.free_symbols or not expr.is_polynomial(*expr.free_symbols) or expr.has(sympy.Function):
        return [expr]
    content, factors = sympy.factor_list(expr)
    return [content, *(factor for factor, _ in factors)]


def _factor_nonvanishing(factor: sympy.Expr, box: Box) -> Nonvanishing:
    symbols = sorted(factor.free_symbols, key=sympy.default_sort_key)
    if len(symbols) == 1 and factor.is_rational_function(symbols[0]):
        poly = sympy.Poly(factor, symbols[0])
        interval = box[symbols[0]]
        if poly.domain.is_ZZ or poly.domain.is_QQ:
            ends = (None, None) if interval is None else (as_rational(interval.lo), as_rational(interval.hi))
            if poly.count_roots(*ends) == 0:
                return Nonvanishing("holds")
    zero = _zero(factor, symbols, box)
    if zero is not None:
        return zero
    if _kept_away(factor, [(name, as_range(box[name])) for name in symbols]):
        return Nonvanishing("holds")
    return Nonvanishing("unknown", f"{factor} could not be shown to have no zero")


def _zero(factor: sympy.Expr, symbols: list[sympy.Symbol], box: Box) -> Nonvanishing | None:
    """A point of the box where the factor is exactly zero, or two where its signs differ."""
    signs: dict[int, dict[sympy.Symbol, sympy.Rational]] = {}
    for point in [*grid(symbols, box), *sample_points(symbols, box)]:
        if factor.xreplace(point).is_zero:
            return Nonvanishing("fails", f"{factor} vanishes", (printed(point),))
        ball = value_at(factor, point)
        if ball.is_finite() and not ball.contains(0):
            signs.setdefault(1 if ball > 0 else -1, point)
    if len(signs) == 2 and factor.is_polynomial(*symbols):
        return Nonvanishing("fails", f"{factor} changes its sign", (printed(signs[-1]), printed(signs[1])))
    return None


def grid(symbols: list[sympy.Symbol], box: Box) -> list[dict[sympy.Symbol, sympy.Rational]]:
    """Ends, middle and zero of every interval, in all combinations as far as they are few."""
    axes = [
        _LINE_SAMPLES
        if (interval := box[name]) is None
        else (
            interval.lo,
            interval.hi,
            (interval.lo + interval.hi) / 2,
            *([Fraction(0)] if interval.lo < 0 < interval.hi else []),
        )
        for name in symbols
    ]
    return [
        {name: as_rational(value) for name, value in zip(symbols, values, strict=True)}
        for values in islice(product(*axes), MAX_CORNERS)
    ]


def _kept_away(factor: sympy.Expr, axes: list[tuple[sympy.Symbol, Range]]) -> bool:
    """Bisects the bounded coordinates until every enclosure excludes zero, within ``MAX_BOXES`` boxes."""
    pending, done = [dict(axes)], 0
    while pending:
        done += 1
        if done > MAX_BOXES:
            return False
        box = pending.pop()
        lo, hi = enclosure(factor, box)
        if (lo is not None and lo > 0) or (hi is not None and hi < 0):
            continue
        widths = {name: end[1] - end[0] for name, end in box.items() if end[0] is not None and end[1] is not None}
        widest = max(widths, key=lambda name: widths[name], default=None)
        if widest is None or widths[widest] == 0:
            return False
        low, high = box[widest]
        assert low is not None and high is not None
        middle = (low + high) / 2
        pending += [box | {widest: (low, middle)}, box | {widest: (middle, high)}]
    return True


def _constant(expr: sympy.Expr) -> Range:
    ball = enclose(expr)
    if not ball.is_finite():
        return EVERYTHING
    (lo, lo_exp), (hi, hi_exp) = ball.lower().man_exp(), ball.upper().man_exp()
    return Fraction(int(lo)) * Fraction(2) ** int(lo_exp), Fraction(int(hi)) * Fraction(2) ** int(hi_exp)


def _sum(a: Range, b: Range) -> Range:
    lo = None if a[0] is None or b[0] is None else a[0] + b[0]
    hi = None if a[1] is None or b[1] is None else a[1] + b[1]
    return lo, hi


def _product(a: Range, b: Range) -> Range:
    if _ZERO in (a, b):
        return _ZERO
    if None not in a and None not in b:
        ends = [x * y for x in a for y in b if x is not None and y is not None]
        return min(ends), max(ends)
    if _nonnegative(a) and _nonnegative(b):
        assert a[0] is not None and b[0] is not None
        return a[0] * b[0], None
    if _nonnegative(_negated(a)):
        return _negated(_product(_negated(a), b))
    if _nonnegative(_negated(b)):
        return _negated(_product(a, _negated(b)))
    return EVERYTHING


def _power(a: Range, exponent: int) -> Range:
    if exponent % 2 == 1:
        return (None if a[0] is None else a[0] ** exponent, None if a[1] is None else a[1] ** exponent)
    ends = [None if end is None else abs(end) ** exponent for end in a]
    upper = None if None in ends else max(end for end in ends if end is not None)
    inside = (a[0] is None or a[0] <= 0) and (a[1] is None or a[1] >= 0)
    return Fraction(0) if inside else min(end for end in ends if end is not None), upper


def _reciprocal(a: Range) -> Range:
    lo, hi = a
    if lo is not None and lo > 0:
        return (Fraction(0) if hi is None else 1 / hi), 1 / lo
    if hi is not None and hi < 0:
        return _negated(_reciprocal(_negated(a)))
    return EVERYTHING


def _negated(a: Range) -> Range:
    return (None if a[1] is None else -a[1], None if a[0] is None else -a[0])


def _nonnegative(a: Range) -> bool:
    return a[0] is not None and a[0] >= 0
