"""Is an expression identically zero? Decided by exact normal forms, with a point where it is not as the witness."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import sympy
from flint import arb

from symbolic.constants import as_rational, enclose
from symbolic.exact_field import field_of
from symbolic.plant import Interval

Box = Mapping[sympy.Symbol, Interval | None]  # None: the whole real line
MAX_OPERATIONS = 400  # above this no general simplification is tried
POINTS = 12


@dataclass(frozen=True)
class ZeroTest:
    """``holds``: identically zero, proved. ``fails``: ``at`` is a point where the value is proved to be nonzero."""

    verdict: str
    at: Mapping[str, str] = field(default_factory=dict)


def normal_form(expr: sympy.Expr) -> sympy.Expr:
    """Quotient of two coprime polynomials in the symbols and the other functions; 0 only for an identity."""
    exact = field_of([expr])
    return exact.expression(exact.element(expr))


def zero_test(expr: sympy.Expr, box: Box | None = None) -> ZeroTest:
    """Decides ``expr ≡ 0`` for rational functions, and for others where the normal form or a simplification suffices.

    ``box`` restricts the witness, not the identity: on a box with an interior both are the same for analytic functions.
    """
    if expr == 0:
        return ZeroTest("holds")
    exact = field_of([expr])
    if exact.domain.is_zero(exact.element(expr)):
        return ZeroTest("holds")
    witness = _nonzero_point(expr, box or {})
    if witness is not None:
        return ZeroTest("fails", witness)
    if expr.count_ops() <= MAX_OPERATIONS and sympy.simplify(expr) == 0:
        return ZeroTest("holds")
    return ZeroTest("unknown")


def sample_points(symbols: Sequence[sympy.Symbol], box: Box) -> Iterator[dict[sympy.Symbol, sympy.Rational]]:
    """Rational points of the box, coordinates that differ; one without an interval runs over small numbers."""
    for k in range(POINTS):
        point = {}
        for j, name in enumerate(symbols):
            interval = box.get(name)
            if interval is None:
                point[name] = sympy.Rational((-1) ** (j + k) * (2 * j + 3 * k + 2), k + 2)
            else:
                share = Fraction(1 + (5 * j + 3 * k) % (POINTS + 1), POINTS + 2)
                point[name] = as_rational(interval.lo + share * (interval.hi - interval.lo))
        yield point


def value_at(expr: sympy.Expr, point: Mapping[sympy.Symbol, sympy.Expr]) -> arb:
    """A ball around the value at an exact point; not finite where the expression is not defined."""
    value = expr.xreplace(dict(point))
    if value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
        return arb("nan")
    return enclose(value)


def printed(point: Mapping[sympy.Symbol, sympy.Expr]) -> dict[str, str]:
    """A point as text, in the order of the names."""
    return {str(name): str(point[name]) for name in sorted(point, key=str)}


def degree_bound(expr: sympy.Expr, symbols: Collection[sympy.Symbol]) -> int:
    """An upper bound on the total degree in the symbols; any other function of them counts as 1."""
    if isinstance(expr, sympy.Add):
        return max(degree_bound(term, symbols) for term in expr.args)
    if isinstance(expr, sympy.Mul):
        return sum(degree_bound(factor, symbols) for factor in expr.args)
    if isinstance(expr, sympy.Pow) and expr.exp.is_Integer:
        return degree_bound(expr.base, symbols) * abs(int(expr.exp))
    return int(not expr.free_symbols.isdisjoint(symbols))


def excerpt(expr: sympy.Expr, length: int = 200) -> str:
    """The expression as text, cut to a length that can be shown."""
    text = str(expr)
    return text if len(text) <= length else text[: length - 1] + "…"


def _nonzero_point(expr: sympy.Expr, box: Box) -> dict[str, str] | None:
    symbols = sorted(expr.free_symbols, key=sympy.default_sort_key)
    for point in sample_points(symbols, box):
        value = value_at(expr, point)
        if value.is_finite() and not value.contains(0):
            return printed(point)
    return None
