"""A1: bounds of c'' over the whole real line, for costs that are polynomial, rational or transcendental."""

from __future__ import annotations

import re
from fractions import Fraction
from math import inf

import pytest
import sympy
from hand_built import agent
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Rational, atan, cos, cosh, exp, log, sin, sqrt, tan, tanh

from certify.assumptions.a1_costs import check_cost
from certify.bounds.whole_line import line_bounds
from certify.curvature import Curvature, CurvatureFailure, cost_curvature
from symbolic.constants import as_rational
from symbolic.plant import COST_VARIABLE, symbol

s = COST_VARIABLE

ONE_PERCENT = Fraction(1, 100)

STRONGLY_CONVEX = {
    "affine shift": ((s - 3) ** 2 / 4, 0.5, 0.5),
    "irrational": (sqrt(2) * s**2, 2 * 2**0.5, 2 * 2**0.5),
    "logistic": (s**2 / 2 + log(1 + exp(s)), 1, 1.25),
    "steep logistic": (s**2 + log(1 + exp(10 * s)), 2, 27),
    "shifted logistic": ((s - 100) ** 2 + log(1 + exp(s - 100)), 2, 2.25),
    "sine": ((s - 1) ** 2 / 4 + sin(s) / 10, 0.4, 0.6),
    "two frequencies": (s**2 + sin(s) / 3 + cos(s / 2), 1.479547, 2.520453),
    "hyperbola": (s**2 + sqrt(1 + s**2), 2, 3),
    "hyperbola of degree four": (s**2 + sqrt(1 + s**4), 2, 4.828427),
    "smoothed absolute value": (sqrt((s - 1) ** 2 + Rational(1, 10**12)) + (s - 1) ** 2, 2, 1e6 + 2),
    "two smoothed absolute values": (
        sqrt((s - 2) ** 2 + Rational(1, 10**8)) + sqrt((s + 1) ** 2 + Rational(1, 100)) / 3 + s**2 / 2,
        1,
        1e4 + 1,
    ),
    "log cosh": (s**2 + log(cosh(s)), 2, 3),
    "log of two exponentials": (s**2 + log(exp(s) + exp(-s)), 2, 3),
    "atan": (s**2 + atan(s), 1.350481, 2.649519),
    "tanh": (s**2 * (2 + tanh(s)), 1.358085, 6.641915),
    "bell": (s**2 + exp(-(s**2)) / 4, 1.5, 2.223130),
    "rational": (3 * s**2 + (s**6 + 1) / (1 + s**4), 5.0080, 11.0),
    "three halves": ((1 + s**2) ** Rational(3, 2) / sqrt(2 + s**2), 1.767767, 2.052094),
    "sine that settles": (s**2 + sin(1 / (1 + s**2)), 0.919395, 2.355137),
    "waves that do not": (s**2 + cos(sqrt(1 + s**2)), 1, 3),
    "transcendental shift": (s**2 + log(1 + exp(s + exp(1))), 2, 2.25),
    "product": (s**2 + s**3 / (1 + s**2) ** 3 * exp(atan(s)), 1.028839, 3.338606),
}


@pytest.mark.parametrize(("cost", "low", "high"), STRONGLY_CONVEX.values(), ids=STRONGLY_CONVEX)
def test_bounds_hold_everywhere_and_are_tight(cost: sympy.Expr, low: float, high: float) -> None:
    found = cost_curvature(cost)
    assert isinstance(found, Curvature)
    second = sympy.lambdify(s, sympy.diff(cost, s, 2), "mpmath")
    for point in [k / 7 for k in range(-60, 61)] + [-1000, -101.5, 99, 100.25, 1000]:
        assert found.lower <= Fraction(float(second(point))) + Fraction(1, 10**9)
        assert found.upper >= Fraction(float(second(point))) - Fraction(1, 10**9)
    assert low * (1 - 2 * ONE_PERCENT) <= found.lower <= low * (1 + 1e-5)
    assert high * (1 - 1e-5) <= found.upper <= high * (1 + 2 * ONE_PERCENT)


