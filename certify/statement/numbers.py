"""Exact rationals as short text: correctly rounded digits and log₁₀ by integer arithmetic, whatever the size.

Nothing here passes through a float, and no integer beyond a few digits is turned into text, so a gain of 1e+5000 is
as good as one of 5. ``nearest`` rounds half to even; ``up`` and ``down`` round towards plus and minus infinity, for
thresholds whose text must not promise more than the number does.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

Rounding = Literal["nearest", "up", "down"]

SIGNIFICANT = 4
EXACT_DIGITS = 7
LOG10_DIGITS = 2
_PLAIN = range(-4, 7)
_LOG10_FROM = 6
_MAX_FRACTION_BITS = 24
_GUARD_DIGITS = 12


@dataclass(frozen=True)
class Shown:
    """A number as ASCII text: ``-0.0625``, ``2/11``, ``4.217e44``; ``log10`` is given beside large and small ones."""

    text: str
    exact: bool
    log10: str | None

    def __str__(self) -> str:
        return self.text if self.log10 is None else f"{self.text} (log10 {self.log10})"


def shown(value: Fraction | int, significant: int = SIGNIFICANT, rounding: Rounding = "nearest") -> Shown:
    """A short decimal, exact if at most seven digits are enough, with log₁₀ where ``|value|`` is ≥ 1e6 or < 1e-6."""
    x = Fraction(value)
    exact = _exact_decimal(x)
    text = _rounded(x, significant, rounding) if exact is None else exact
    far = x > 0 and abs(floor_log10(x) + Fraction(1, 2)) > _LOG10_FROM
    return Shown(text, exact is not None, log10(x) if far else None)


def rounded(value: Fraction | int, significant: int, rounding: Rounding) -> str:
    """Always that many significant digits, plain from 1e-4 to 1e7: ``0.572``, ``7190``, ``1.10e9``."""
    x = Fraction(value)
    if x == 0:
        return "0"
    mantissa, exponent = _scaled(x, significant, rounding)
    return _plain(mantissa, exponent, significant) if exponent in _PLAIN else scientific(x, significant, rounding)


def fraction(value: Fraction | int, significant: int = SIGNIFICANT) -> Shown:
    """``p/q`` where that is short, else as :func:`shown`."""
    x = Fraction(value)
    short = max(x.numerator.bit_length(), x.denominator.bit_length()) <= _MAX_FRACTION_BITS // 2
    return Shown(str(x), True, None) if short else shown(x, significant)


def with_log10(value: Fraction | int, significant: int = SIGNIFICANT) -> str:
    """``4.217e44 (log10 44.63)``; without the parenthesis for numbers of ordinary size."""
    return str(shown(value, significant))


def scientific(value: Fraction | int, significant: int = SIGNIFICANT, rounding: Rounding = "nearest") -> str:
    """``d.ddde±x`` with the given number of significant digits, correctly rounded; trailing zeros are kept."""
    x = Fraction(value)
    if x == 0:
        return "0"
    mantissa, exponent = _scaled(x, significant, rounding)
    digits = str(abs(mantissa))
    point = digits if significant == 1 else f"{digits[0]}.{digits[1:]}"
    return f"{'-' if x < 0 else ''}{point}e{exponent}"


def log10(value: Fraction | int, digits: int = LOG10_DIGITS) -> str:
    """log₁₀ of a positive number, correctly rounded to ``digits`` decimals. Raises ``ValueError`` for others.

    Digit ``k`` of the fractional part is the exponent of the mantissa's ``10^k``-th power, followed in fixed-point
    intervals. A logarithm in the middle of two decimals is irrational, so a wider interval decides in the end.
    """
    x = Fraction(value)
    if x <= 0:
        raise ValueError(f"log10 needs a positive number, not {_rounded(x, SIGNIFICANT, 'nearest')}")
    twice = None
    width = digits + _GUARD_DIGITS
    while twice is None:
        twice = _floor_log10_of_powers(x, [10] * digits + [2], width)
        width *= 2
    nearest = (twice + 1) // 2
    whole, part = divmod(abs(nearest), 10**digits)
    text = f"{whole}.{part:0{digits}d}" if digits else str(whole)
    return f"-{text}" if nearest < 0 else text


def floor_log10(value: Fraction | int) -> int:
    """The largest integer ``e`` with ``10^e ≤ |value|``. Raises ``ValueError`` for zero."""
    x = abs(Fraction(value))
    if x == 0:
        raise ValueError("zero has no logarithm")
    bits = x.numerator.bit_length() - x.denominator.bit_length()
    e = bits * 30103 // 100000
    while _at_least_power(x, e + 1):
        e += 1
    while not _at_least_power(x, e):
        e -= 1
    return e


def _at_least_power(x: Fraction, e: int) -> bool:
    """``x ≥ 10^e``."""
    return x.numerator >= x.denominator * 10**e if e >= 0 else x.numerator * 10**-e >= x.denominator


def _floor_log10_of_powers(x: Fraction, powers: list[int], width: int) -> int | None:
    """``⌊log₁₀ x^(Π powers)⌋``, or None when ``width`` decimals of the mantissa do not decide it."""
    total = floor_log10(x)
    one = 10**width
    lo, remainder = _divide(x, width - total)
    hi = lo + (remainder != 0)
    for power in powers:
        lo = lo**power // one ** (power - 1)
        hi = -(-(hi**power) // one ** (power - 1))
        carry = _digit_count(lo) - 1 - width
        if _digit_count(hi) - 1 - width != carry:
            return None
        total = total * power + carry
        lo, hi = lo // 10**carry, -(-hi // 10**carry)
    return total


def _digit_count(n: int) -> int:
    return floor_log10(n) + 1


def _divide(x: Fraction, shift: int) -> tuple[int, int]:
    """Floor and remainder of ``x · 10^shift``."""
    if shift >= 0:
        return divmod(x.numerator * 10**shift, x.denominator)
    return divmod(x.numerator, x.denominator * 10**-shift)


def _scaled(x: Fraction, significant: int, rounding: Rounding) -> tuple[int, int]:
    """``(m, e)`` with ``m`` of ``significant`` digits and ``m · 10^(e + 1 − significant)`` the rounded ``x ≠ 0``."""
    if significant < 1:
        raise ValueError("at least one significant digit is needed")
    exponent = floor_log10(x)
    shift = significant - 1 - exponent
    scaled = x * 10**shift if shift >= 0 else x / 10**-shift
    mantissa = round(scaled) if rounding == "nearest" else _ceil(scaled) if rounding == "up" else _floor(scaled)
    if abs(mantissa) == 10**significant:
        return mantissa // 10, exponent + 1
    return mantissa, exponent


def _floor(x: Fraction) -> int:
    return x.numerator // x.denominator


def _ceil(x: Fraction) -> int:
    return -(-x.numerator // x.denominator)


def _exact_decimal(x: Fraction) -> str | None:
    """All digits of ``x`` if there are at most seven significant ones, else None."""
    if x == 0:
        return "0"
    mantissa, exponent = _scaled(x, EXACT_DIGITS, "down")
    shift = exponent + 1 - EXACT_DIGITS
    if x * 10 ** max(-shift, 0) != Fraction(mantissa * 10 ** max(shift, 0)):
        return None
    return _written(mantissa, exponent, EXACT_DIGITS)


def _rounded(x: Fraction, significant: int, rounding: Rounding) -> str:
    """The shortest usual notation of the rounded number; zeros that carry precision are kept."""
    if x == 0:
        return "0"
    mantissa, exponent = _scaled(x, significant, rounding)
    if exponent not in _PLAIN or exponent >= significant:
        return scientific(x, significant, rounding)
    return _plain(mantissa, exponent, significant)


def _written(mantissa: int, exponent: int, significant: int) -> str:
    """An exact number without trailing zeros."""
    if exponent in _PLAIN:
        text = _plain(mantissa, exponent, significant)
        return text.rstrip("0").rstrip(".") if "." in text else text
    digits = str(abs(mantissa)).rstrip("0")
    point = digits if len(digits) == 1 else f"{digits[0]}.{digits[1:]}"
    return f"{'-' if mantissa < 0 else ''}{point}e{exponent}"


def _plain(mantissa: int, exponent: int, significant: int) -> str:
    digits = str(abs(mantissa))
    sign = "-" if mantissa < 0 else ""
    if exponent < 0:
        return f"{sign}0.{'0' * (-exponent - 1)}{digits}"
    if exponent >= significant - 1:
        return sign + digits + "0" * (exponent + 1 - significant)
    return f"{sign}{digits[: exponent + 1]}.{digits[exponent + 1 :]}"
