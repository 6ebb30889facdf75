"""Slopes of expressions: ``f(x) − f(c) = D·(x − c)`` while one coordinate moves from ``c`` to ``x``.

An algebra for ``expressions.evaluate``; the rules are in section 3 of docs/certificate-direct.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from certify.checker.derivatives import slope
from certify.checker.expressions import Name, Node, Sum, evaluate, names_in
from certify.checker.functions import call
from certify.checker.intervals import Interval, enclose, hull, total
from certify.checker.verdict import spend

ZERO, ONE = Interval(0, 0), Interval(1, 1)


class Slope:
    """Enclosures of the values after and before the move, and of the slope, which is ``None`` where nothing moves."""

    __slots__ = ("c", "d", "x")

    def __init__(self, x: Interval, c: Interval, d: Interval | None = None) -> None:
        self.x, self.c, self.d = x, c, d

    def __neg__(self) -> Slope:
        return Slope(-self.x, -self.c, None if self.d is None else -self.d)

    def __add__(self, other: Slope) -> Slope:
        return _join(self.x + other.x, self.c + other.c, self.d, other.d)

    def __mul__(self, other: Slope) -> Slope:
        """``f'g(x) + f(c)g'``"""
        return _join(
            self.x * other.x,
            self.c * other.c,
            None if self.d is None else self.d * other.x,
            None if other.d is None else self.c * other.d,
        )

    def __truediv__(self, other: Slope) -> Slope:
        return self * other.reciprocal()

    def reciprocal(self) -> Slope:
        """``−f'/(f(x)f(c))``"""
        x, c = self.x.reciprocal(), self.c.reciprocal()
        return _join(x, c, None if self.d is None else -self.d * x * c)

    def __pow__(self, exponent: int) -> Slope:
        """``f'·Σ_(k<m) f(x)^k f(c)^(m−1−k)``"""
        if exponent < 0:
            return self.reciprocal() ** -exponent
        d = None
        if self.d is not None and exponent:
            spend(20 * exponent)
            x, c = ([ONE, base, *(base**k for k in range(2, exponent))] for base in (self.x, self.c))
            d = self.d * total(x[k] * c[exponent - 1 - k] for k in range(exponent))
        return _join(self.x**exponent, self.c**exponent, d)


def _join(x: Interval, c: Interval, *parts: Interval | None) -> Slope:
    """With the sum of the parts as slope; where nothing moves, both values are one number."""
    moving = [part for part in parts if part is not None]
    return Slope(x, c, total(moving)) if moving else Slope(x, x)


def _apply(function: str, f: Slope) -> Slope:
    """``f'·φ'(hull(f(x), f(c)))``"""
    x = call(function, f.x)
    if f.d is None:
        return Slope(x, x)
    derivative = evaluate(slope(function, Name("u")), {"u": hull(f.x, f.c)}, enclose, call)
    return Slope(x, call(function, f.c), f.d * derivative)


class Path:
    """An expression along which the named coordinates move one after the other; its terms are taken one by one."""

    def __init__(self, node: Node, names: Sequence[str]) -> None:
        self.names = names
        self.terms = [(term, names_in(term)) for term in _terms(node)]

    def slopes(self, still: Mapping[str, Interval], moved: Mapping[str, Interval]) -> list[Interval]:
        """One per name, while they go from ``still`` to ``moved``.

        The expression is enclosed where all of them have moved, so that it is smooth there, or ``Undecided`` is raised.
        """
        values, found = {name: Slope(value, value) for name, value in still.items()}, []
        for name in self.names:
            values[name] = Slope(moved[name], still[name], ONE)
            found.append(total(_evaluate(term, values).d or ZERO for term, names in self.terms if name in names))
            values[name] = Slope(moved[name], moved[name])
        for term, names in self.terms:
            if names.isdisjoint(self.names):
                _evaluate(term, values)
        return found


def _terms(node: Node) -> list[Node]:
    if not isinstance(node, Sum):
        return [node]
    return [Sum(((term, True),)) if minus else term for part, minus in node.terms for term in _terms(part)]


def _evaluate(node: Node, values: Mapping[str, Slope]) -> Slope:
    result: Slope = evaluate(node, values, _number, _apply)
    return result


def _number(value: Fraction) -> Slope:
    point = enclose(value)
    return Slope(point, point)
