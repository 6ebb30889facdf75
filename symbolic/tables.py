"""Typed access to a parsed TOML tree: every wrong type, missing key or unknown key is one ``InputError``."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import sympy

from symbolic.constants import as_rational
from symbolic.errors import Where, nearest, quoted, shown
from symbolic.expressions import Written, parse_constant, parse_number, parse_written
from symbolic.grammar import decimal
from symbolic.plant import Interval

MAX_FILE_BYTES = 1_000_000
MAX_INTEGER_BITS = 4_000

_SPECIAL = re.compile(r"[+-]?(inf|nan)")
# tomllib takes time quadratic in the parts of a dotted key (measured: 6 s for 16 000 parts)
_PART = rb"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_DEEP_KEY = re.compile(rb"(?<![A-Za-z0-9_-])(?:" + _PART + rb"){32}")


@dataclass(frozen=True)
class Decimal:
    """A TOML float as it is written, so that it is read as a decimal and never as a binary float."""

    text: str


Value = object


def read_toml(data: bytes, where: Where) -> Table:
    """The tree of a UTF-8 TOML document of bounded size."""
    if len(data) > MAX_FILE_BYTES:
        raise where.error(f"the file is larger than {MAX_FILE_BYTES} bytes")
    if _DEEP_KEY.search(data):
        raise where.error("a dotted key has more than 32 parts")
    try:
        return Table(tomllib.loads(data.decode("utf-8"), parse_float=Decimal), where)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise where.error(f"line {line}: the file is not UTF-8") from None
    except RecursionError:
        raise where.error("the file is nested too deeply") from None
    except ValueError as error:
        raise where.error(f"not valid TOML: {error}") from None


class Table:
    """A table and its place; ``keys`` are all keys that it may have."""

    def __init__(self, value: Value, where: Where, keys: Sequence[str] | None = None) -> None:
        if not isinstance(value, dict):
            raise where.error(f"a table is needed, found {kind(value)}")
        self.entries: Mapping[str, Value] = value
        self.where = where
        if keys is not None:
            self.allow(keys)

    def allow(self, keys: Sequence[str]) -> None:
        """Refuses every key that is not listed, with the nearest one."""
        for key in self.entries:
            if key not in keys:
                near = nearest(key, keys)
                hint = f"did you mean {quoted(near)}?" if near else f"known keys: {', '.join(keys) or 'none'}"
                raise self.where.error(f"unknown key {quoted(key)}; {hint}")

    def __contains__(self, key: str) -> bool:
        return key in self.entries

    def at(self, key: str) -> Where:
        return self.where.at(key)

    def need(self, key: str, example: str = "") -> Value:
        """The value of a key that has no default; the refusal shows how it may be written."""
        if key not in self.entries:
            raise self.at(key).error(f"missing; for example {example}" if example else "missing")
        return self.entries[key]

    def table(self, key: str, keys: Sequence[str] | None = None) -> Table:
        """The table under the key; an empty one when the key is left out."""
        return Table(self.entries.get(key, {}), self.at(key), keys)


def kind(value: Value) -> str:
    """The type of a TOML value in words."""
    if isinstance(value, bool):
        return "a boolean"
    names = {dict: "a table", list: "an array", str: "a string", int: "an integer", Decimal: "a decimal number"}
    return names.get(type(value), "a date or time")


def array(value: Value, where: Where, *, most: int | None = None, what: str = "entries") -> list[Value]:
    if not isinstance(value, list):
        raise where.error(f"an array is needed, found {kind(value)}")
    if most is not None and len(value) > most:
        raise where.error(f"{len(value)} {what}, more than {most}")
    return value


def integer(value: Value, where: Where, *, least: int, most: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise where.error(f"an integer is needed, found {kind(value)}")
    if not least <= value <= most:
        raise where.error(f"an integer from {least} to {most} is needed")
    return value


def string(value: Value, where: Where, *, most: int = 200) -> str:
    if not isinstance(value, str):
        raise where.error(f"a string is needed, found {kind(value)}")
    if not value.strip() or len(value) > most or not value.isprintable():
        raise where.error(f"a line of 1 to {most} printable characters is needed")
    return value


def literal(value: Value, where: Where) -> Fraction | None:
    """The exact value of a TOML number; ``None`` for a string, which holds an expression."""
    if isinstance(value, str):
        return None
    if isinstance(value, int) and not isinstance(value, bool):
        if value.bit_length() > MAX_INTEGER_BITS:
            raise where.error(f"the integer has more than {MAX_INTEGER_BITS} bits")
        return Fraction(value)
    if isinstance(value, Decimal):
        if _SPECIAL.fullmatch(value.text):
            raise where.error(f"a finite number is needed, found {value.text}")
        try:
            magnitude = decimal(value.text.lstrip("+-").replace("_", ""))
        except ValueError as error:
            raise where.error(str(error)) from None
        return -magnitude if value.text.startswith("-") else magnitude
    raise where.error(f"a number or a string with an expression is needed, found {kind(value)}")


def number(value: Value, where: Where, constants: Mapping[str, sympy.Expr]) -> Fraction:
    """A rational number: a TOML number, or a string with an expression of constants."""
    exact = literal(value, where)
    return parse_number(str(value), constants, where=where) if exact is None else exact


def positive(value: Value, where: Where, constants: Mapping[str, sympy.Expr]) -> Fraction:
    exact = number(value, where, constants)
    if exact <= 0:
        raise where.error(f"a positive number is needed, found {shown(exact)}")
    return exact


def constant(value: Value, where: Where, constants: Mapping[str, sympy.Expr]) -> sympy.Expr:
    """An exact real constant, possibly irrational."""
    exact = literal(value, where)
    return parse_constant(str(value), constants, where=where) if exact is None else as_rational(exact)


def expression(
    value: Value, where: Where, names: Mapping[str, sympy.Expr], refused: Mapping[str, str] | None = None
) -> Written:
    """An expression in the names, and the guards of its parts; a TOML number is one too."""
    exact = literal(value, where)
    if exact is None:
        return parse_written(str(value), names, where=where, refused=refused)
    return Written(as_rational(exact))


def is_interval(value: Value) -> bool:
    """Whether the value reads as an interval: an array of two entries that are not arrays or tables."""
    return isinstance(value, list) and len(value) == 2 and not any(isinstance(end, list | dict) for end in value)


def interval(value: Value, where: Where, constants: Mapping[str, sympy.Expr]) -> Interval:
    """A pair ``[lo, hi]`` of rational numbers, or one number for a point."""
    if not isinstance(value, list):
        point = number(value, where, constants)
        return Interval(point, point)
    if not is_interval(value):
        raise where.error("an interval is a pair [lo, hi] of numbers")
    lo, hi = (number(end, where.at(position), constants) for position, end in enumerate(value, 1))
    if lo > hi:
        raise where.error(f"the interval [{shown(lo)}, {shown(hi)}] is empty")
    return Interval(lo, hi)


def vector(value: Value, where: Where, constants: Mapping[str, sympy.Expr], length: int) -> tuple[Fraction, ...]:
    entries = array(value, where)
    if len(entries) != length:
        raise where.error(f"{length} {'number is' if length == 1 else 'numbers are'} needed, found {len(entries)}")
    return tuple(number(entry, where.at(position), constants) for position, entry in enumerate(entries, 1))
