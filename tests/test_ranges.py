"""Ranges contain every value; zeros on a box are shown or excluded; identities are decided."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy
from hand_built import P, Q, S
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import atan, cos, cosh, exp, log, sin, sinh, sqrt, tanh

from symbolic.constants import as_rational
from symbolic.identity import Box, normal_form, zero_test
from symbolic.plant import Interval
from symbolic.ranges import as_range, enclosure, nonvanishing


def interval(lo: int | str, hi: int | str) -> Interval:
    return Interval(Fraction(lo), Fraction(hi))


ATOMS = st.sampled_from([P, Q, sympy.Integer(2), sympy.Rational(-1, 3), sqrt(2)])
EXPRESSIONS = st.recursive(
    ATOMS,
    lambda inner: st.one_of(
        st.tuples(inner, inner).map(sum),
        st.tuples(inner, inner).map(lambda pair: pair[0] * pair[1]),
        st.tuples(inner, st.integers(2, 3)).map(lambda pair: pair[0] ** pair[1]),
        st.tuples(st.sampled_from([sin, cos, exp, tanh, atan, sinh, cosh]), inner).map(lambda pair: pair[0](pair[1])),
    ),
    max_leaves=6,
)
FRACTIONS = st.fractions(-3, 3, max_denominator=8)
SHARES = st.fractions(0, 1, max_denominator=8)


@settings(max_examples=150)
@given(EXPRESSIONS, st.tuples(FRACTIONS, FRACTIONS), st.tuples(FRACTIONS, FRACTIONS), SHARES, SHARES)
def test_enclosures_contain_the_values(
    expr: sympy.Expr, p: tuple[Fraction, Fraction], q: tuple[Fraction, Fraction], share_p: Fraction, share_q: Fraction
) -> None:
    box = {P: (min(p), max(p)), Q: (min(q), max(q))}
    value = expr.xreplace(
        {
            name: as_rational(lo + share * (hi - lo))
            for (name, (lo, hi)), share in zip(box.items(), (share_p, share_q), strict=True)
        }
    )
    lo, hi = enclosure(expr, box)
    approximate = sympy.N(value, 30)
    slack = abs(approximate) * sympy.Float("1e-25", 30)
    assert lo is None or as_rational(lo) <= approximate + slack
    assert hi is None or approximate - slack <= as_rational(hi)


@pytest.mark.parametrize(
    ("expr", "box", "verdict"),
    [
        (P**2 + sympy.Rational(16, 25), {P: interval(-5, 5)}, "holds"),
        (P**2 - 2, {P: interval(-1, "14/10")}, "holds"),
        (P**2 - 2, {P: interval(-1, "15/10")}, "fails"),
        (P, {P: interval(0, 1)}, "fails"),
        (P, {P: interval("1/1000", 1)}, "holds"),
        (P**2 + P * Q + Q**2, {P: interval(-1, 1), Q: interval("1/2", 1)}, "holds"),
        (P**2 + P * Q + Q**2, {P: interval(-1, 1), Q: interval(-1, 1)}, "fails"),
        (P * Q - 1, {P: interval(2, 3), Q: interval("1/4", 1)}, "fails"),
        (1 + S**2, {S: None}, "holds"),
        (S**2 - S + 1, {S: None}, "holds"),
        (S - 5, {S: None}, "fails"),
        ((1 + S**2) * (2 + sin(P)), {S: None, P: interval(-9, 9)}, "holds"),
        (exp(S) + P, {S: None, P: interval(1, 2)}, "holds"),
        (exp(S) - P, {S: None, P: interval(1, 2)}, "fails"),
        (1 - tanh(S), {S: None}, "unknown"),
        (P - sqrt(2), {P: interval(1, 2)}, "fails"),
        (P + sqrt(2), {P: interval(-1, 1)}, "holds"),
        (sympy.Integer(3), {}, "holds"),
        (sympy.Integer(0), {}, "fails"),
    ],
)
def test_zeros_on_a_box(expr: sympy.Expr, box: Box, verdict: str) -> None:
    answer = nonvanishing(sympy.sympify(expr), box)
    assert answer.verdict == verdict, answer
    assert len(answer.at) in ((1, 2) if verdict == "fails" else (0,))


@given(st.lists(FRACTIONS, min_size=1, max_size=3), FRACTIONS, FRACTIONS)
def test_zeros_of_products_are_found(roots: list[Fraction], a: Fraction, b: Fraction) -> None:
    expr = sympy.expand(sympy.prod([P - as_rational(root) for root in roots]) * (P**2 + 1))
    box = {P: Interval(min(a, b), max(a, b))}
    inside = any(box[P].lo <= root <= box[P].hi for root in roots)
    answer = nonvanishing(expr, box)
    assert answer.verdict != ("holds" if inside else "fails")
    assert inside or answer.verdict == "holds"
    assert as_range(box[P]) == (box[P].lo, box[P].hi)


@pytest.mark.parametrize(
    "expr",
    [
        (P + Q) ** 3 - P**3 - 3 * P**2 * Q - 3 * P * Q**2 - Q**3,
        P / (P + 1) + 1 / (P + 1) - 1,
        exp(P + Q) - exp(P) * exp(Q),
        exp(2 * P) - exp(P) ** 2,
        sqrt(2) * P - 2 * P / sqrt(2),
        sin(P) / sin(P) - 1,
        sqrt(6) - sqrt(2) * sqrt(3),
        1 / (sqrt(2) - 1) - sqrt(2) - 1,
    ],
)
def test_identities_by_normal_form(expr: sympy.Expr) -> None:
    assert normal_form(expr) == 0 and zero_test(expr).verdict == "holds"


@pytest.mark.parametrize("expr", [sin(P) ** 2 + cos(P) ** 2 - 1, cosh(P) ** 2 - sinh(P) ** 2 - 1, log(exp(P)) - P])
def test_identities_by_simplification(expr: sympy.Expr) -> None:
    assert zero_test(expr).verdict == "holds"


@pytest.mark.parametrize(
    "expr",
    [
        P * Q - Q * P**2,
        sin(P) - P,
        exp(P) - 1 - P,
        sqrt(2) - sympy.Rational(1414213562, 10**9),
        P / (P - 1) - 1,
    ],
)
def test_nonzero_expressions_have_a_witness(expr: sympy.Expr) -> None:
    box = {P: interval(2, 3)}
    answer = zero_test(expr, box)
    assert answer.verdict == "fails"
    point = {sympy.Symbol(name, real=True): sympy.Rational(value) for name, value in answer.at.items()}
    assert abs(sympy.N(expr.xreplace(point), 30)) > 1e-12
    assert P not in point or 2 <= point[P] <= 3
