"""The checker's derivatives of an expression as it is written, on intervals and on half-lines, against mpmath."""

from __future__ import annotations

import random
from fractions import Fraction
from typing import Any

import mpmath
import pytest

from certify.checker import tails
from certify.checker.expressions import Name, Node, evaluate, parse
from certify.checker.intervals import Interval, between
from certify.checker.jets import jet
from certify.checker.tails import Tail
from certify.checker.verdict import Undecided

ORDER = 3
COSTS = (
    "(s - 3)^2/2 + s",
    "(2*s - 1)^5/(1 + s^2)^2",
    "log(cosh(s - 1))",
    "sqrt(1 + (s - 3)^2)",
    "exp(-(s - 2)^2)/2",
    "s*tanh(s)",
    "atan(s - 1)*sinh(s/9)",
    "sin(s)*exp(-s^2/4) - cos(3*s)",
    "log(1 + exp(s))/(2 + sin(s))",
    "(1 + s^2)^-3",
    "tan(atan(s)/2)",
    "7",
)
FAR = (
    "log(cosh(s - 1))",
    "sqrt(1 + (s - 3)^2)",
    "exp(-(s - 2)^2)/2",
    "s*tanh(s)",
    "s^3*exp(-s)*exp(-s^2)",
    "atan(s - 1)/3",
    "log(1 + exp(s))",
    "s^2/2 + sin(s)",
    "s^2/log(s^2 + 2)",
    "s*log(1 + s^2)/(1 + log(2 + s^2)^2)",
)


def expression(text: str) -> Node:
    return parse(text, {"s": Name("s")})


def derivatives(node: Node, s: Any) -> list[Any]:
    """In 60 digits, from a Taylor series."""

    def value(x: Any) -> Any:
        return evaluate(
            node,
            {"s": x},
            lambda q: mpmath.mpf(q.numerator) / q.denominator,
            lambda function, argument: getattr(mpmath, function)(argument),
        )

    return [mpmath.diff(value, s, k) if k else value(s) for k in range(ORDER + 1)]


def assert_holds(side: Interval, value: Any, where: object) -> None:
    room = mpmath.mpf(10) ** -15 * (1 + abs(value))
    lo, hi = (mpmath.mpf(end.numerator) / end.denominator for end in (side.lo, side.hi))
    assert lo - room <= value <= hi + room, where


@pytest.mark.parametrize("text", COSTS)
def test_jets_hold_all_derivatives_on_intervals(text: str) -> None:
    node, rng = expression(text), random.Random(text)
    with mpmath.workdps(60):
        for width in (Fraction(0), Fraction(1, 1000), Fraction(1, 4)):
            lo = Fraction(rng.randint(-800, 800), 100)
            found = jet(node, between(lo, lo + width), ORDER)
            for share in (Fraction(0), Fraction(1, 3), Fraction(1)):
                s = lo + share * width
                exact = derivatives(node, mpmath.mpf(s.numerator) / s.denominator)
                for k, (side, value) in enumerate(zip(found, exact, strict=True)):
                    assert_holds(side, value, (text, lo, width, s, k))
                    assert width or side.hi - side.lo < Fraction(1, 10**20), (text, lo, k)


@pytest.mark.parametrize("text", FAR)
def test_jets_hold_all_derivatives_on_half_lines(text: str) -> None:
    node, decided = expression(text), 0
    with mpmath.workdps(60):
        for start in (4, 16, 256):
            for sign in (1, -1):
                s = Tail.variable(start, sign)
                try:
                    found = jet(node, s, 2, s.scalar, tails.call)[2].range()
                except Undecided:
                    continue
                decided += 1
                for factor in (1, 1.25, 2, 9):
                    assert_holds(found, derivatives(node, mpmath.mpf(sign * start * factor))[2], (text, start, sign))
    assert decided >= 3, text


def test_a_point_where_it_is_not_smooth_has_no_jet() -> None:
    for text in ("sqrt(s)", "1/s", "log(s)", "s^-2", "sqrt(s^2)"):
        with pytest.raises(Undecided):
            jet(expression(text), between(Fraction(-1), Fraction(1)), 2)
