"""Binary floating-point formats, and the constants of a controller rounded to them with a proved bound."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

from certify.bounds.conversions import to_interval
from symbolic.errors import InputError

Exact = Any  # a Fraction, or a ball (python-flint has no types) that encloses the number
Arithmetic = Literal["double", "single"]

PRECISION = 512  # bits of the enclosures that are rounded: far beyond the 53 that remain
_WIDTH = Fraction(1, 2**20)  # of an enclosure, in units of the last place: more is no enclosure of one number


@dataclass(frozen=True)
class Format:
    """IEEE 754 ``binary64`` or ``binary32``: ``bits`` of the significand, normal numbers from ``2^least`` to below
    ``2^most``."""

    name: Arithmetic
    bits: int
    least: int
    most: int

    def nearest(self, value: Fraction) -> Fraction:
        """The nearest number of the format, ties to even. Raises ``OverflowError`` outside the normal range."""
        if value == 0:
            return value
        size = abs(value)
        exponent = size.numerator.bit_length() - size.denominator.bit_length()
        if size < Fraction(2) ** exponent:
            exponent -= 1
        unit = Fraction(2) ** (exponent - self.bits + 1)
        rounded = round(value / unit) * unit
        if not Fraction(2) ** self.least <= abs(rounded) < Fraction(2) ** self.most:
            raise OverflowError
        return rounded


DOUBLE = Format("double", 53, -1022, 1024)
SINGLE = Format("single", 24, -126, 128)
FORMATS = {DOUBLE.name: DOUBLE, SINGLE.name: SINGLE}


@dataclass(frozen=True)
class Constant:
    """A named number of a format: its ``value``, exactly, and ``error ≥ |value − what it stands for|``."""

    name: str
    meaning: str
    value: Fraction
    error: Fraction

    @property
    def number(self) -> float:
        return float(self.value)  # exact: no format here has more bits than a float

    @property
    def hexadecimal(self) -> str:
        """As C and ``float.fromhex`` read it."""
        return self.number.hex()


def constant(name: str, meaning: str, exact: Exact, format: Format) -> Constant:
    """The constant that stands for a number that is known exactly or enclosed.

    Raises ``InputError`` naming it if the format has no normal number near it.
    """
    lo, hi = (exact, exact) if isinstance(exact, Fraction) else (to_interval(exact).lo, to_interval(exact).hi)
    try:
        value = format.nearest((lo + hi) / 2) if lo <= 0 <= hi and lo < hi else format.nearest(lo)
    except OverflowError:
        raise InputError(f"{meaning} ({name}) is about {float_text(lo)}: no normal {format.name}") from None
    if hi - lo > _WIDTH * abs(value) * Fraction(2) ** -format.bits and value != 0:
        raise InputError(f"{meaning} ({name}) could not be enclosed tightly enough to be rounded")
    return Constant(name, meaning, value, max(abs(value - lo), abs(hi - value)))


def float_text(value: Fraction) -> str:
    """Of any size, to one digit."""
    if value == 0:
        return "0"
    digits = len(str(abs(value.numerator))) - len(str(value.denominator))
    return f"{'-' if value < 0 else ''}1e{digits:+d}"
