"""Enclosures of partial derivatives over a box, by forward-mode differentiation of the expression."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from fractions import Fraction

from certify.checker.expressions import Call, Name, Node, Number, Power, Product, Sum, evaluate
from certify.checker.functions import call
from certify.checker.intervals import Interval, enclose

ONE = Number(Fraction(1))


def slope(function: str, u: Node) -> Node:
    """``f'(u)``."""
    one = (ONE, False)
    match function:
        case "exp":
            return Call("exp", u)
        case "log":
            return Product((one, (u, True)))
        case "sqrt":
            return Product((one, (Number(Fraction(2)), True), (Call("sqrt", u), True)))
        case "sin":
            return Call("cos", u)
        case "cos":
            return Sum(((Call("sin", u), True),))
        case "tan":
            return Sum((one, (Power(Call("tan", u), 2), False)))
        case "sinh" | "cosh":
            return Call("cosh" if function == "sinh" else "sinh", u)
        case "tanh":
            return Power(Call("cosh", u), -2)
        case _:
            return Product((one, (Sum((one, (Power(u, 2), False))), True)))  # atan


class Gradient:
    """A value and its partial derivatives by name; those left out are zero."""

    def __init__(self, value: Interval, partials: Mapping[str, Interval]) -> None:
        self.value = value
        self.partials = partials

    def combine(self, mine: Interval | int, other: Gradient, theirs: Interval | int, value: Interval) -> Gradient:
        """A result whose derivative is ``mine·self' + theirs·other'``."""
        partials = {name: partial * mine for name, partial in self.partials.items()}
        for name, partial in other.partials.items():
            partials[name] = partials[name] + partial * theirs if name in partials else partial * theirs
        return Gradient(value, partials)

    def scaled(self, factor: Interval | int, value: Interval) -> Gradient:
        return Gradient(value, {name: partial * factor for name, partial in self.partials.items()})

    def __neg__(self) -> Gradient:
        return self.scaled(-1, -self.value)

    def __add__(self, other: Gradient) -> Gradient:
        return self.combine(1, other, 1, self.value + other.value)

    def __sub__(self, other: Gradient) -> Gradient:
        return self.combine(1, other, -1, self.value - other.value)

    def __mul__(self, other: Gradient) -> Gradient:
        return self.combine(other.value, other, self.value, self.value * other.value)

    def __truediv__(self, other: Gradient) -> Gradient:
        quotient = self.value / other.value
        inverse = other.value.reciprocal()
        return self.combine(inverse, other, -quotient * inverse, quotient)

    def __pow__(self, exponent: int) -> Gradient:
        value = self.value**exponent
        return self.scaled(exponent * self.value ** (exponent - 1), value) if exponent else Gradient(value, {})


def gradient(node: Node, values: Mapping[str, Interval], wanted: Collection[str]) -> dict[str, Interval]:
    """Enclosures of ``∂node/∂name`` over the box ``values``, for every wanted name.

    Every part of the expression is enclosed on the way, so that a box on which it is not smooth raises ``Undecided``.
    """
    one, duals = Interval(1, 1), {}
    for name, value in values.items():
        duals[name] = Gradient(value, {name: one} if name in wanted else {})

    def apply(function: str, u: Gradient) -> Gradient:
        factor = evaluate(slope(function, Name("u")), {"u": u.value}, enclose, call)
        return u.scaled(factor, call(function, u.value))

    result = evaluate(node, duals, lambda q: Gradient(enclose(q), {}), apply)
    return {name: result.partials.get(name, Interval(0, 0)) for name in wanted}
