"""SymPy expressions, matrices and exact numbers as Typst mathematics.

The text goes into Typst's math mode, where names would be looked up and ``#`` would start code. So nothing of an
expression is passed on as it is: a symbol becomes one letter, a known Greek letter or a quoted string of letters and
digits, with its trailing digits as a subscript, and everything else is written by this printer.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction

import sympy
from sympy.printing.precedence import PRECEDENCE, precedence
from sympy.printing.printer import Printer

from certify.statement.numbers import Shown, shown

GREEK = frozenset(
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi omicron pi rho sigma tau upsilon phi chi"
    " psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega".split()
)
VARIANTS = {
    "vartheta": "theta.alt",
    "varepsilon": "epsilon.alt",
    "varphi": "phi.alt",
    "varsigma": "sigma.alt",
    "varpi": "pi.alt",
}
ACCENTS = {"bar": "overline", "hat": "hat", "tilde": "tilde", "dot": "dot"}
_NAME = re.compile(r"(?P<base>[^\d_]+)_?(?P<index>[A-Za-z0-9_]*)(?P<star>\*?)")
_FUNCTIONS = {"atan": "arctan", "log": "ln"}


def typst(expr: sympy.Expr, names: Mapping[sympy.Symbol, str] | None = None) -> str:
    """The expression in Typst math; ``names`` gives the (trusted) math text of some symbols."""
    return TypstPrinter(names).doprint(expr)


def matrix(rows: Sequence[Sequence[str]]) -> str:
    """A matrix in brackets of entries that are Typst math already."""
    body = "; ".join(", ".join(row) for row in rows)
    return f'mat(delim: "[", {body})'


def column(entries: Sequence[str]) -> str:
    """A column vector of entries that are Typst math already."""
    return matrix([[entry] for entry in entries])


def number(value: Fraction | int | Shown) -> str:
    """A short decimal in Typst math, ``4.217 times 10^44`` for large ones."""
    return number_text((value if isinstance(value, Shown) else shown(value)).text)


def number_text(text: str, inline: bool = False) -> str:
    """The Typst math of a number as :mod:`certify.statement.numbers` writes it: ``-1.5``, ``2/11``, ``4.2e44``."""
    sign = "-" if text.startswith("-") else ""
    body = text.removeprefix("-")
    if "/" in body:
        numerator, denominator = body.split("/")
        return f"{sign}{numerator}\\/{denominator}" if inline else f"{sign}frac({numerator}, {denominator})"
    if "e" in body:
        digits, exponent = body.split("e")
        if exponent == "0":
            return sign + digits
        return f"{sign}10^({exponent})" if digits == "1" else f"{sign}{digits} times 10^({exponent})"
    return sign + body


def dotted(symbol: sympy.Symbol) -> str:
    """The time derivative of a state in Typst math, the dot over its letter: ``dot(z)_(1)``."""
    return symbol_text(symbol.name, "dot")


def symbol_text(name: str, accent: str = "") -> str:
    """A symbol's name in Typst math: ``p12`` → ``p_(12)``, ``theta`` → ``theta``, ``zbar1`` → ``overline(z)_(1)``."""
    match = _NAME.fullmatch(name)
    if match is None:
        return f"{accent}({_quoted(name)})" if accent else _quoted(name)
    text = f"{accent}({_base(match['base'])})" if accent else _base(match["base"])
    index = "".join(_index(part) for part in match["index"].split("_") if part)
    star = "^(star.op)" if match["star"] else ""
    return f"{text}{f'_({index.strip()})' if index else ''}{star}"


def _base(base: str) -> str:
    for accent, command in ACCENTS.items():
        plain = base.removesuffix(accent)
        if plain != base and (len(plain) == 1 or plain in GREEK or plain in VARIANTS):
            return f"{command}({_letters(plain)})"
    return _letters(base)


def _letters(base: str) -> str:
    if base in VARIANTS:
        return VARIANTS[base]
    if base in GREEK or (len(base) == 1 and base.isalpha()):
        return base
    return _quoted(base)


def _index(part: str) -> str:
    return part if part.isdigit() else " " + _letters(part)


