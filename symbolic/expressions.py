"""Expressions of plant files as exact SymPy expressions, with the cost bounded before SymPy evaluates anything.

SymPy computes constant powers and merges coefficients as soon as it is given them, so every node carries an upper
bound on its total degree, on the number of terms of its expansion and on the bits of its coefficients; a node that
would pass a bound is refused unbuilt. Constants also carry a ball, so that ``log(0)`` or ``sqrt(-1)`` is refused too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import islice

import sympy
from flint import arb

from symbolic import messages
from symbolic.constants import FUNCTION_BALLS, LARGEST, LARGEST_EXPONENT, as_fraction, as_rational, enclose
from symbolic.errors import InputError, Problem, Where, did_you_mean, quoted, shown
from symbolic.grammar import CONSTANTS, Call, ExpressionError, Name, Negative, Node, Number, Power, Product, Sum, parse
from symbolic.guards import Guard, of_denominator, of_function, of_power
from symbolic.messages import Reason
from symbolic.plant import symbol
from symbolic.rational_value import folded
from symbolic.size import MAX_EXPONENT, MAX_ROOT, MAX_ROOT_BITS, Size, size_of_power, size_of_product, size_of_sum

Names = Mapping[str, sympy.Expr] | Set[str]
Refusal = Callable[[str], Reason | None]

MAX_UNKNOWN = 5  # names of one expression that are complained of
MAX_HEIGHT = 20  # of a constant; SymPy decides its sign in time that can double with every level

_BUILT_IN = dict(zip(CONSTANTS, (sympy.pi,), strict=True))
_FUNCTIONS = {f.__name__: f for f in FUNCTION_BALLS} | {"sqrt": sympy.sqrt}
_ATOMS = (sympy.Symbol, sympy.Rational, type(sympy.pi), type(sympy.E))
_HEADS = (sympy.Add, sympy.Mul, sympy.Pow, *FUNCTION_BALLS)


def unrefused(name: str) -> None:
    """No name is known elsewhere."""


@dataclass(frozen=True)
class Written:
    """An expression, and under which conditions every part of its text is smooth, also one that SymPy cancelled."""

    expr: sympy.Expr
    guards: tuple[Guard, ...] = ()


def parse_expression(text: str, names: Names, *, where: Where, refused: Refusal = unrefused) -> sympy.Expr:
    """The expression in the declared names; a set of names stands for the symbols of those names.

    ``refused`` gives the reason why a name known elsewhere may not appear here, ``None`` for others. The result is made
    of sums, products, powers with rational exponents, the functions of the language, rationals, π, e and the given
    values. Raises ``InputError`` with the column (counted from 1).
    """
    return parse_written(text, names, where=where, refused=refused).expr


def parse_written(text: str, names: Names, *, where: Where, refused: Refusal = unrefused) -> Written:
    """``parse_expression`` with the guards of all parts of the text, innermost first."""
    values = names if isinstance(names, Mapping) else {name: symbol(name) for name in names}
    try:
        bindings: list[tuple[str, sympy.Expr]] = []
        unknown: dict[str, int] = {}
        for used in _names_of(text):
            known = _BUILT_IN.get(used.name) or values.get(used.name)
            if known is None:
                unknown.setdefault(used.name, used.column)
            bindings.append((used.name, known))
        if unknown:
            first = islice(unknown.items(), MAX_UNKNOWN)
            raise InputError(*(_problem(name, column, values, where, refused) for name, column in first))
        return _evaluated(text, tuple(dict.fromkeys(bindings)))
    except ExpressionError as error:
        raise where.error(error.reason, error.column) from None


def parse_constant(
    text: str, names: Mapping[str, sympy.Expr], *, where: Where, refused: Refusal = unrefused
) -> sympy.Expr:
    """An exact, finite, real constant such as ``sqrt(2)/3`` in declared constants. Raises ``InputError``.

    ``names`` stand for constants. One that only SymPy knows to be rational, such as ``sqrt(2)^2``, is refused
    (``symbolic.rational_value``).
    """
    expr = parse_expression(text, names, where=where, refused=refused)
    if expr.free_symbols:
        found = ", ".join(sorted(str(name) for name in expr.free_symbols))
        raise ValueError(f"{text!r} is read as a constant, and a name in it stands for a symbol: {found}")
    if isinstance(expr, sympy.Rational) and _fraction_of(text, names) is None:
        raise where.error(messages.PLAIN_NUMBER(text=quoted(text), value=shown(as_fraction(expr))))
    return expr


def parse_number(text: str, names: Mapping[str, sympy.Expr], *, where: Where, refused: Refusal = unrefused) -> Fraction:
    """A rational constant in declared constants. Raises ``InputError``."""
    expr = parse_constant(text, names, where=where, refused=refused)
    if not isinstance(expr, sympy.Rational):
        raise where.error(messages.RATIONAL(text=quoted(text)))
    return as_fraction(expr)


@dataclass(frozen=True)
class _Value:
    """A built node with upper bounds on its expansion; ``ball`` encloses it if it is constant."""

    expr: sympy.Expr
    size: Size
    ball: arb | None


def _fraction_of(text: str, names: Mapping[str, sympy.Expr]) -> Fraction | None:
    return folded(parse(text), _fractions(names))


def _fractions(names: Mapping[str, sympy.Expr]) -> dict[str, Fraction]:
    return {name: as_fraction(value) for name, value in names.items() if isinstance(value, sympy.Rational)}


@lru_cache(maxsize=4096)
def _names_of(text: str) -> tuple[Name, ...]:
    return tuple(_walk(parse(text)))


@lru_cache(maxsize=4096)
def _evaluated(text: str, bindings: tuple[tuple[str, sympy.Expr], ...]) -> Written:
    builder = _Builder(dict(bindings))
    expr = builder.build(parse(text)).expr
    return Written(expr, tuple(builder.guards))


def _walk(node: Node) -> Iterator[Name]:
    match node:
        case Name():
            yield node
        case Negative(argument) | Call(_, argument):
            yield from _walk(argument)
        case Sum(terms):
            for term in terms:
                yield from _walk(term)
        case Product(factors):
            for factor, _ in factors:
                yield from _walk(factor)
        case Power(base, exponent):
            yield from _walk(base)
            yield from _walk(exponent)


def _problem(name: str, column: int, values: Mapping[str, sympy.Expr], where: Where, refused: Refusal) -> Problem:
    """A name that is not known here."""
    (problem,) = where.error(refused(name) or _unknown(name, values), column).problems
    return problem


def _unknown(name: str, values: Mapping[str, sympy.Expr]) -> Reason:
    known = ", ".join(sorted(values)[:20])
    otherwise = f"known here: {known}; declare others first" if known else "no names are known here"
    return messages.UNKNOWN_NAME(name=quoted(name), hint=did_you_mean(name, [*values, *CONSTANTS], otherwise))


def _measured(expr: sympy.Expr) -> _Value:
    """The bounds of what a name stands for: a symbol or an already checked constant."""
    if isinstance(expr, sympy.Symbol):
        return _Value(expr, Size(1, 1, 0), None)
    if expr.free_symbols:
        raise ValueError(f"a name may stand for a symbol or a constant, not for {expr}")
    bits = sum(map(_bits, expr.atoms(sympy.Rational)))
    return _Value(expr, Size(0, 1, bits), enclose(expr))


@lru_cache(maxsize=4096)
def _height(expr: sympy.Expr) -> int:
    """How many operations are on top of each other."""
    return 1 + max(map(_height, expr.args)) if expr.args else 0


def _bits(number: sympy.Rational) -> int:
    return int(number.p).bit_length() + int(number.q).bit_length()


class _Builder:
    """Builds trees in names that stand for symbols and constants; ``guards`` are those of the parts built so far."""

    def __init__(self, names: Mapping[str, sympy.Expr]) -> None:
        self.names = {name: _measured(expr) for name, expr in names.items()}
        self.fractions = _fractions(names)
        self.guards: dict[Guard, None] = {}

    def build(self, node: Node) -> _Value:
        match node:
            case Number(value):
                return _measured(as_rational(value))
            case Name(name):
                return self.names[name]
            case Negative(argument):
                built = self.build(argument)
                return _checked(-built.expr, built.size, node)
            case Sum(terms):
                parts = [self.build(term) for term in terms]
                size = _affordable(size_of_sum(part.size for part in parts), node)
                return _checked(sympy.Add(*(part.expr for part in parts)), size, node)
            case Product(factors):
                parts = [
                    self.power(self.build(factor), Fraction(-1), factor) if divides else self.build(factor)
                    for factor, divides in factors
                ]
                size = _affordable(size_of_product(part.size for part in parts), node)
                return _checked(sympy.Mul(*(part.expr for part in parts)), size, node)
            case Power(base, exponent):
                return self.power(self.build(base), self.exponent(exponent), node)
            case Call(function, argument):
                inner = self.build(argument)
                self.guard(of_function(function, inner.expr))
                return _call(function, inner, node)

    def guard(self, guard: Guard | None) -> None:
        if guard is not None and guard.expression.free_symbols:
            self.guards.setdefault(guard)

    def power(self, base: _Value, exponent: Fraction, node: Node) -> _Value:
        if exponent.denominator > 1:
            self.guard(of_power(base.expr, exponent))
        elif exponent < 0:
            self.guard(of_denominator(base.expr))
        return _power(base, exponent, node)

    def exponent(self, node: Node) -> Fraction:
        self.build(node)  # refuses what is no number before it is folded
        value = folded(node, self.fractions)
        if value is None:
            raise ExpressionError(messages.EXPONENT(), node.column)
        if abs(value) > MAX_EXPONENT:
            raise ExpressionError(messages.EXPONENT_SIZE(most=MAX_EXPONENT), node.column)
        if value.denominator > MAX_ROOT:
            raise ExpressionError(messages.EXPONENT_ROOT(most=MAX_ROOT), node.column)
        return value


def _affordable(size: Size, node: Node) -> Size:
    excess = size.excess()
    if excess is not None:
        raise ExpressionError(messages.EXPANSION(what=excess[0], most=excess[1]), node.column)
    return size


def _checked(expr: sympy.Expr, size: Size, node: Node) -> _Value:
    """The node's value; a constant must be finite and real, and not too large."""
    if expr.free_symbols:
        return _Value(expr, size, None)
    if _height(expr) > MAX_HEIGHT:
        raise ExpressionError(messages.CONSTANT_NESTED(), node.column)
    ball = enclose(expr)
    if not ball.is_finite() or ball.abs_upper() > LARGEST:
        raise ExpressionError(messages.CONSTANT_SIZE(most=LARGEST_EXPONENT), node.column)
    return _Value(expr, size, ball)


