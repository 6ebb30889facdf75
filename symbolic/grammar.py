"""The expression language of plant files: tokens and a recursive-descent parser, by allow-list.

    sum     = product (("+" | "-") product)*
    product = unary (("*" | "/") unary)*
    unary   = ("+" | "-") unary | power
    power   = atom (("**" | "^") unary)?              right-associative, binds tighter than unary minus
    atom    = number | name | "pi" | function "(" sum ")" | "(" sum ")"

Length, nesting and the number of nodes are bounded, so parsing takes bounded time and stack.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

from symbolic import messages
from symbolic.errors import quoted
from symbolic.messages import Reason

FUNCTIONS = ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh", "atan", "sinh", "cosh")
CONSTANTS = ("pi",)

MAX_LENGTH = 10_000
MAX_DEPTH = 24
MAX_NODES = 2_000
MAX_DIGITS = 1_000
MAX_DECIMAL_EXPONENT = 300  # beyond it no float holds the number, and floats search

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
NUMBER = re.compile(r"(?P<whole>[0-9]*)(?:\.(?P<part>[0-9]*))?(?:[eE](?P<exponent>[+-]?[0-9]+))?")
_BLANK = re.compile(r"[ \t\r\n]*")
_TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)|(?P<name>[A-Za-z][A-Za-z0-9_]*)"
    r"|(?P<op>\*\*|[-+*/^()])"
)


class ExpressionError(Exception):
    """Why a text is not an expression, and the column (from 1) at which that shows."""

    def __init__(self, reason: Reason, column: int) -> None:
        super().__init__(reason)
        self.reason = reason
        self.column = column


class NumberError(ValueError):
    """Why a text is not a number that can be read."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason)
        self.reason = reason


@dataclass(frozen=True)
class Number:
    value: Fraction
    column: int


@dataclass(frozen=True)
class Name:
    name: str
    column: int


@dataclass(frozen=True)
class Negative:
    argument: Node
    column: int


@dataclass(frozen=True)
class Sum:
    terms: tuple[Node, ...]
    column: int


@dataclass(frozen=True)
class Product:
    """The product of the factors; a factor marked True divides."""

    factors: tuple[tuple[Node, bool], ...]
    column: int


@dataclass(frozen=True)
class Power:
    base: Node
    exponent: Node
    column: int


@dataclass(frozen=True)
class Call:
    function: str
    argument: Node
    column: int


Node = Number | Name | Negative | Sum | Product | Power | Call