def _quoted(text: str) -> str:
    """Upright text; a backslash or quotation mark in it is escaped."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


class TypstPrinter(Printer):
    """Prints what the expression language of plant files can produce, and matrices of it."""

    printmethod = "_typst"

    def __init__(self, names: Mapping[sympy.Symbol, str] | None = None) -> None:
        super().__init__()
        self._names = dict(names or {})

    def emptyPrinter(self, expr: object) -> str:  # the name is SymPy's
        return _quoted(str(expr))

    def _print_Symbol(self, expr: sympy.Symbol) -> str:
        return self._names.get(expr) or symbol_text(expr.name)

    def _print_Dummy(self, expr: sympy.Dummy) -> str:
        return self._print_Symbol(expr)

    def _print_Integer(self, expr: sympy.Integer) -> str:
        return number_text(str(expr.p)) if expr.p.bit_length() < 64 else number(int(expr.p))

    def _print_Rational(self, expr: sympy.Rational) -> str:
        sign = "-" if expr.p < 0 else ""
        return f"{sign}frac({self._print(sympy.Integer(abs(expr.p)))}, {self._print(sympy.Integer(expr.q))})"

    def _print_Float(self, expr: sympy.Float) -> str:
        return number(Fraction(str(expr)))

    def _print_Pi(self, _: object) -> str:
        return "pi"

    def _print_Exp1(self, _: object) -> str:
        return "upright(e)"

    def _print_Add(self, expr: sympy.Add) -> str:
        text = ""
        for term in expr.as_ordered_terms():
            printed = self._print(term)
            if precedence(term) < PRECEDENCE["Add"] and not printed.startswith("-"):
                printed = f"({printed})"
            if printed.startswith("-"):
                text += f" - {printed[1:]}" if text else printed
            else:
                text += f" + {printed}" if text else printed
        return text

    def _print_Mul(self, expr: sympy.Mul) -> str:
        if expr.could_extract_minus_sign():
            positive = self._print(-expr)
            return f"-({positive})" if isinstance(-expr, sympy.Add) else f"-{positive}"
        numerator, denominator = sympy.fraction(expr, exact=True)
        if denominator != 1:
            coefficient, rest = numerator.as_coeff_Mul()
            if isinstance(denominator, sympy.Integer) and rest is not sympy.S.One:
                return f"{self._print(coefficient / denominator)} {self._parenthesised(rest, PRECEDENCE['Mul'])}"
            return f"frac({self._print(numerator)}, {self._print(denominator)})"
        text = ""
        for factor in expr.as_ordered_factors():
            printed = self._parenthesised(factor, PRECEDENCE["Mul"])
            glue = " dot " if text and printed[0].isdigit() else " "
            text = f"{text}{glue}{printed}" if text else printed
        return text

    def _parenthesised(self, expr: sympy.Expr, level: int) -> str:
        printed = self._print(expr)
        return f"({printed})" if precedence(expr) < level else printed

    def _print_Pow(self, expr: sympy.Pow) -> str:
        base, exponent = expr.base, expr.exp
        if exponent.is_Rational and exponent < 0:
            return f"frac(1, {self._print(base**-exponent)})"
        if exponent.is_Rational and exponent.q > 1 and exponent.p == 1:
            radicand = self._print(base)
            return f"sqrt({radicand})" if exponent.q == 2 else f"root({exponent.q}, {radicand})"
        if base is sympy.E:
            return f"upright(e)^({self._print(exponent)})"
        if isinstance(base, sympy.Function) and exponent.is_Integer:
            return self._call(base, f"^({self._print(exponent)})")
        return f"{self._base_of_power(base)}^({self._print(exponent)})"

    def _base_of_power(self, base: sympy.Expr) -> str:
        printed = self._print(base)
        bare = precedence(base) > PRECEDENCE["Pow"] and "^" not in printed
        return printed if bare else f"({printed})"

    def _print_exp(self, expr: sympy.Function) -> str:
        return f"upright(e)^({self._print(expr.args[0])})"

    def _print_Function(self, expr: sympy.Function) -> str:
        return self._call(expr, "")

    def _call(self, expr: sympy.Function, power: str) -> str:
        name = expr.func.__name__
        if name == "sat_delta":
            return f'"sat"_delta ({self._print(expr.args[0])})'
        arguments = ", ".join(self._print(argument) for argument in expr.args)
        if isinstance(expr, sympy.exp):
            return f"(upright(e)^({arguments})){power}"
        return f"op({_quoted(_FUNCTIONS.get(name, name))}){power} ({arguments})"

    def _print_Relational(self, expr: sympy.core.relational.Relational) -> str:
        sign = {"==": "=", "<=": "<=", ">=": ">=", "<": "<", ">": ">", "!=": "!="}[expr.rel_op]
        return f"{self._print(expr.lhs)} {sign} {self._print(expr.rhs)}"

    def _print_MatrixBase(self, expr: sympy.MatrixBase) -> str:
        return matrix([[self._print(entry) for entry in expr.row(k)] for k in range(expr.rows)])

    _print_ImmutableDenseMatrix = _print_MatrixBase
    _print_MutableDenseMatrix = _print_MatrixBase