REJECTED = {
    "quartic": (s**4, r"c'' = 12\*s\*\*2 is unbounded.*c''\(0\) = 0"),
    "quadratic and quartic": (s**2 + s**4, "not globally Lipschitz"),
    "cubic": (s**3, "unbounded"),
    "line": (3 * s, "c'' = 0: the cost is not strongly convex"),
    "concave": (-(s**2), "negative"),
    "only convex": (log(1 + exp(s)), r"c'' tends to 0 as \|s\| grows"),
    "only convex hyperbola": (sqrt(1 + s**2), r"c'' tends to 0"),
    "only convex log cosh": (log(cosh(s)), r"c'' tends to 0"),
    "only convex exponential": (exp(s), r"c'' tends to 0"),
    "convex with a flat point": (sqrt(1 + s**4), r"c''\(0\) = 0 is not positive"),
    "touching": (s**2 / 2 + cos(s), r"c''\(0\) = 0 is not positive"),
    "concave at 0": (s**2 / 2 + exp(-(s**2)), r"c''\(0\) = -1 is not positive"),
    "concave at a fraction": (s**2 + atan(s**3), r"c''\(-2/5\) = .* is not positive"),
    "flat rational": (s**2 + 1 / (1 + s**2), r"c''\(0\) = 0 is not positive"),
    "growing waves": (s**2 * (2 + sin(s)), "is not positive"),
    "log growth of c''": (s**2 * log(2 + s**2), "tends to ∞"),
    "root growth of c''": ((2 + exp(s)) ** Rational(1, 2) + s**2, "tends to ∞"),
    "exponential": (exp(s) + exp(-s), "tends to ∞"),
    "logarithm": (s**2 + log(s), "logarithm of s needs s to be positive.*at s = 0"),
    "pole": (s**2 + 1 / s, "denominator s needs s to be nonzero.*at s = 0"),
    "irrational pole": (s**2 + 1 / (s - sqrt(2)), r"changes its sign at s = 0 and s = 10"),
    "tangent": (s**2 + tan(s), "tangent of s needs"),
    "kink": (s**2 + sqrt(s**2), "absolute value of s.*at s = 0"),
    "hidden kink": (s**2 + sqrt(s**2 - 2 * s + 1), "at s = 1"),
    "root at the origin": (s**2 + s ** Rational(5, 2), "not twice continuously differentiable"),
    "logarithm of a wave": (s**2 + log(Rational(1, 2) + sin(s)), r"sin\(s\) \+ 1/2 is negative at s = "),
}


@pytest.mark.parametrize(("cost", "reason"), REJECTED.values(), ids=REJECTED)
def test_failures_name_the_reason(cost: sympy.Expr, reason: str) -> None:
    found = cost_curvature(cost)
    assert isinstance(found, CurvatureFailure)
    assert found.verdict == "fails"
    assert re.search(reason, found.reason), found.reason


@pytest.mark.parametrize(
    "cost",
    [
        s**2 + sin(s) * cos(s),  # c'' touches 0 at π/4
        s**2 + log(1 + sin(s)),  # undefined at −π/2
        s**2 / 2 + sin(s**2) / 10**9,  # c'' is unbounded, too slowly to be seen
        s**2 + symbol("p"),
    ],
)
def test_undecided_costs_are_unknown(cost: sympy.Expr) -> None:
    found = cost_curvature(cost)
    assert isinstance(found, CurvatureFailure)
    assert found.verdict == "unknown"


def test_finding_carries_exact_numbers() -> None:
    finding = check_cost(agent())
    assert (finding.id, finding.verdict, finding.evidence["varpi"], finding.evidence["l"]) == ("A1", "holds", "2", "2")


_PIECES = [
    log(1 + exp(s)),
    sqrt(1 + s**2),
    atan(s),
    sin(s),
    exp(-(s**2)),
    s / (1 + s**2),
    tanh(s),
    log(2 + s + s**2),
    cos(s / 3),
]


@settings(max_examples=40)
@given(
    st.lists(st.tuples(st.sampled_from(_PIECES), st.integers(-3, 3)), min_size=1, max_size=3),
    st.lists(st.fractions(-40, 40, max_denominator=9), min_size=8, max_size=8),
)
def test_line_bounds_contain_every_sample(pieces: list[tuple[sympy.Expr, int]], points: list[Fraction]) -> None:
    f = sympy.Add(*(weight * piece.xreplace({s: s + shift}) for shift, (piece, weight) in enumerate(pieces)))
    found = line_bounds(f, s)
    low = -inf if found.lower is None else float(found.lower)
    high = inf if found.upper is None else float(found.upper)
    for point in points:
        value = float(f.xreplace({s: as_rational(point)}).evalf(30))
        assert low - 1e-9 <= value <= high + 1e-9
