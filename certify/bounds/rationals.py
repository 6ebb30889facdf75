"""Outward rounding of exact rationals: short numbers that stay on the safe side."""

from __future__ import annotations

from fractions import Fraction
from math import floor, isqrt, log10

SHORT_BITS = 64


def _exponent(value: Fraction) -> int:
    """``e`` with ``2^e <= |value| < 2^(e+2)``; ``value`` is not zero."""
    return abs(value.numerator).bit_length() - value.denominator.bit_length() - 1


def round_up(value: Fraction, bits: int = SHORT_BITS) -> Fraction:
    """The least dyadic rational with about ``bits`` significant bits that is ``>= value``; zero stays zero."""
    return -round_down(-value, bits)


def round_down(value: Fraction, bits: int = SHORT_BITS) -> Fraction:
    """The greatest dyadic rational with about ``bits`` significant bits that is ``<= value``; zero stays zero."""
    if bits < 2:
        raise ValueError(f"at least 2 bits are needed to round, not {bits}")
    if value == 0:
        return value
    shift = bits - _exponent(value)
    if shift >= 0:
        return Fraction((value.numerator << shift) // value.denominator, 1 << shift)
    return Fraction(value.numerator // (value.denominator << -shift) << -shift)


def sqrt_down(value: Fraction, bits: int = SHORT_BITS) -> Fraction:
    """A rational ``r >= 0`` with ``r² <= value``, relative error about ``2^-bits``; exact for squares of rationals.

    Raises ``ValueError`` for a negative value.
    """
    return _sqrt(value, bits)[0]


def sqrt_up(value: Fraction, bits: int = SHORT_BITS) -> Fraction:
    """A rational ``r`` with ``r² >= value``, relative error about ``2^-bits``; exact for squares of rationals.

    Raises ``ValueError`` for a negative value.
    """
    return _sqrt(value, bits)[1]


def _sqrt(value: Fraction, bits: int) -> tuple[Fraction, Fraction]:
    if value < 0:
        raise ValueError("a negative number has no real square root")
    p, q = value.numerator, value.denominator
    root_p, root_q = isqrt(p), isqrt(q)
    if root_p * root_p == p and root_q * root_q == q:
        return Fraction(root_p, root_q), Fraction(root_p, root_q)
    half_shift = bits - _exponent(value) // 2
    if half_shift >= 0:
        scaled = (p << 2 * half_shift) // q
        unit = Fraction(1, 1 << half_shift)
    else:
        scaled = p // (q << -2 * half_shift)
        unit = Fraction(1 << -half_shift)
    root = isqrt(scaled)
    return root * unit, (root + 1) * unit


def log10_estimate(value: Fraction) -> float:
    """``log10 |value|`` of a nonzero rational of any size, as a float to be shown."""
    return log10(abs(value.numerator)) - log10(value.denominator)


def scientific(value: Fraction, digits: int = 3) -> str:
    """A rational of any size to be shown, rounded to ``digits >= 2`` significant digits: ``-1.25e+40``, ``45200``."""
    if value == 0:
        return "0"
    exponent = floor(log10_estimate(value))
    scaled = round(abs(value) / Fraction(10) ** (exponent - digits + 1))
    if scaled >= 10**digits:
        scaled, exponent = round(Fraction(scaled, 10)), exponent + 1
    sign, plain = "-" if value < 0 else "", Fraction(scaled) * Fraction(10) ** (exponent - digits + 1)
    if -3 <= exponent <= 6:
        return f"{sign}{float(plain):g}"
    mantissa = str(scaled)
    return f"{sign}{mantissa[0]}.{mantissa[1:]}e{exponent:+d}"
