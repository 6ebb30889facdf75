"""Expressions as texts that ``symbolic.expressions`` reads back as the same expressions."""

from __future__ import annotations

from fractions import Fraction

import sympy
from sympy.core.function import AppliedUndef
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

LONGEST_DECIMAL = 12  # digits; a longer number is easier to read as a fraction


class _PlantPrinter(StrPrinter):
    """SymPy's own notation, but for ``e``, which the language has no name for, and for products.

    Of a product every divisor stands for itself, ``1/3/(x + 1)``: SymPy's ``1/(3*(x + 1))`` would be multiplied out.
    """

    def _print_Mul(self, expr: sympy.Expr) -> str:
        coefficient, rest = expr.as_coeff_Mul(rational=True)
        above: list[sympy.Expr] = []
        below: list[sympy.Expr] = []
        for factor in sympy.Mul.make_args(rest):
            divides = factor.is_Pow and factor.exp.is_Rational and factor.exp < 0
            (below if divides else above).append(1 / factor if divides else factor)
        if below and any(item.is_Mul for item in below):  # never seen: SymPy would have split it
            return str(super()._print_Mul(expr))
        sign, coefficient = ("-" if coefficient < 0 else ""), abs(coefficient)
        parts = [self.parenthesize(item, PRECEDENCE["Mul"], strict=item.is_Mul) for item in above]
        if coefficient.p != 1 or not parts or (sign and above[0].is_Add):  # -(x + 1)*y would read as (-x - 1)*y
            parts.insert(0, str(coefficient.p))
        divisors = [str(coefficient.q)] if coefficient.q != 1 else []
        divisors += [self.parenthesize(item, PRECEDENCE["Mul"]) for item in below]
        return sign + "/".join(["*".join(parts), *divisors])

    def _print_Exp1(self, expr: sympy.Expr) -> str:
        return "exp(1)"


def expression_text(expr: sympy.Expr) -> str:
    """The expression in the language of plant files; what the language lacks stands as SymPy calls it.

    A ``Float`` is the shortest decimal that stands for it (what Python prints), as numbers of plant files are.
    """
    return str(
        _PlantPrinter().doprint(expr.xreplace({number: float_value(number) for number in expr.atoms(sympy.Float)}))
    )


def without_time(expr: sympy.Expr) -> sympy.Expr:
    """Functions of time ``q(t)``, as equations of motion have them, as the symbols ``q``."""
    functions = [part for part in expr.atoms(AppliedUndef) if len(part.args) == 1]
    return expr.xreplace({part: sympy.Symbol(part.func.__name__) for part in functions})


def float_value(number: sympy.Float) -> sympy.Rational:
    """The exact value of the shortest decimal for a SymPy float."""
    return sympy.Rational(repr(float(number)) if number._prec == 53 else str(number))


def number_text(value: Fraction) -> str:
    """A rational number as TOML: an integer, a short decimal, else a string ``"p/q"``."""
    if value.denominator == 1:
        return str(value.numerator) if abs(value.numerator) < 2**63 else f'"{value.numerator}"'
    digits = _decimal_digits(value)
    return f'"{value}"' if digits is None else digits


def _decimal_digits(value: Fraction) -> str | None:
    """The terminating decimal of at most ``LONGEST_DECIMAL`` digits, if there is one."""
    places = 0
    scaled = abs(value)
    while scaled.denominator != 1:
        scaled *= 10
        places += 1
        if places > LONGEST_DECIMAL:
            return None
    digits = str(scaled.numerator).rjust(places + 1, "0")
    if len(digits) > LONGEST_DECIMAL:
        return None
    return f"{'-' if value < 0 else ''}{digits[:-places]}.{digits[-places:]}"