def _power(base: _Value, exponent: Fraction, node: Node) -> _Value:
    if exponent < 0 or (exponent == 0 and base.expr == 0):
        if base.expr == 0:
            raise ExpressionError(messages.DIVISION() if exponent < 0 else messages.ZERO_POWER(), node.column)
        if base.ball is not None and base.ball.contains(0):
            raise ExpressionError(messages.DIVISION_UNSHOWN(), node.column)
    if exponent.denominator == 1:
        size = _affordable(size_of_power(base.size, abs(exponent.numerator)), node)
        return _checked(sympy.Pow(base.expr, exponent.numerator), size, node)
    _reasonable_root(base, node)
    result = _smooth(sympy.Pow(base.expr, as_rational(exponent)), "a power with this base", node)
    root = Size(min(base.size.degree, 1), 1, base.size.bits)
    return _checked(result, _affordable(size_of_power(root, abs(exponent.numerator)), node), node)


def _reasonable_root(argument: _Value, node: Node) -> None:
    if any(_bits(number) > MAX_ROOT_BITS for number in argument.expr.atoms(sympy.Rational)):
        raise ExpressionError(messages.ROOT_BITS(most=MAX_ROOT_BITS), node.column)


def _smooth(result: sympy.Expr, what: str, node: Node) -> sympy.Expr:
    """What SymPy made of a function or root, if it is still in the language."""
    for part in sympy.preorder_traversal(result):
        if part in (sympy.zoo, sympy.oo, -sympy.oo, sympy.nan, sympy.I):
            raise ExpressionError(messages.NOT_REAL(what=what), node.column)
        if part.func not in _HEADS and not isinstance(part, _ATOMS):
            raise ExpressionError(messages.NOT_SMOOTH(what=what, found=part.func.__name__), node.column)
    return result


def _call(function: str, argument: _Value, node: Node) -> _Value:
    if function == "exp" and argument.expr.has(sympy.log):
        raise ExpressionError(messages.LOG_IN_EXP(), node.column)
    if function == "sqrt":
        _reasonable_root(argument, node)
    result = _smooth(_FUNCTIONS[function](argument.expr), f"{function} of this argument", node)
    inner = argument.size
    return _checked(result, inner if function == "sqrt" else Size(min(inner.degree, 1), 1, inner.bits), node)
