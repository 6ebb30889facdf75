"""Expressions of plant files and certificates: an allow-list parser to a tiny syntax tree, and one evaluator.

    sum     = product (("+" | "-") product)*
    product = unary (("*" | "/") unary)*
    unary   = ("+" | "-") unary | power
    power   = atom (("**" | "^") unary)?              the exponent is a rational constant
    atom    = number | name | "pi" | function "(" sum ")" | "(" sum ")"

``u^(p/q)`` in lowest terms with ``q ≥ 2`` is ``√…√u^p`` if ``q`` is a power of two, and ``exp(p/q·log u)`` otherwise,
so that ``u`` must not be negative, or must be positive; ``pi`` is ``4·atan 1``. Nothing after the parser knows either.
Rational constants are folded exactly while parsing, so a ``Number`` is exact and everything else is not known to be.
Every part without names must be enclosed by an interval: ``log(0)`` or ``1/(sqrt(2) - sqrt(2))`` is no expression.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import compress
from math import isqrt
from typing import Any

from certify.checker import functions
from certify.checker.intervals import Interval, enclose
from certify.checker.verdict import Malformed, Undecided, spend

FUNCTIONS = ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh", "atan", "sinh", "cosh")

MAX_LENGTH = 10_000
MAX_DEPTH = 24
MAX_NODES = 2_000  # as written
MAX_SIZE = 20_000  # with the names replaced by what they stand for
MAX_HEIGHT = 100  # of what a name stands for
MAX_EXPONENT = 64
MAX_ROOT = 64  # the denominator of an exponent
MAX_BITS = 10_000
LARGEST = 1 << MAX_BITS
MAX_DIGITS = 1_000
MAX_DECIMAL_EXPONENT = 300

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_DECIMAL = re.compile(r"([0-9]*)(?:\.([0-9]*))?(?:[eE]([+-]?[0-9]{1,6}))?")
_TOKEN = re.compile(
    r"[ \t\r\n]*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z][A-Za-z0-9_]*)|(?P<op>\*\*|[-+*/^()])|(?P<end>\Z))"
)


@dataclass(frozen=True)
class Number:
    value: Fraction


@dataclass(frozen=True)
class Name:
    name: str


@dataclass(frozen=True)
class Sum:
    """Each term is marked True if it is subtracted."""

    terms: tuple[tuple[Node, bool], ...]


@dataclass(frozen=True)
class Product:
    """Each factor is marked True if it divides."""

    factors: tuple[tuple[Node, bool], ...]


@dataclass(frozen=True)
class Power:
    base: Node
    exponent: int


@dataclass(frozen=True)
class Call:
    function: str
    argument: Node


Node = Number | Name | Sum | Product | Power | Call

CONSTANTS: Mapping[str, Node] = {
    "pi": Product(((Number(Fraction(4)), False), (Call("atan", Number(Fraction(1))), False)))
}


def parse(text: str, names: Mapping[str, Node]) -> Node:
    """The tree of the text, names replaced by what they stand for. Raises ``Malformed``."""
    if len(text) > MAX_LENGTH:
        raise Malformed("the expression is too long")
    return _Parser(text, names).whole()


def decimal(text: str) -> Fraction:
    """The exact value of an unsigned integer or decimal such as ``12``, ``0.1`` or ``1e-3``."""
    match = _DECIMAL.fullmatch(text)
    if match is None or not (match[1] or match[2]):
        raise Malformed(f"not a number: {text[:40]!r}")
    digits, places, exponent = match[1] + (match[2] or ""), len(match[2] or ""), int(match[3] or 0)
    if len(digits) > MAX_DIGITS or abs(exponent) > MAX_DECIMAL_EXPONENT:
        raise Malformed("a number has too many digits")
    return int(digits) * Fraction(10) ** (exponent - places)


def evaluate(
    node: Node, values: Mapping[str, Any], number: Callable[[Fraction], Any], call: Callable[[str, Any], Any]
) -> Any:
    """The value in any algebra with ``+ - * / **``: ``number`` embeds rationals, ``call`` applies a function."""
    spend(40)
    match node:
        case Number(value):
            return number(value)
        case Name(name):
            return values[name]
        case Sum(terms):
            total = None
            for term, minus in terms:
                part = evaluate(term, values, number, call)
                part = -part if minus else part
                total = part if total is None else total + part
            return total
        case Product(factors):
            total = None
            for factor, divides in factors:
                part = evaluate(factor, values, number, call)
                if total is None:
                    total = number(Fraction(1)) / part if divides else part
                else:
                    total = total / part if divides else total * part
            return total
        case Power(base, exponent):
            return evaluate(base, values, number, call) ** exponent
        case Call(function, argument):
            return call(function, evaluate(argument, values, number, call))


def names_in(node: Node) -> set[str]:
    return set(occurrences(node))


def occurrences(node: Node) -> list[str]:
    """The names, as often as they occur."""
    match node:
        case Number():
            return []
        case Name(name):
            return [name]
        case Sum(parts) | Product(parts):
            return [name for part, _ in parts for name in occurrences(part)]
        case Power(inner, _) | Call(_, inner):
            return occurrences(inner)


def measure(node: Node) -> tuple[int, int]:
    """How many nodes the tree has, and how many of them are on top of each other. Raises ``Malformed``."""
    match node:
        case Sum(parts) | Product(parts):
            below = [measure(part) for part, _ in parts]
        case Power(inner, _) | Call(_, inner):
            below = [measure(inner)]
        case _:
            return 1, 0
    height = 1 + max(high for _, high in below)
    if height > MAX_HEIGHT:
        raise Malformed("a constant is nested too deeply")
    return 1 + sum(size for size, _ in below), height


def terms_of(node: Node) -> list[Node]:
    """The terms of a sum; any other expression is its only term."""
    return [Sum((term,)) for term in node.terms] if isinstance(node, Sum) else [node]


def exact_call(function: str, argument: Fraction) -> Fraction | None:
    """The value of a function where it is known to be rational, else None."""
    if function == "sqrt" and argument >= 0:
        root = Fraction(isqrt(argument.numerator), isqrt(argument.denominator))
        return root if root * root == argument else None
    if function == "log":
        return Fraction(0) if argument == 1 else None
    if argument == 0:
        return Fraction(1) if function in ("cos", "exp", "cosh") else Fraction(0)
    return None


class _Parser:
    def __init__(self, text: str, names: Mapping[str, Node]) -> None:
        self.text = text
        self.names = names
        self.kind, self.token, self.position = "", "", 0
        self.nodes = self.size = self.depth = 0
        self.step()

    def step(self) -> str:
        """Moves to the next token and returns the one before it."""
        before = self.token
        match = _TOKEN.match(self.text, self.position)
        if match is None:
            raise Malformed(f"column {self.position + 1}: unexpected character in an expression")
        spend(50)
        self.nodes += match.lastgroup != "end" and match["op"] not in ("(", ")")
        if self.nodes > MAX_NODES:
            raise Malformed("the expression has too many parts")
        self.kind, self.token, self.position = str(match.lastgroup), match[str(match.lastgroup)], match.end()
        return before

    def whole(self) -> Node:
        node = self.sum()
        if self.kind != "end":
            raise self.fault("an operator")
        try:
            if _is_constant(node):
                evaluate(node, {}, enclose, _bounded_call)
        except Undecided as reason:
            raise Malformed(f"a constant is not a real number of reasonable size: {reason}") from None
        return node

    def fault(self, wanted: str) -> Malformed:
        return Malformed(f"column {self.position}: {wanted} is needed in the expression")

    def nested(self, read: Callable[[], Node]) -> Node:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise Malformed("the expression is nested too deeply")
        node = read()
        self.depth -= 1
        return node

    def sum(self) -> Node:
        terms = [(self.product(), False)]
        while self.token in ("+", "-"):
            minus = self.step() == "-"
            terms.append((self.product(), minus))
        return terms[0][0] if len(terms) == 1 else _folded(Sum(tuple(terms)))

    def product(self) -> Node:
        factors = [(self.unary(), False)]
        while self.token in ("*", "/"):
            divides = self.step() == "/"
            factors.append((self.unary(), divides))
        return factors[0][0] if len(factors) == 1 else _folded(_collected(factors))

    def unary(self) -> Node:
        if self.token not in ("+", "-"):
            return self.power()
        minus = self.step() == "-"
        node = self.nested(self.unary)
        return _folded(Sum(((node, True),))) if minus else node

    def power(self) -> Node:
        base = self.atom()
        if self.token not in ("**", "^"):
            return base
        self.step()
        exponent = self.nested(self.unary)
        if not isinstance(exponent, Number) or abs(exponent.value) > MAX_EXPONENT:
            raise self.fault("a small rational constant as the exponent")
        if exponent.value.denominator > MAX_ROOT:
            raise self.fault("an exponent with a small denominator")
        return _power(base, exponent.value)

    def atom(self) -> Node:
        kind, token = self.kind, self.step()
        if kind == "number":
            return Number(decimal(token))
        if token == "(":
            return self.group()
        if kind != "name":
            raise self.fault("a number, a name or '('")
        if token in FUNCTIONS:
            if self.token != "(":
                raise self.fault(f"an argument of {token}")
            self.step()
            return _folded(Call(token, self.group()))
        node = CONSTANTS.get(token) or self.names.get(token)
        if node is None:
            raise Malformed(f"the name {token[:40]} is not known here")
        self.size += 1 if isinstance(node, (Name, Number)) else measure(node)[0]
        if self.size > MAX_SIZE:
            raise Malformed("the expression has too many parts")
        return node

    def group(self) -> Node:
        node = self.nested(self.sum)
        if self.token != ")":
            raise self.fault("')'")
        self.step()
        return node


def _is_constant(node: Node) -> bool:
    """Whether there are no names in it; if there are, its largest parts without names are enclosed."""
    match node:
        case Sum(pairs) | Product(pairs):
            parts = tuple(part for part, _ in pairs)
        case Power(inner, _) | Call(_, inner):
            parts = (inner,)
        case _:
            return isinstance(node, Number)
    constant = [_is_constant(part) for part in parts]
    if not all(constant):
        divisors = [divides for _, divides in node.factors] if isinstance(node, Product) else [False] * len(parts)
        for part, divides in compress(zip(parts, divisors, strict=True), constant):
            evaluate(Product(((part, True),)) if divides else part, {}, enclose, _bounded_call)
    return all(constant)


def _bounded_call(function: str, argument: Interval) -> Interval:
    value = functions.call(function, argument)
    if value.lower > LARGEST or value.upper < -LARGEST:
        raise Undecided(f"{function} of {argument}")
    return value


def _power(base: Node, exponent: Fraction) -> Node:
    """``base^exponent``, which for a denominator ``q ≥ 2`` is made of functions; a perfect power is a number."""
    q = exponent.denominator
    if isinstance(base, Number) and q > 1:
        root = _exact_root(base.value, q)
        base, q = (base, q) if root is None else (Number(root), 1)
    if q & (q - 1):
        logarithm = _folded(Call("log", base))
        return _folded(Call("exp", _folded(Product(((Number(exponent), False), (logarithm, False))))))
    while q > 1:
        base, q = _folded(Call("sqrt", base)), q // 2
    if exponent.numerator == 1 < exponent.denominator:
        return base
    return _folded(Power(base, exponent.numerator))


def _collected(factors: Sequence[tuple[Node, bool]]) -> Node:
    """The product with equal factors as one power, each where it stood first: ``x·x`` is ``x²``, which is enclosed more
    tightly and smooth at the same points. Factors and divisors are not set off against each other."""
    powers: dict[tuple[Node, bool], int] = {}
    for factor, divides in _flat(factors):
        base, exponent = factor, 1
        if isinstance(factor, Power) and factor.exponent > 0:
            base, exponent = factor.base, factor.exponent
        known = powers.get((base, divides), 0)
        if isinstance(base, Number) or known + exponent > MAX_EXPONENT:
            base, exponent, known = factor, 1, powers.get((factor, divides), 0)
        powers[base, divides] = known + exponent
    kept: list[tuple[Node, bool]] = []
    for (base, divides), exponent in powers.items():
        repeats = exponent if isinstance(base, Number) else 1
        kept += [(base if exponent == 1 or repeats > 1 else Power(base, exponent), divides)] * repeats
    return kept[0][0] if len(kept) == 1 and not kept[0][1] else Product(tuple(kept))


def _flat(factors: Sequence[tuple[Node, bool]]) -> Iterator[tuple[Node, bool]]:
    for factor, divides in factors:
        if isinstance(factor, Product) and not divides:
            yield from _flat(factor.factors)
        else:
            yield factor, divides


def _exact_root(value: Fraction, q: int) -> Fraction | None:
    """The ``q``-th root of a nonnegative number if it is rational."""
    if value < 0:
        return None
    p, r = _integer_root(value.numerator, q), _integer_root(value.denominator, q)
    return Fraction(p, r) if p**q == value.numerator and r**q == value.denominator else None


def _integer_root(n: int, q: int) -> int:
    """The largest ``k`` with ``k^q ≤ n``."""
    low, high = 0, 1 << (n.bit_length() // q + 1)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if middle**q <= n else (low, middle)
    return low


def _folded(node: Node) -> Node:
    """The node, or the ``Number`` it is equal to when its parts are numbers."""
    match node:
        case Sum(parts) | Product(parts):
            if not all(isinstance(part, Number) for part, _ in parts):
                return node
        case Power(Number(value), exponent):
            if exponent == 0 and value == 0:
                raise Malformed("0 to the power 0")
            if (value.numerator.bit_length() + value.denominator.bit_length()) * abs(exponent) > MAX_BITS:
                raise Malformed("a constant is too large")
        case Call(function, Number(value)):
            exact = exact_call(function, value)
            return node if exact is None else Number(exact)
        case _:
            return node
    try:
        value = evaluate(node, {}, lambda q: q, lambda function, argument: None)
    except ZeroDivisionError:
        raise Malformed("division by zero in a constant") from None
    if value.numerator.bit_length() + value.denominator.bit_length() > MAX_BITS:
        raise Malformed("a constant is too large")
    return Number(value)
