"""The scale in which functions are compared as ``s → ∞``: products ``exp(Σ c_k s^k) · s^a · (log s)^b``."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from flint import arb, ctx

from certify.bounds.balls import PRECISION, lower, to_arb, upper

_LARGEST_EXPONENT = 10**5


class TailTooShort(ArithmeticError):
    """A statement that holds for large ``s`` is not proved from the chosen start on; a later start may do."""


@dataclass(frozen=True)
class Monomial:
    """``exp(Σ c_k s^k) s^power (log s)^logs`` on ``s ≥ 2``; ``exponent`` has the ``(k, c_k)``, largest ``k`` first."""

    exponent: tuple[tuple[Fraction, Fraction], ...] = ()
    power: Fraction = Fraction(0)
    logs: Fraction = Fraction(0)

    def __mul__(self, other: Monomial) -> Monomial:
        total = dict(self.exponent)
        for k, c in other.exponent:
            total[k] = total.get(k, Fraction(0)) + c
        return Monomial(_ordered(total), self.power + other.power, self.logs + other.logs)

    def __truediv__(self, other: Monomial) -> Monomial:
        return self * other.raised(Fraction(-1))

    def raised(self, p: Fraction) -> Monomial:
        return Monomial(_ordered({k: p * c for k, c in self.exponent}), p * self.power, p * self.logs)

    @property
    def growth(self) -> int:
        """1 if the monomial tends to infinity, −1 if it tends to zero, 0 if it is the constant 1."""
        leading = self.exponent[0][1] if self.exponent else self.power if self.power else self.logs
        return (leading > 0) - (leading < 0)

    @property
    def is_power(self) -> bool:
        return not self.exponent and not self.logs

    def supremum(self, start: Fraction) -> Fraction:
        """An upper bound on ``[start, ∞)`` of a monomial that tends to zero.

        It is the value at ``start`` once the logarithmic derivative is negative from there on. With ``K`` the largest
        ``k``, ``s (log m)' / s^K`` is at most ``K c_K + Σ_{c_k > 0} k c_k s^(k−K) + (a⁺ + b⁺/log s) s^(−K)``, whose
        terms decrease. Raises TailTooShort when that is not negative at ``start``.
        """
        if self.growth >= 0:
            raise ValueError("only a monomial that tends to zero has a bound")
        if start < 2:
            raise TailTooShort("a tail starts at 2 or later")
        with ctx.workprec(PRECISION):
            s = to_arb(start)
            positive = max(self.power, Fraction(0)) + max(self.logs, Fraction(0)) / lower(s.log())
            if self.exponent:
                slope = self._exponential_slope(s, positive)
            else:
                slope = to_arb(self.power + positive if self.power < 0 else self.logs)
            if not slope < 0:
                raise TailTooShort(f"the monomial {self} is not proved to decrease from {start} on")
            return upper(self._value(s))

    def _exponential_slope(self, s: arb, positive: Fraction) -> arb:
        largest, leading = self.exponent[0]
        slope = to_arb(largest * leading)
        for k, c in self.exponent[1:]:
            if c > 0:
                slope += to_arb(k * c) * _real_power(s, k - largest)
        return slope + to_arb(positive) * _real_power(s, -largest)

    def _value(self, s: arb) -> arb:
        exponent = sum((to_arb(c) * _real_power(s, k) for k, c in self.exponent), arb(0))
        if exponent < -_LARGEST_EXPONENT:
            exponent = arb(-_LARGEST_EXPONENT)
        return exponent.exp() * _real_power(s, self.power) * _real_power(s.log(), self.logs)


ONE = Monomial()
S = Monomial(power=Fraction(1))
LOG = Monomial(logs=Fraction(1))


def _ordered(exponent: dict[Fraction, Fraction]) -> tuple[tuple[Fraction, Fraction], ...]:
    return tuple(sorted(((k, c) for k, c in exponent.items() if c), reverse=True))


def _real_power(base: arb, exponent: Fraction) -> arb:
    """``base^exponent`` for a positive base."""
    if exponent.denominator == 1:
        return base**exponent.numerator
    return (base.log() * to_arb(exponent)).exp()
