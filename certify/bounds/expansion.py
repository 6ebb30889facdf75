"""Sums of monomials with interval coefficients: ``f(s) = Σ c_m(s) m(s)`` with ``c_m(s) ∈ I_m`` for every ``s ≥ start``.

Exact as long as the function is (points stay points), so that leading terms may cancel; what a truncated Taylor series
leaves over is carried as an interval coefficient of the next monomial.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cmp_to_key

from certify.bounds import intervals
from certify.bounds.derivatives import power_derivative
from certify.bounds.monomials import ONE, Monomial
from symbolic.plant import Interval

MAX_TERMS = 8
TAYLOR_ORDER = 3

Derivatives = Callable[[int, Interval], Interval]


class TailUnknown(ArithmeticError):
    """The behaviour for large ``s`` is outside what the expansion can follow; the message says where."""


@dataclass(frozen=True)
class Expansion:
    """``terms`` from the fastest growing monomial to the slowest, all valid on ``[start, ∞)``, ``start ≥ 2``."""

    terms: tuple[tuple[Monomial, Interval], ...]
    start: Fraction

    @staticmethod
    def of(terms: Iterable[tuple[Monomial, Interval]], start: Fraction) -> Expansion:
        """Collect, order and shorten; the terms beyond MAX_TERMS are bounded by the last one kept."""
        collected: dict[Monomial, Interval] = {}
        for monomial, coefficient in terms:
            before = collected.get(monomial, intervals.ZERO)
            collected[monomial] = intervals.add(before, coefficient)
        ordered = sorted(
            ((m, c) for m, c in collected.items() if c != intervals.ZERO),
            key=cmp_to_key(_faster_first),
        )
        kept, rest = ordered[:MAX_TERMS], ordered[MAX_TERMS:]
        for monomial, coefficient in rest:
            last, total = kept[-1]
            kept[-1] = last, intervals.add(total, _times_decaying(coefficient, (monomial / last).supremum(start)))
        return Expansion(tuple(kept), start)

    @staticmethod
    def constant(value: Interval | Fraction | int, start: Fraction) -> Expansion:
        interval = value if isinstance(value, Interval) else intervals.point(value)
        return Expansion.of([(ONE, interval)], start)

    @property
    def dominant(self) -> tuple[Monomial, Interval]:
        """The leading term. Raises TailUnknown when it may vanish, so that it leads nothing."""
        if not self.terms:
            raise TailUnknown("a function that vanishes has no leading term")
        monomial, coefficient = self.terms[0]
        if intervals.sign(coefficient) == 0:
            raise TailUnknown("the sign of the leading coefficient is open")
        return monomial, coefficient

    def split(self) -> tuple[dict[Monomial, Interval], Interval, Expansion]:
        """The growing terms, the constant term and the part that tends to zero."""
        growing = {m: c for m, c in self.terms if m.growth > 0}
        constant = next((c for m, c in self.terms if m.growth == 0), intervals.ZERO)
        return growing, constant, Expansion(tuple((m, c) for m, c in self.terms if m.growth < 0), self.start)

    def __add__(self, other: Expansion) -> Expansion:
        return Expansion.of([*self.terms, *other.terms], self.start)

    def __mul__(self, other: Expansion) -> Expansion:
        products = [(m * n, intervals.multiply(c, d)) for m, c in self.terms for n, d in other.terms]
        return Expansion.of(products, self.start)

    def scaled(self, factor: Interval, monomial: Monomial = ONE) -> Expansion:
        return Expansion.of([(m * monomial, intervals.multiply(c, factor)) for m, c in self.terms], self.start)

    def range(self) -> Interval | None:
        """All values on ``[start, ∞)``; None when a term grows."""
        growing, constant, small = self.split()
        if growing:
            return None
        total = constant
        for monomial, coefficient in small.terms:
            total = intervals.add(total, _times_decaying(coefficient, monomial.supremum(self.start)))
        return total

    def normalised(self) -> tuple[Monomial, Interval, Expansion]:
        """``(m0, I0, u)`` with ``f = c0 m0 (1 + u)``, ``c0 ∈ I0 ∌ 0`` and ``u → 0``."""
        monomial, coefficient = self.dominant
        inverse = intervals.power(coefficient, Fraction(-1))
        rest = Expansion(self.terms[1:], self.start).scaled(inverse, monomial.raised(Fraction(-1)))
        return monomial, coefficient, rest

    def raised(self, p: Fraction) -> Expansion:
        """``f^p``: by products for a small natural ``p``, else by the binomial series of ``(1 + u)^p``."""
        if p.denominator == 1 and 0 <= p <= TAYLOR_ORDER:
            product = Expansion.constant(1, self.start)
            for _ in range(p.numerator):
                product = product * self
            return product
        monomial, coefficient, u = self.normalised()
        if p.denominator > 1 and coefficient.hi < 0:
            raise TailUnknown("a root of a negative number")
        series = u.taylor(Fraction(1), lambda k, x: power_derivative(p, k, x))
        return series.scaled(intervals.power(coefficient, p), monomial.raised(p))

    def taylor(self, centre: Fraction, derivatives: Derivatives) -> Expansion:
        """``F(centre + u)`` for this ``u → 0``; ``derivatives(k, x)`` encloses ``F^(k)`` on the interval ``x``.

        Taylor's theorem with Lagrange's remainder: the last coefficient is ``F^(K)/K!`` over all of ``centre + θu``.
        """
        spread = self.range()
        if spread is None:
            raise TailUnknown("a Taylor series needs an argument that settles")
        everywhere = intervals.add(intervals.point(centre), intervals.hull(spread, intervals.ZERO))
        total = Expansion.constant(derivatives(0, intervals.point(centre)), self.start)
        power, factorial = Expansion.constant(1, self.start), 1
        for k in range(1, TAYLOR_ORDER + 1):
            power, factorial = power * self, factorial * k
            where = everywhere if k == TAYLOR_ORDER else intervals.point(centre)
            coefficient = intervals.multiply(derivatives(k, where), intervals.point(Fraction(1, factorial)))
            total = total + power.scaled(coefficient)
        return total


def _faster_first(left: tuple[Monomial, Interval], right: tuple[Monomial, Interval]) -> int:
    return -(left[0] / right[0]).growth


def _times_decaying(coefficient: Interval, supremum: Fraction) -> Interval:
    """All of ``c·m`` for ``c`` in the interval and ``m ∈ (0, supremum]``."""
    return intervals.multiply(coefficient, Interval(Fraction(0), supremum))
