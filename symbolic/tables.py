"""Typed access to a parsed TOML tree: every wrong type, missing key or unknown key is one line of an ``InputError``."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

import sympy

from symbolic import messages
from symbolic.constants import as_rational
from symbolic.errors import InputError, Problem, Where, nearest, quoted, shown
from symbolic.expressions import Refusal, Written, parse_constant, parse_number, parse_written, unrefused
from symbolic.grammar import NumberError, decimal
from symbolic.messages import Reason
from symbolic.plant import Interval

MAX_FILE_BYTES = 1_000_000
MAX_INTEGER_BITS = 4_000

_SPECIAL = re.compile(r"[+-]?(inf|nan)")
# tomllib takes time quadratic in the parts of a dotted key (measured: 6 s for 16 000 parts)
_PART = rb"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_DEEP_KEY = re.compile(rb"(?<![A-Za-z0-9_-])(?:" + _PART + rb"){32}")
_POSITION = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)")
_HINTS = {  # by the beginning of what tomllib says
    "Invalid value": "; texts and expressions stand in quotes, and decimals have digits on both sides of the point",
    "Expected '=' after a key": "; a line is key = value, [table] or # comment",
    "Invalid statement": "; a line is key = value, [table] or # comment",
    "Cannot overwrite a value": "; a key is given once",
    "Cannot declare": "; a table is opened once, and [[agent]] has two brackets each time",
    "Expected newline or end of document": "; one entry a line, and a text with a blank stands in quotes",
    "Unclosed array": "; close it with ], put commas between entries, and digits on both sides of a decimal point",
    "Unclosed inline table": "; close it with } on the same line",
    "Unescaped '\\'": "; write the text in 'single quotes', or \\\\ for a backslash",
    "Illegal character": "; lines end in LF or CRLF, and a text is closed on its line",
}

T = TypeVar("T")


@dataclass(frozen=True)
class Decimal:
    """A TOML float as it is written, so that it is read as a decimal and never as a binary float."""

    text: str


Value = object


def read_toml(data: bytes, where: Where) -> Table:
    """The tree of a UTF-8 TOML document of bounded size."""
    if len(data) > MAX_FILE_BYTES:
        raise where.error(messages.TOO_LARGE(most=MAX_FILE_BYTES))
    if not data.strip():
        raise where.at("schema").error(messages.EMPTY())
    if _DEEP_KEY.search(data):
        raise where.error(messages.DEEP_KEY())
    text = decoded(data, where)
    try:
        return Table(tomllib.loads(text, parse_float=Decimal), where)
    except RecursionError:
        raise where.error(messages.TOO_DEEP()) from None
    except tomllib.TOMLDecodeError as error:
        raise _not_toml(str(error), where) from None
    except ValueError as error:  # an integer of more digits than Python converts
        raise where.error(messages.NOT_TOML(why=error, hint="")) from None


def decoded(data: bytes, where: Where) -> str:
    """The text of a UTF-8 file without a byte-order mark."""
    if data.startswith(b"\xef\xbb\xbf"):
        raise InputError(Problem(where.file, "", messages.BYTE_ORDER_MARK(), position=(1, 1)))
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(Problem(where.file, "", messages.UTF_16(), position=(1, 1)))
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = len(data[data.rfind(b"\n", 0, error.start) + 1 : error.start].decode("utf-8")) + 1
        raise InputError(Problem(where.file, "", messages.NOT_UTF8(), position=(line, column))) from None


def _not_toml(said: str, where: Where) -> InputError:
    """What ``tomllib`` said, with its position in front and what to change at the end."""
    match = _POSITION.search(said)
    why = said[: match.start()] if match else said
    hint = next((hint for start, hint in _HINTS.items() if why.startswith(start)), "")
    position = (int(match[1]), int(match[2])) if match and match[1] else None
    if match and not match[1]:
        why += " at the end of the file"
    return InputError(Problem(where.file, "", messages.NOT_TOML(why=why, hint=hint), position=position))


class Table:
    """A table and its place; ``keys`` are all keys that it may have. Others are reported and left out."""

    def __init__(self, value: Value, where: Where, keys: Sequence[str] | None = None) -> None:
        if not isinstance(value, dict):
            raise where.error(messages.TABLE(found=kind(value), key=where.key))
        self.entries: Mapping[str, Value] = value
        self.where = where
        if keys is not None:
            self.allow(keys)

    def allow(self, keys: Sequence[str], reason: Callable[[str], Reason] | None = None) -> None:
        """Reports every key that is not listed, with the nearest one or for the reason given.

        It is read as the nearest one, if that is missing, so that nobody is told of the same slip twice.
        """
        allowed = {key: value for key, value in self.entries.items() if key in keys}
        for key, value in self.entries.items():
            if key not in keys:
                near = nearest(key, keys)
                hint = f"did you mean {quoted(near)}?" if near else f"known keys: {', '.join(keys) or 'none'}"
                unknown = messages.UNKNOWN_KEY(key=quoted(key), hint=hint)
                self.where.report(reason(key) if reason else unknown, spot=self.at(key), on_key=True)
                if near:
                    allowed.setdefault(near, value)
        self.entries = allowed

    def __contains__(self, key: str) -> bool:
        return key in self.entries

    def at(self, key: str) -> Where:
        return self.where.at(key)

    def need(self, key: str, example: str) -> Value:
        """The value of a key that has no default; the refusal shows how it may be written."""
        if key not in self.entries:
            raise self.at(key).error(messages.MISSING(example=example))
        return self.entries[key]

    def read(self, key: str, example: str, read: Callable[[Value, Where], T], instead: T) -> T:
        """What ``read`` makes of the value of a key that must be there, or ``instead`` after noting why it cannot."""
        where = self.at(key)
        return where.attempt(lambda: read(self.need(key, example), where), instead)

    def table(self, key: str, keys: Sequence[str] | None = None) -> Table:
        """The table under the key; an empty one when the key is left out, or is no table and that is noted."""
        where, none = self.at(key), Table({}, self.at(key))
        return where.attempt(lambda: Table(self.entries.get(key, {}), where, keys), none)


def kind(value: Value) -> str:
    """The type of a TOML value in words."""
    if isinstance(value, bool):
        return "a boolean"
    names = {dict: "a table", list: "an array", str: "a string", int: "an integer", Decimal: "a decimal number"}
    return names.get(type(value), "a date or time")


def array(value: Value, where: Where, *, most: int | None = None, what: str = "entries") -> list[Value]:
    if not isinstance(value, list):
        raise where.error(messages.ARRAY(found=kind(value)))
    if most is not None and len(value) > most:
        raise where.error(messages.TOO_MANY(count=len(value), what=what, most=most))
    return value


def integer(value: Value, where: Where, *, least: int, most: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise where.error(messages.INTEGER(found=kind(value)))
    if not least <= value <= most:
        raise where.error(messages.INTEGER_RANGE(least=least, most=most))
    return value


def string(value: Value, where: Where, *, most: int = 200) -> str:
    if not isinstance(value, str):
        raise where.error(messages.STRING(found=kind(value)))
    if not value.strip() or len(value) > most or not value.isprintable():
        raise where.error(messages.LINE(most=most))
    return value


def literal(value: Value, where: Where) -> Fraction | None:
    """The exact value of a TOML number; ``None`` for a string, which holds an expression."""
    if isinstance(value, str):
        return None
    if isinstance(value, int) and not isinstance(value, bool):
        if value.bit_length() > MAX_INTEGER_BITS:
            raise where.error(messages.INTEGER_BITS(most=MAX_INTEGER_BITS))
        return Fraction(value)
    if isinstance(value, Decimal):
        if _SPECIAL.fullmatch(value.text):
            raise where.error(messages.FINITE(found=value.text))
        try:
            magnitude = decimal(value.text.lstrip("+-").replace("_", ""))
        except NumberError as error:
            raise where.error(error.reason) from None
        return -magnitude if value.text.startswith("-") else magnitude
    raise where.error(messages.NUMBER(found=kind(value)))


def number(value: Value, where: Where, constants: Mapping[str, sympy.Expr], refused: Refusal = unrefused) -> Fraction:
    """A rational number: a TOML number, or a string with an expression of constants."""
    exact = literal(value, where)
    return parse_number(str(value), constants, where=where, refused=refused) if exact is None else exact


def positive(value: Value, where: Where, constants: Mapping[str, sympy.Expr]) -> Fraction:
    exact = number(value, where, constants)
    if exact <= 0:
        raise where.error(messages.POSITIVE(found=shown(exact)))
    return exact


def not_negative(value: Value, where: Where, constants: Mapping[str, sympy.Expr]) -> Fraction:
    exact = number(value, where, constants)
    if exact < 0:
        raise where.error(messages.NOT_NEGATIVE(found=shown(exact)))
    return exact


def constant(
    value: Value, where: Where, constants: Mapping[str, sympy.Expr], refused: Refusal = unrefused
) -> sympy.Expr:
    """An exact real constant, possibly irrational."""
    exact = literal(value, where)
    if exact is None:
        return parse_constant(str(value), constants, where=where, refused=refused)
    return as_rational(exact)


def expression(value: Value, where: Where, names: Mapping[str, sympy.Expr], refused: Refusal = unrefused) -> Written:
    """An expression in the names, and the guards of its parts; a TOML number is one too."""
    exact = literal(value, where)
    if exact is None:
        return parse_written(str(value), names, where=where, refused=refused)
    return Written(as_rational(exact))


def is_interval(value: Value) -> bool:
    """Whether the value reads as an interval: an array of two entries that are not arrays or tables."""
    return isinstance(value, list) and len(value) == 2 and not any(isinstance(end, list | dict) for end in value)


def interval(value: Value, where: Where, constants: Mapping[str, sympy.Expr], refused: Refusal = unrefused) -> Interval:
    """A pair ``[lo, hi]`` of rational numbers, or one number for a point."""
    if isinstance(value, str) and value.lstrip().startswith("["):
        raise where.error(messages.INTERVAL_TEXT())
    if not isinstance(value, list):
        point = number(value, where, constants, refused)
        return Interval(point, point)
    if not is_interval(value):
        raise where.error(messages.INTERVAL())
    lo, hi = (number(end, where.at(position), constants, refused) for position, end in enumerate(value, 1))
    if lo > hi:
        raise where.error(messages.EMPTY_INTERVAL(lo=shown(lo), hi=shown(hi)))
    return Interval(lo, hi)


def vector(value: Value, where: Where, constants: Mapping[str, sympy.Expr], length: int | None) -> tuple[Fraction, ...]:
    """Rational numbers, as many as asked for (any number if that is not known)."""
    entries = array(value, where)
    if length is not None and len(entries) != length:
        needed = f"{length} {'number is' if length == 1 else 'numbers are'}"
        raise where.error(messages.LENGTH(needed=needed, found=len(entries)))
    return tuple(number(entry, where.at(position), constants) for position, entry in enumerate(entries, 1))
