"""Values of functions on a half-line: ``f(s) ∈ s^p e^(ks)·[c]`` for all ``s ≥ start``, with rational ``p`` and ``k``.

Keeping the growth apart from the bounded factor lets the parts of ``e^s/(1 + e^s)²`` cancel where plain intervals with
infinite ends would not. ``affine = (a, b)`` says that the value is exactly ``a s + b``, which is what ``exp`` needs.
"""

from __future__ import annotations

from fractions import Fraction
from math import floor, isqrt
from typing import Any

from certify.checker.functions import call as interval_call
from certify.checker.intervals import Interval, between, enclose, hull
from certify.checker.verdict import Undecided

Growth = tuple[Fraction, Fraction]  # (k, p): compared in this order
FLAT: Growth = (Fraction(0), Fraction(0))


class Tail:
    """``s^p e^(ks)·[c]`` for ``s ≥ start``; ``start`` is a power of 4."""

    def __init__(self, start: int, c: Interval, growth: Growth = FLAT, affine: Growth | None = None) -> None:
        self.start = start
        self.c = c
        self.growth = FLAT if c.is_zero else growth
        self.affine = affine

    def scalar(self, value: Any) -> Tail:
        if isinstance(value, Tail):
            return value
        exact = None if isinstance(value, Interval) else (Fraction(0), Fraction(value))
        return Tail(self.start, enclose(value), FLAT, exact)

    def range(self) -> Interval:
        """An enclosure of all values. Raises ``Undecided`` when they are unbounded or not known to be bounded."""
        return self.c * self.ratio(self.growth)

    def ratio(self, growth: Growth) -> Interval:
        """An enclosure of ``s^p e^(ks)`` on the half-line; growing functions are refused."""
        k, p = growth
        if growth == FLAT:
            return Interval(1, 1)
        if k > 0 or (k == 0 and p > 0) or (k < 0 and p > -k * self.start):
            raise Undecided("the expression is not shown to be bounded on the whole line")
        if (2 * p).denominator != 1 or abs(p) > 64:
            raise Undecided("a root of a root on the whole line")
        largest = Interval(isqrt(self.start), isqrt(self.start)) ** int(2 * p) * enclose(k * self.start).exp()
        return hull(Interval(0, 0), largest)  # decreasing, since p ≤ −k·start

    def __neg__(self) -> Tail:
        return self * -1

    def __add__(self, other: Any) -> Tail:
        x, y = self, self.scalar(other)
        affine = (x.affine[0] + y.affine[0], x.affine[1] + y.affine[1]) if x.affine and y.affine else None
        if y.c.is_zero or x.c.is_zero:
            kept = x if y.c.is_zero else y
            return Tail(self.start, kept.c, kept.growth, affine)
        if x.growth < y.growth:
            x, y = y, x
        k, p = y.growth[0] - x.growth[0], y.growth[1] - x.growth[1]
        return Tail(self.start, x.c + y.c * self.ratio((k, p)), x.growth, affine)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Tail:
        return self + -self.scalar(other)

    def __mul__(self, other: Any) -> Tail:
        other = self.scalar(other)
        affine = None
        if self.affine and other.affine and 0 in (self.affine[0], other.affine[0]):
            (a, b), (c, d) = self.affine, other.affine
            affine = (a * d + b * c, b * d)
        growth = (self.growth[0] + other.growth[0], self.growth[1] + other.growth[1])
        return Tail(self.start, self.c * other.c, growth, affine)

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> Tail:
        growth = (self.growth[0] * exponent, self.growth[1] * exponent)
        return Tail(self.start, self.c**exponent, growth, self.affine if exponent == 1 else None)

    def __truediv__(self, other: Any) -> Tail:
        other = self.scalar(other)
        if other.affine and other.affine[0] == 0 and other.affine[1]:
            return self * (1 / other.affine[1])
        return self * other**-1

    def __rtruediv__(self, other: Any) -> Tail:
        return other * self**-1


def call(function: str, u: Tail) -> Tail:
    """A function of a tail. Raises ``Undecided`` for what the scale ``s^p e^(ks)`` does not hold."""
    halved = (u.growth[0] / 2, u.growth[1] / 2)
    if function == "sqrt":
        return Tail(u.start, interval_call("sqrt", u.c), halved)
    if function == "exp" and u.affine:
        return Tail(u.start, enclose(u.affine[1]).exp(), (u.affine[0], Fraction(0)))
    if u.growth <= FLAT:
        return Tail(u.start, interval_call(function, u.range()))
    if function in ("sinh", "cosh", "tanh") and u.affine:
        up, down = call("exp", u), call("exp", -u)
        return (up - down) / (up + down) if function == "tanh" else (up + down if function == "cosh" else up - down) / 2
    if function in ("sin", "cos"):
        return Tail(u.start, Interval(-1, 1))
    if min(u.growth) < 0 or not (u.c > 0 or u.c < 0):
        raise Undecided(f"{function} of an argument whose growth is not known")
    end = (u.c.lower if u.c > 0 else u.c.upper) * u.start ** floor(u.growth[1])  # |u| ≥ |end|, with the same sign
    if function == "atan":
        value = interval_call(function, end)
        return Tail(u.start, between(value.lo, 2) if u.c > 0 else between(-2, value.hi))
    if function == "exp" and u.c < 0 and u.growth[1] >= 1:  # u ≤ −rate·s
        rate = -u.c.hi * Fraction(u.start) ** (floor(u.growth[1]) - 1)
        return Tail(u.start, Interval(0, 1), (-rate, Fraction(0)))
    if function == "exp" and u.c < 0:
        return Tail(u.start, between(0, end.exp().hi))
    if function == "log" and u.c > 0:
        return _log(u)
    raise Undecided(f"{function} of a growing argument")


def _log(u: Tail) -> Tail:
    """``log c + p log s + k s`` as ``s·[…]``, or ``√s·[…]`` if ``k = 0``; they fall from 4 and from 16 on."""
    (k, p), root = u.growth, 1 if u.growth[0] else 2
    if root == 2 and u.start < 16:
        raise Undecided("log of an argument that has not grown yet")
    decay = hull(Interval(0, 0), enclose(Fraction(1, u.start if root == 1 else isqrt(u.start))))
    rest = p * decay * interval_call("log", enclose(u.start)) + decay * interval_call("log", u.c)
    return Tail(u.start, k + rest, (Fraction(0), Fraction(1, root)))
