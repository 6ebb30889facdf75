"""Derivatives along one variable, ``(f, f', f'', …)``, in any enclosing scalars with ``+ * / **``.

They follow the expression as it is written: nothing is expanded, so that ``(s − 3)²`` stays a tight square.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import comb
from typing import Any

from certify.checker import functions
from certify.checker.derivatives import slope
from certify.checker.expressions import Name, Node, evaluate
from certify.checker.intervals import enclose
from certify.checker.verdict import spend

Number = Callable[[Any], Any]
Function = Callable[[str, Any], Any]


class Jet:
    """A value and as many derivatives as all jets of a computation have."""

    __slots__ = ("parts",)

    def __init__(self, *parts: Any) -> None:
        self.parts = parts

    @property
    def truncated(self) -> Jet:
        """Without the last derivative."""
        return Jet(*self.parts[:-1])

    @property
    def derivative(self) -> Jet:
        return Jet(*self.parts[1:])

    def __neg__(self) -> Jet:
        return Jet(*(-part for part in self.parts))

    def __add__(self, other: Jet) -> Jet:
        return Jet(*(a + b for a, b in zip(self.parts, other.parts, strict=True)))

    def __mul__(self, other: Jet) -> Jet:
        """``(fg)^(k) = Σ_j C(k, j) f^(j) g^(k−j)``"""
        a, b, result = self.parts, other.parts, []
        spend(60 * len(a) ** 2)
        for k in range(len(a)):
            first, *rest = (comb(k, j) * (a[j] * b[k - j]) for j in range(k + 1))
            result.append(sum(rest, first))
        return Jet(*result)

    def __truediv__(self, other: Jet) -> Jet:
        return self * other**-1

    def __pow__(self, exponent: int) -> Jet:
        """``(f^m)' = m f^(m−1) f'``"""
        value = self.parts[0] ** exponent
        if len(self.parts) == 1:
            return Jet(value)
        factor = self.truncated ** (exponent - 1) if exponent else self.truncated
        return Jet(value, *(exponent * part for part in (factor * self.derivative).parts))


def jet(node: Node, s: Any, order: int, number: Number = enclose, call: Function = functions.call) -> tuple[Any, ...]:
    """The derivatives of the expression in ``s`` up to the order, where ``s`` is the scalar given."""
    rest = [number(Fraction(int(k == 1))) for k in range(1, order + 1)]
    return _evaluated(node, "s", Jet(s, *rest), number, call).parts


def _evaluated(node: Node, name: str, u: Jet, number: Number, call: Function) -> Jet:
    zeros = [number(Fraction(0)) for _ in u.parts[1:]]

    def apply(function: str, v: Jet) -> Jet:
        """``φ(v)' = φ'(v) v'``"""
        spend(400)
        value = call(function, v.parts[0])
        if len(v.parts) == 1:
            return Jet(value)
        outer = _evaluated(slope(function, Name("u")), "u", v.truncated, number, call)
        return Jet(value, *(outer * v.derivative).parts)

    result: Jet = evaluate(node, {name: u}, lambda value: Jet(number(value), *zeros), apply)
    return result