def parse(text: str) -> Node:
    """The syntax tree of the text. Raises ``ExpressionError``."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(messages.TOO_LONG(found=len(text), most=MAX_LENGTH), MAX_LENGTH + 1)
    return _Parser(text).parse()


def decimal(text: str) -> Fraction:
    """The exact value of an unsigned integer or decimal such as ``12``, ``0.1`` or ``1e-3``.

    Raises ``NumberError`` for one that is too long.
    """
    match = NUMBER.fullmatch(text)
    if match is None or not (match["whole"] or match["part"]):
        raise ValueError(f"not a number: {text[:40]!r}")
    part, exponent = match["part"] or "", match["exponent"] or "0"
    digits = match["whole"] + part
    if len(digits) > MAX_DIGITS:
        raise NumberError(messages.DIGITS(found=len(digits), most=MAX_DIGITS))
    if len(exponent.lstrip("+-")) > 6 or abs(int(exponent)) > MAX_DECIMAL_EXPONENT:
        raise NumberError(messages.EXPONENT_OF_TEN(most=MAX_DECIMAL_EXPONENT))
    return Fraction(int(digits)) * Fraction(10) ** (int(exponent) - len(part))


_LOOKALIKES = {
    "\u2212": "; write the minus sign of the keyboard",
    "\u00d7": "; a product is written with *",
    "\u00b7": "; a product is written with *",
    "\u00b2": "; write ^2",
    "\u00b3": "; write ^3",
    "\u03c0": "; write pi",
    "[": "; use parentheses, and x1 for a component",
    "{": "; use parentheses",
    ",": "; decimals have a point, and functions one argument",
    "=": "; the value is an expression, not an equation",
    "'": "; derivatives are not written: order = n makes x2 = x1' and so on",
    "%": "; write /100",
    "|": "; an absolute value is not smooth, sqrt(1/100 + x^2) may do",
}
_OTHER_NAMES = {"ln": "log", "log10": "log(x)/log(10)", "arctan": "atan", "abs": "sqrt(1/100 + x^2), which is smooth"}
_OTHER_NAMES |= {"pow": "x^p", "sec": "1/cos(x)", "cot": "cos(x)/sin(x)", "sign": "tanh(100*x), which is smooth"}
_OTHER_NAMES |= {"sgn": _OTHER_NAMES["sign"], "cbrt": "x^(1/3)", "square": "x^2", "sigmoid": "1/(1 + exp(-x))"}


def _unknown_function(name: str) -> Reason:
    other = _OTHER_NAMES.get(name.lower())
    known = ", ".join(FUNCTIONS)
    return messages.FUNCTION(
        name=quoted(name), known=known + (f"; write {other}" if other else "; a product is written with *")
    )


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    column: int


def _tokens(text: str) -> list[_Token]:
    tokens = []
    position = 0
    while True:
        blank = _BLANK.match(text, position)
        position = blank.end() if blank else position
        if position == len(text):
            tokens.append(_Token("end", "", position + 1))
            return tokens
        match = _TOKEN.match(text, position)
        if match is None:
            found = text[position]
            raise ExpressionError(
                messages.CHARACTER(found=quoted(found), hint=_LOOKALIKES.get(found, "")), position + 1
            )
        tokens.append(_Token(str(match.lastgroup), match.group(), position + 1))
        position = match.end()


class _Parser:
    def __init__(self, text: str) -> None:
        self.tokens = _tokens(text)
        self.next = 0
        self.nodes = 0
        self.depth = 0

    def parse(self) -> Node:
        node = self.sum()
        if self.token.kind != "end":
            hint = (
                "; a product is written with *, and units are left out"
                if self.token.kind in ("name", "number") or self.token.text == "("
                else ""
            )
            raise ExpressionError(messages.OPERATOR(found=quoted(self.token.text), hint=hint), self.token.column)
        return node

    @property
    def token(self) -> _Token:
        return self.tokens[self.next]

    def take(self) -> _Token:
        token = self.token
        self.next += 1
        return token

    def count(self, column: int) -> int:
        self.nodes += 1
        if self.nodes > MAX_NODES:
            raise ExpressionError(messages.TOO_MANY_PARTS(most=MAX_NODES), column)
        return column

    def enter(self) -> None:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise ExpressionError(messages.NESTED(most=MAX_DEPTH), self.token.column)

    def sum(self) -> Node:
        column = self.token.column
        terms = [self.product()]
        while self.token.text in ("+", "-"):
            operator = self.take()
            self.count(operator.column)
            term = self.product()
            terms.append(Negative(term, operator.column) if operator.text == "-" else term)
        return terms[0] if len(terms) == 1 else Sum(tuple(terms), column)

    def product(self) -> Node:
        column = self.token.column
        factors = [(self.unary(), False)]
        while self.token.text in ("*", "/"):
            operator = self.take()
            self.count(operator.column)
            factors.append((self.unary(), operator.text == "/"))
        return factors[0][0] if len(factors) == 1 else Product(tuple(factors), column)

    def unary(self) -> Node:
        if self.token.text not in ("+", "-"):
            return self.power()
        self.enter()
        operator = self.take()
        argument = self.unary()
        self.depth -= 1
        return Negative(argument, self.count(operator.column)) if operator.text == "-" else argument

    def power(self) -> Node:
        base = self.atom()
        if self.token.text not in ("**", "^"):
            return base
        self.enter()
        operator = self.take()
        exponent = self.unary()
        self.depth -= 1
        return Power(base, exponent, self.count(operator.column))

    def atom(self) -> Node:
        token = self.take()
        if token.text != "(":
            self.count(token.column)
        if token.kind == "number":
            try:
                return Number(decimal(token.text), token.column)
            except NumberError as error:
                raise ExpressionError(error.reason, token.column) from None
        if token.text == "(":
            return self.group()
        if token.kind == "name" and self.token.text == "(":
            if token.text not in FUNCTIONS:
                raise ExpressionError(_unknown_function(token.text), token.column)
            self.take()
            return Call(token.text, self.group(), token.column)
        if token.kind == "name":
            if token.text in FUNCTIONS:
                raise ExpressionError(messages.ARGUMENT(name=token.text), token.column)
            return Name(token.text, token.column)
        found = "the end" if token.kind == "end" else quoted(token.text)
        raise ExpressionError(messages.OPERAND(found=found), token.column)

    def group(self) -> Node:
        self.enter()
        node = self.sum()
        self.depth -= 1
        if self.token.text != ")":
            found = "the end" if self.token.kind == "end" else quoted(self.token.text)
            raise ExpressionError(messages.PARENTHESIS(found=found), self.token.column)
        self.take()
        return node
