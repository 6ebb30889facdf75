"""Values of functions on a half-line: ``f(s) ∈ s^p (log s)^q e^(ks)·[c]`` for all ``s ≥ start``, rational ``p, q, k``.

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

Growth = tuple[Fraction, Fraction, Fraction]  # (k, p, q): compared in this order
Affine = tuple[Fraction, Fraction]
FLAT: Growth = (Fraction(0), Fraction(0), Fraction(0))
FIRST_LOGARITHM = 16  # log log s/log s falls from e^e = 15.2 on


class Tail:
    """``s^p (log s)^q e^(ks)·[c]`` for ``s ≥ start``; ``start`` is a power of 4."""

    def __init__(self, start: int, c: Interval, growth: Growth = FLAT, affine: Affine | None = None) -> None:
        self.start = start
        self.c = c
        self.growth = FLAT if c.is_zero else growth
        self.affine = affine

    @classmethod
    def variable(cls, start: int, sign: int) -> Tail:
        """``s`` itself where ``sign·s ≥ start``, with ``|s|`` for the variable of the growth."""
        one = Fraction(1)
        return cls(start, Interval(sign, sign), (Fraction(0), one, Fraction(0)), (Fraction(sign), Fraction(0)))

    def scalar(self, value: Any) -> Tail:
        if isinstance(value, Tail):
            return value
        exact = None if isinstance(value, Interval) else (Fraction(0), Fraction(value))
        return Tail(self.start, enclose(value), FLAT, exact)

    def range(self) -> Interval:
        """An enclosure of all values. Raises ``Undecided`` when they are unbounded or not known to be bounded."""
        return self.c * self.ratio(self.growth)

    def ratio(self, growth: Growth) -> Interval:
        """An enclosure of ``s^p (log s)^q e^(ks)`` on the half-line; growing functions are refused."""
        if growth == FLAT:
            return Interval(1, 1)
        k, p, q = growth
        if (2 * p).denominator != 1 or (2 * q).denominator != 1 or max(abs(p), abs(q)) > 64:
            raise Undecided("a root of a root on the whole line")
        if k > 0 or not self._falls(growth):
            raise Undecided("the expression is not shown to be bounded on the whole line")
        largest = Interval(isqrt(self.start), isqrt(self.start)) ** int(2 * p) * enclose(k * self.start).exp()
        if q:
            largest = largest * self.logarithm().sqrt() ** int(2 * q)
        return hull(Interval(0, 0), largest)

    def logarithm(self) -> Interval:
        """``log start``, which is above 1."""
        return interval_call("log", enclose(self.start))

    def _falls(self, growth: Growth) -> bool:
        """Whether ``k s + p + q/log s ≤ 0`` on the half-line: ``s`` times the derivative of the logarithm."""
        k, p, q = growth
        return p + max(q, Fraction(0)) / self.logarithm() + k * self.start <= 0 if q else p <= -k * self.start

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
        return Tail(self.start, x.c + y.c * self.ratio(_plus(y.growth, x.growth, -1)), x.growth, affine)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Tail:
        return self + -self.scalar(other)

    def __mul__(self, other: Any) -> Tail:
        other = self.scalar(other)
        affine = None
        if self.affine and other.affine and 0 in (self.affine[0], other.affine[0]):
            (a, b), (c, d) = self.affine, other.affine
            affine = (a * d + b * c, b * d)
        return Tail(self.start, self.c * other.c, _plus(self.growth, other.growth, 1), affine)

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> Tail:
        return Tail(
            self.start,
            self.c**exponent,
            _times(self.growth, Fraction(exponent)),
            self.affine if exponent == 1 else None,
        )

    def __truediv__(self, other: Any) -> Tail:
        other = self.scalar(other)
        if other.affine and other.affine[0] == 0 and other.affine[1]:
            return self * (1 / other.affine[1])
        return self * other**-1

    def __rtruediv__(self, other: Any) -> Tail:
        return other * self**-1


def _plus(x: Growth, y: Growth, sign: int) -> Growth:
    return (x[0] + sign * y[0], x[1] + sign * y[1], x[2] + sign * y[2])


def _times(x: Growth, factor: Fraction) -> Growth:
    return (x[0] * factor, x[1] * factor, x[2] * factor)


def call(function: str, u: Tail) -> Tail:
    """A function of a tail. Raises ``Undecided`` for what the scale ``s^p (log s)^q e^(ks)`` does not hold."""
    if function == "sqrt":
        return Tail(u.start, interval_call("sqrt", u.c), _times(u.growth, Fraction(1, 2)))
    if function == "exp" and u.affine:
        return Tail(u.start, enclose(u.affine[1]).exp(), (u.affine[0], Fraction(0), Fraction(0)))
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
        return Tail(u.start, Interval(0, 1), (-rate, Fraction(0), Fraction(0)))
    if function == "exp" and u.c < 0:
        return Tail(u.start, between(0, end.exp().hi))
    if function == "log" and u.c > 0:
        return _log(u)
    raise Undecided(f"{function} of a growing argument")


def _log(u: Tail) -> Tail:
    """``log c + k s + p log s + q log log s`` as ``s·[…]``, or ``log s·[…]`` if ``k = 0``.

    ``log s/s`` falls from e on, ``log log s/log s`` from ``FIRST_LOGARITHM`` on.
    """
    (k, p, q), log_start = u.growth, u.logarithm()
    if (q or not k) and u.start < FIRST_LOGARITHM:
        raise Undecided("log of an argument that has not grown yet")
    own, twice = interval_call("log", u.c), q * interval_call("log", log_start) if q else Interval(0, 0)
    if not k:
        if not p:
            raise Undecided("log of an argument that grows like a logarithm")
        rest = hull(Interval(0, 0), own / log_start) + hull(Interval(0, 0), twice / log_start)
        return Tail(u.start, p + rest, (Fraction(0), Fraction(0), Fraction(1)))
    decay = hull(Interval(0, 0), enclose(Fraction(1, u.start)))
    rest = decay * own + p * decay * log_start + decay * twice
    return Tail(u.start, k + rest, (Fraction(0), Fraction(1), Fraction(0)))
