"""Intervals ``[a·2^e, b·2^e]`` with integers ``a ≤ b``: every operation rounds outward to 128 bits of the larger end.

Comparisons hold only if they hold for all members: ``x < y`` is a proof, ``not x < y`` says nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import product
from math import isqrt
from typing import TypeAlias

from certify.checker.verdict import Undecided, show

BITS = 128
LARGEST_MANTISSA = 1 << BITS
LARGEST_EXPONENT = 1 << 24
MAX_VERTICES = 1 << 10
LARGEST_EXP_ARGUMENT = 1 << 22
_GUARD = 512
_EXP_BITS = 192

Number: TypeAlias = "Interval | Fraction | int"


class Interval:
    """The numbers between ``a·2^e`` and ``b·2^e``."""

    __slots__ = ("a", "b", "e")

    def __init__(self, a: int, b: int, e: int = 0) -> None:
        if a <= -LARGEST_MANTISSA or b >= LARGEST_MANTISSA:
            excess = max(a.bit_length(), b.bit_length()) - BITS
            a, b, e = a >> excess, -(-b >> excess), e + excess
        if not -LARGEST_EXPONENT < e < LARGEST_EXPONENT:
            raise Undecided("a number out of range")
        self.a, self.b, self.e = a, b, e

    @property
    def lo(self) -> Fraction:
        return _dyadic(self.a, self.e)

    @property
    def hi(self) -> Fraction:
        return _dyadic(self.b, self.e)

    @property
    def lower(self) -> Interval:
        return Interval(self.a, self.a, self.e)

    @property
    def upper(self) -> Interval:
        return Interval(self.b, self.b, self.e)

    @property
    def magnitude(self) -> Interval:
        """The largest absolute value, as a point."""
        size = max(-self.a, self.b)
        return Interval(size, size, self.e)

    @property
    def is_zero(self) -> bool:
        return self.a == self.b == 0

    def __str__(self) -> str:
        return show(self.lo) if self.a == self.b else f"[{show(self.lo)}, {show(self.hi)}]"

    def __neg__(self) -> Interval:
        return Interval(-self.b, -self.a, self.e)

    def __add__(self, other: Number) -> Interval:
        x, y = self, enclose(other)
        if x.e < y.e:
            x, y = y, x
        if x.is_zero:
            return y
        shift = x.e - y.e
        if shift <= _GUARD:
            return Interval((x.a << shift) + y.a, (x.b << shift) + y.b, y.e)
        drop = shift - _GUARD
        return Interval((x.a << _GUARD) + (y.a >> drop), (x.b << _GUARD) - (-y.b >> drop), y.e + drop)

    __radd__ = __add__

    def __sub__(self, other: Number) -> Interval:
        return self + (-enclose(other))

    def __rsub__(self, other: Number) -> Interval:
        return -self + other

    def __mul__(self, other: Number) -> Interval:
        y = enclose(other)
        if self.a >= 0 and y.a >= 0:
            return Interval(self.a * y.a, self.b * y.b, self.e + y.e)
        products = (self.a * y.a, self.a * y.b, self.b * y.a, self.b * y.b)
        return Interval(min(products), max(products), self.e + y.e)

    __rmul__ = __mul__

    def reciprocal(self) -> Interval:
        if self.a <= 0 <= self.b:
            raise Undecided(f"division by {self}")
        one = 1 << 2 * BITS
        return Interval(one // self.b, -(-one // self.a), -2 * BITS - self.e)

    def __truediv__(self, other: Number) -> Interval:
        return self * enclose(other).reciprocal()

    def __rtruediv__(self, other: Number) -> Interval:
        return other * self.reciprocal()

    def __pow__(self, exponent: int) -> Interval:
        if exponent < 0:
            return self.reciprocal() ** -exponent
        if exponent == 0:
            return Interval(1, 1)
        if exponent % 2 == 0 and self.a < 0:
            inner = 0 if self.b >= 0 else -self.b
            return Interval(inner, max(-self.a, self.b), self.e) ** exponent
        if self.a >= 0:
            return _power(self, exponent)
        return hull(_power(self.lower, exponent), _power(self.upper, exponent))

    def sqrt(self) -> Interval:
        if self.a < 0:
            raise Undecided(f"square root of {self}")
        shift = 2 * BITS + self.e % 2
        high = self.b << shift
        root = isqrt(high)
        return Interval(isqrt(self.a << shift), root + (root * root < high), (self.e - shift) // 2)

    def exp(self) -> Interval:
        return hull(_exp(self.lower), _exp(self.upper))

    def __lt__(self, other: Number) -> bool:
        y = enclose(other)
        shift = self.e - y.e
        return self.b << shift < y.a if shift >= 0 else self.b < y.a << -shift

    def __le__(self, other: Number) -> bool:
        y = enclose(other)
        shift = self.e - y.e
        return self.b << shift <= y.a if shift >= 0 else self.b <= y.a << -shift

    def __gt__(self, other: Number) -> bool:
        return enclose(other) < self

    def __ge__(self, other: Number) -> bool:
        return enclose(other) <= self


def enclose(value: Number) -> Interval:
    """The tightest interval around a rational number; an interval is left as it is."""
    if isinstance(value, Interval):
        return value
    p, q = value.numerator, value.denominator
    if q == 1:
        return Interval(p, p)
    shift = max(0, BITS + 2 + q.bit_length() - p.bit_length())
    return Interval((p << shift) // q, -((-p << shift) // q), -shift)


def between(lo: Number, hi: Number) -> Interval:
    """An interval around ``[lo, hi]``."""
    return hull(enclose(lo), enclose(hi))


def symmetric(radius: Number) -> Interval:
    """An interval around ``[−radius, radius]``."""
    return hull(-enclose(radius), enclose(radius))


def hull(*parts: Interval) -> Interval:
    """The least interval around the parts (after rounding)."""
    sizes = [part.e + max(part.a.bit_length(), part.b.bit_length()) for part in parts if not part.is_zero]
    e = max(min(part.e for part in parts if not part.is_zero), max(sizes) - _GUARD) if sizes else 0
    return Interval(min(_at(part.a, part.e - e) for part in parts), max(-_at(-part.b, part.e - e) for part in parts), e)


def maximum(*parts: Interval) -> Interval:
    """An enclosure of the largest of the numbers enclosed by the parts, as a point above all of them."""
    return hull(*(part.upper for part in parts)).upper


def norm(parts: Iterable[Interval]) -> Interval:
    """An upper bound of the Euclidean norm of every vector in the box, as a point."""
    return total(part.magnitude**2 for part in parts).sqrt().upper


def total(parts: Iterable[Interval]) -> Interval:
    return sum(parts, Interval(0, 0))


def quadratic_bound(P: Sequence[Sequence[Fraction]], box: list[Interval]) -> Interval:
    """An upper bound of the convex form ``xᵀPx`` on a box: at its vertices, or by ``|P|`` if they are many."""
    free = [k for k, x in enumerate(box) if x.a < x.b]
    if 1 << len(free) > MAX_VERTICES:
        box = [x.magnitude for x in box]
        return _form([[abs(entry) for entry in row] for row in P], box).upper
    forms = []
    for ends in product((False, True), repeat=len(free)):
        vertex = list(box)
        for k, high in zip(free, ends, strict=True):
            vertex[k] = box[k].upper if high else box[k].lower
        forms.append(_form(P, vertex))
    return maximum(*forms) if forms else Interval(0, 0)


def _form(P: Sequence[Sequence[Fraction]], x: list[Interval]) -> Interval:
    result = Interval(0, 0)
    for j, row in enumerate(P):
        result = result + row[j] * x[j] ** 2
        for k in range(j):
            result = result + 2 * row[k] * x[j] * x[k]
    return result


def _at(mantissa: int, shift: int) -> int:
    """Floor of ``mantissa·2^shift``."""
    return mantissa << shift if shift >= 0 else mantissa >> -shift


def _dyadic(mantissa: int, e: int) -> Fraction:
    return Fraction(mantissa << e) if e >= 0 else Fraction(mantissa, 1 << -e)


def _power(x: Interval, exponent: int) -> Interval:
    """By multiplications, for a point or nonnegative numbers."""
    if exponent == 1:
        return x
    root = _power(x, exponent // 2)
    return root * root * x if exponent % 2 else root * root


def _exp(x: Interval) -> Interval:
    """``e^x`` of a point: the Taylor sum at ``r = |x|/2^n < 1/4``, then ``n`` squarings.

    In units of 2^-192: dropping the terms from ``r^36/36!`` on costs less than one, rounding ``r`` and 35 terms down
    less than 100.
    """
    if x.is_zero:
        return Interval(1, 1)
    if x.a < 0:
        inverse = _exp(-x if x > -LARGEST_EXP_ARGUMENT else enclose(LARGEST_EXP_ARGUMENT)).reciprocal()
        return inverse if x > -LARGEST_EXP_ARGUMENT else hull(Interval(0, 0), inverse)
    if x > LARGEST_EXP_ARGUMENT:
        raise Undecided("exp of a number out of range")
    n = max(0, x.a.bit_length() + x.e + 2)
    r = _at(x.a, x.e - n + _EXP_BITS)
    result = term = 1 << _EXP_BITS
    for j in range(1, 36):
        term = (term * r >> _EXP_BITS) // j
        result += term
    enclosure = Interval(result, result + 128, -_EXP_BITS)
    for _ in range(n):
        enclosure = enclosure * enclosure
    return enclosure
