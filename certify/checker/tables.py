"""Typed access to the tree of a plant file: every wrong type, missing key or unknown key is ``Malformed``."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from certify.checker.expressions import CONSTANTS, FUNCTIONS, NAME, Node, Number, decimal, parse
from certify.checker.verdict import Malformed

MAX_BYTES = 1_000_000
MAX_ENTRIES = 10_000

Box = tuple[Fraction, Fraction]
_KEY_PART = rb"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_DEEP_KEY = re.compile(rb"(?<![A-Za-z0-9_-])(?:" + _KEY_PART + rb"){32}")  # on which tomllib takes quadratic time


@dataclass(frozen=True)
class Decimal:
    """A TOML float as it is written."""

    text: str


def read_toml(data: bytes) -> dict[str, Any]:
    """The tree of a TOML document of bounded size."""
    if len(data) > MAX_BYTES or _DEEP_KEY.search(data):
        raise Malformed("the plant file is too large")
    try:
        return tomllib.loads(data.decode("utf-8"), parse_float=Decimal)
    except (ValueError, RecursionError) as error:
        raise Malformed(f"the plant file is not TOML: {error}") from None


def table_of(value: Any, needed: str, optional: str = "") -> dict[str, Any]:
    """The table, if it has all the needed keys and no others than these and the optional ones."""
    if not isinstance(value, dict):
        raise Malformed("a table is needed")
    for key in value:
        if key not in needed.split() and key not in optional.split():
            raise Malformed(f"unknown key {key[:40]!r}")
    for key in needed.split():
        if key not in value:
            raise Malformed(f"the key {key} is missing")
    return value


def array(value: Any, length: int | None = None, most: int = MAX_ENTRIES) -> list[Any]:
    if not isinstance(value, list) or len(value) > most or length not in (None, len(value)):
        raise Malformed("an array" + (f" of {length} entries" if length is not None else "") + " is needed")
    return value


def integer(value: Any, least: int, most: int) -> int:
    if type(value) is not int or not least <= value <= most:
        raise Malformed(f"an integer from {least} to {most} is needed")
    return value


def expression(value: Any, names: Mapping[str, Node]) -> Node:
    """A TOML number, read as the decimal it is, or a string holding an expression."""
    if type(value) is int and value.bit_length() <= 4000:
        return Number(Fraction(value))
    if isinstance(value, Decimal):
        size = decimal(value.text.lstrip("+-").replace("_", ""))
        return Number(-size if value.text.startswith("-") else size)
    if not isinstance(value, str):
        raise Malformed("a number or an expression is needed")
    return parse(value, names)


def rational(value: Any, constants: Mapping[str, Node]) -> Fraction:
    node = expression(value, constants)
    if not isinstance(node, Number):
        raise Malformed("a rational number is needed")
    return node.value


def vector(value: Any, constants: Mapping[str, Node], length: int | None = None) -> tuple[Fraction, ...]:
    return tuple(rational(entry, constants) for entry in array(value, length))


def is_box(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and not any(isinstance(end, (list, dict)) for end in value)


def box(value: Any, constants: Mapping[str, Node]) -> Box:
    """A pair ``[lo, hi]``, or one number for a point."""
    lo, hi = vector(value, constants, 2) if isinstance(value, list) else [rational(value, constants)] * 2
    if lo > hi:
        raise Malformed("an interval is empty")
    return lo, hi


def declared(name: Any, taken: set[str]) -> str:
    """A new name, which from now on is taken."""
    if not isinstance(name, str) or not NAME.fullmatch(name) or len(name) > 40:
        raise Malformed(f"not a name: {str(name)[:40]!r}")
    if name in taken or name in {*FUNCTIONS, *CONSTANTS, "s", "id"} or re.fullmatch("x[0-9]+", name):
        raise Malformed(f"the name {name} is taken")
    taken.add(name)
    return name


def any_keys(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict) or len(value) > MAX_ENTRIES:
        raise Malformed("a table is needed")
    return value
