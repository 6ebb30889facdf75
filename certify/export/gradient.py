"""The slope of a cost as statements in floating point (docs/export.md, gradient)."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import sympy
from flint import ctx

from certify.bounds.balls import compile_expression
from certify.export.formats import DOUBLE, PRECISION, Constant, Exact, constant
from certify.export.statements import Let
from symbolic.errors import InputError
from symbolic.plant import COST_VARIABLE

FUNCTIONS = {"sin", "cos", "tan", "exp", "log", "tanh", "atan", "sinh", "cosh"}
LARGEST_POWER = 64


def gradient(cost: sympy.Expr) -> tuple[tuple[Constant, ...], tuple[Let, ...]]:
    """``slope = c'(s)``, in doubles; the last statement is named ``slope``.

    A polynomial is evaluated by Horner's rule, anything else as SymPy has differentiated it. Raises ``InputError`` for
    an expression that has no such form.
    """
    slope = sympy.diff(cost, COST_VARIABLE)
    polynomial = slope.as_poly(COST_VARIABLE)
    writer = ExpressionWriter({COST_VARIABLE: "s"})
    if polynomial is not None and not polynomial.degree() > LARGEST_POWER:
        result = _horner(writer, polynomial)
    else:
        result = writer.write(slope)
    return tuple(writer.constants), (*writer.statements, Let("slope", result, "c'(s)"))


def _horner(writer: ExpressionWriter, polynomial: sympy.Poly) -> str:
    """``c_n s + c_(n−1)``, then times ``s`` and so on."""
    result = ""
    for k, coefficient in enumerate(polynomial.all_coeffs()):
        if k:
            result = f"{result} * s" if k == 1 else f"({result}) * s"
        if coefficient != 0:
            name = writer.constant(coefficient)
            result = f"{result} + {name}" if result else name
    return result


class ExpressionWriter:
    """Collects constants and statements while expressions in the given symbols are written from the inside out."""

    def __init__(self, names: Mapping[sympy.Symbol, str], meaning: str = "of the cost's slope") -> None:
        self.constants: list[Constant] = []
        self.statements: list[Let] = []
        self.meaning = meaning
        self._known: dict[sympy.Expr, str] = dict(names)

    def constant(self, value: sympy.Expr) -> str:
        if value not in self._known:
            name = f"C_{len(self.constants) + 1}"
            self.constants.append(constant(name, self.meaning, _exact(value), DOUBLE))
            self._known[value] = name
        return self._known[value]

    def let(self, expression: str) -> str:
        name = f"t{len(self.statements) + 1}"
        self.statements.append(Let(name, expression))
        return name

    def write(self, node: sympy.Expr) -> str:
        """The name of a statement or constant that holds the value of the node."""
        if not node.free_symbols:
            return self.constant(node)
        if node not in self._known:
            self._known[node] = self._written(node)
        return self._known[node]

    def _written(self, node: sympy.Expr) -> str:
        if isinstance(node, sympy.Add):
            return self.let(" + ".join(self.write(part) for part in node.as_ordered_terms()))
        if isinstance(node, sympy.Mul):
            factor, rest = node.as_coeff_Mul()
            parts = [self.write(part) for part in rest.as_ordered_factors()]
            return self.let(" * ".join(parts if factor == 1 else [self.constant(factor), *parts]))
        if isinstance(node, sympy.Pow):
            return self._power(*node.as_base_exp())
        name = type(node).__name__
        if isinstance(node, sympy.Function) and name in FUNCTIONS:
            return self.let(f"{name}({self.write(node.args[0])})")
        raise InputError(f"{self.meaning}: {name} is not exported")

    def _power(self, base: sympy.Expr, exponent: sympy.Expr) -> str:
        if base == sympy.E:
            return self.let(f"exp({self.write(exponent)})")
        if not isinstance(exponent, sympy.Rational) or abs(exponent) > LARGEST_POWER:
            raise InputError(f"{self.meaning}: a power that is not exported")
        if exponent.q > 2:
            inner = self.let(f"log({self.write(base)})")
            return self.let(f"exp({self.constant(exponent)} * {inner})")
        value = self.write(base)
        if exponent.q == 2:
            value = self.let(f"sqrt({value})")
        count = abs(int(exponent.p))
        result = self._times(value, count)
        return result if exponent > 0 else self.let(f"{self.constant(sympy.S.One)} / {result}")

    def _times(self, value: str, count: int) -> str:
        """By squaring."""
        if count == 1:
            return value
        half = self._times(value, count // 2)
        square = self.let(f"{half} * {half}")
        return square if count % 2 == 0 else self.let(f"{square} * {value}")


def _exact(value: sympy.Expr) -> Exact:
    if isinstance(value, sympy.Rational):
        return Fraction(int(value.p), int(value.q))
    try:
        with ctx.workprec(PRECISION):
            return compile_expression(value, ())([])
    except (ValueError, ArithmeticError) as error:
        raise InputError(f"the slope of the cost has a constant that cannot be enclosed: {error}") from error
