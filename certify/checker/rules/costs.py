"""A1 and the optimum: bounds of the second derivatives over the whole line, and an interval that holds ``s*``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from certify.checker import functions, tails
from certify.checker.expressions import Node, evaluate, terms_of
from certify.checker.intervals import Interval, between, enclose, hull, total
from certify.checker.jets import jet
from certify.checker.plant import Agent
from certify.checker.polynomials import ZERO, Algebra, constant, variable
from certify.checker.subdivision import supremum, value_range
from certify.checker.tails import Tail
from certify.checker.verdict import Undecided, obligation, require

HALF_LINES = (4, 16, 256, 4096)
ABOUT = Fraction(1, 40)
CUTS = 500


@dataclass(frozen=True)
class Cost:
    """``least ≤ c'' ≤ largest`` on the whole line; ``affine = (c'(0), c'')`` if ``c`` is a quadratic over Q."""

    form: Simplified | Written
    expression: Node
    least: Fraction
    largest: Fraction
    affine: tuple[Fraction, Fraction] | None = None

    def slope(self, s: Interval) -> Interval:
        """``c'`` on an interval, at whose ends it has its extremes."""
        if self.affine:
            return self.affine[0] + self.affine[1] * s
        ends = [s] if s.a == s.b else [s.lower, s.upper]
        return hull(*(self.form.at(1, end) for end in ends))

    def curvature(self, s: Interval) -> Interval:
        return _curvature(self.form, s)

    def slopes(self, s: Interval, order: int) -> tuple[Interval, ...]:
        """``c', c'', …``, ``order + 1`` of them, on an interval."""
        return jet(self.expression, s, order + 1)[1:]


class Simplified:
    """``c`` and its derivatives, each as one rational function of ``s`` and atoms per term of ``c``: much cancels."""

    cuts = 500

    def __init__(self, cost: Node) -> None:
        self.algebra = Algebra()
        self.orders = [[self.algebra.read(term, {"s": variable("s")}) for term in terms_of(cost)]]
        for _ in range(3):
            derivatives = [self.algebra.derivative(term, "s") for term in self.orders[-1]]
            self.orders.append([self.algebra.without_squares(term) for term in derivatives])

    def at(
        self,
        order: int,
        s: Any,
        number: Callable[[Any], Any] = enclose,
        call: Callable[[str, Any], Any] = functions.call,
    ) -> Any:
        parts = [self.algebra.enclosure(term, {"s": s}, number, call) for term in self.orders[order]]
        return sum(parts[1:], parts[0])

    def curvature_and_slope(self, s: Interval) -> tuple[Interval, Interval]:
        return self.at(2, s), self.at(3, s)

    def quadratic(self) -> tuple[Fraction, Fraction] | None:
        """``(c'(0), c'')`` if both are visibly rational and ``c''`` is constant."""
        first, second = sum(self.orders[1], ZERO), sum(self.orders[2], ZERO).constant()
        at_zero = None if second is None else (first - variable("s") * constant(second)).constant()
        return None if second is None or at_zero is None else (at_zero, second)

    def is_growing_polynomial(self) -> bool:
        second = sum(self.orders[2], ZERO)
        return not second.bottom and second.names() == {"s"}


class Written:
    """``c`` and its derivatives by the expression as it stands: ``(s − 3)²`` stays a square."""

    cuts = 80

    def __init__(self, cost: Node) -> None:
        self.cost = cost

    def at(
        self,
        order: int,
        s: Any,
        number: Callable[[Any], Any] = enclose,
        call: Callable[[str, Any], Any] = functions.call,
    ) -> Any:
        return jet(self.cost, s, order, number, call)[order]

    def curvature_and_slope(self, s: Interval) -> tuple[Interval, Interval]:
        *_, curvature, slope = jet(self.cost, s, 3)
        return curvature, slope


def prove_cost(agent: Agent) -> Cost:
    """A1: exactly for polynomials, else by enclosing ``c''`` on pieces of ``[−R, R]`` and both half-lines beyond.

    ``c''`` is simplified before it is enclosed, so that a part that jumps may be gone: every part of ``c`` itself must
    be smooth on the whole line. What cannot be enclosed simplified is enclosed as it is written.
    """
    name = f"agent {agent.id}: A1: 0 < c'' ≤ l on the whole line"
    with obligation(name):
        _prove_smooth(agent.cost)
        simplified, written = Simplified(agent.cost), Written(agent.cost)
        require(not simplified.is_growing_polynomial(), name, degree="3 or more")
        affine = simplified.quadratic()
        if affine:
            require(affine[1] > 0, name, curvature=affine[1])
            return Cost(simplified, agent.cost, affine[1], affine[1], affine)
        try:
            found = _range_on_line(simplified)
            if found > 0:
                return Cost(simplified, agent.cost, found.lo, found.hi)
        except Undecided:
            pass
        found = _range_on_line(written)
    require(found > 0, name, curvature=found)
    return Cost(written, agent.cost, found.lo, found.hi)


def prove_optimum(costs: Sequence[Cost], lo: Fraction, hi: Fraction) -> tuple[Interval, ...]:
    """``Σ c_i'(lo) ≤ 0 ≤ Σ c_i'(hi)``. Returns enclosures of ``c_i'([lo, hi])``."""
    require(lo <= hi, "optimum: lo ≤ hi", lo=lo, hi=hi)
    with obligation("optimum"):
        quadratics = [cost.affine for cost in costs if cost.affine]
        exact = [sum((a + b * s for a, b in quadratics), Fraction(0)) for s in (lo, hi)]
        rest = [total(cost.slope(enclose(s)) for cost in costs if not cost.affine) for s in (lo, hi)]
        below, above = (q if x.is_zero else q + x for q, x in zip(exact, rest, strict=True))
        require(below <= 0 and above >= 0, "optimum: Σc'(lo) ≤ 0 ≤ Σc'(hi)", below=below, above=above)
        return tuple(cost.slope(between(lo, hi)) for cost in costs)


def _prove_smooth(cost: Node) -> None:
    """Every part of the expression, those that a factor 0 hides included, is smooth for all real ``s``."""
    failure = Undecided("")
    for start in HALF_LINES:
        try:
            for sign in (1, -1):
                s = Tail.variable(start, sign)
                evaluate(cost, {"s": s}, s.scalar, tails.call)
        except Undecided as reason:
            failure = reason
        else:
            middle = {"s": between(-start, start)}
            supremum(lambda box: 0 * evaluate(cost, box, enclose, functions.call), middle, ["s"], CUTS)
            return
    raise failure


def _range_on_line(form: Simplified | Written) -> Interval:
    """An enclosure of ``c''`` on the whole line."""
    start, ends = _range_on_half_lines(form)
    middle = {"s": between(-start, start)}
    return hull(ends, value_range(lambda box: _curvature(form, box["s"]), middle, ["s"], form.cuts))


def _curvature(form: Simplified | Written, s: Interval) -> Interval:
    """``c''`` on an interval: the narrower of the natural enclosure and the mean-value form."""
    if s.a == s.b:
        return form.at(2, s)
    middle = enclose((s.lo + s.hi) / 2)
    natural, slope = form.curvature_and_slope(s)
    mean = form.at(2, middle) + slope * (s - middle)
    return hull(max(natural.lower, mean.lower), min(natural.upper, mean.upper))


def _range_on_half_lines(form: Simplified | Written) -> tuple[int, Interval]:
    """The first ``R`` beyond which ``c''`` is enclosed about as well as it can be, and the enclosure."""
    found, failure = {}, Undecided("")
    for start in HALF_LINES:
        try:
            lines = [Tail.variable(start, sign) for sign in (1, -1)]
            found[start] = hull(*(form.at(2, s, s.scalar, tails.call).range() for s in lines))
        except Undecided as reason:
            failure = reason
    if not found:
        raise failure
    *_, far = found.values()
    room = far.magnitude.hi * ABOUT
    return next((start, ends) for start, ends in found.items() if far.lo - room <= ends.lo and ends.hi <= far.hi + room)
