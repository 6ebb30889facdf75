"""A0: rest at the origin, and an input gain that stays positive on the parameter box."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

import pytest
import sympy
from hand_built import NOTHING, ROTATION, V1, X1, X2, Z1, P, Q, agent
from sympy import cos, exp, log, sin

from certify.assumptions.a0_origin import check_origin

SQUARE = {P: (-1, 1), Q: (0, 2)}


@pytest.mark.parametrize(
    ("b", "box", "least"),
    [
        (1, {}, "1"),
        (2 + P, {P: (-1, 1)}, "1"),
        (3 + P * Q, SQUARE, "1"),
        (P, {P: ("1/1000000", 1)}, "1/1000000"),
        (1 + P**2, {P: (-1, 1)}, "1"),
    ],
)
def test_exact_minimum_of_the_gain(b: object, box: dict[sympy.Symbol, tuple[object, object]], least: str) -> None:
    finding = check_origin(agent(f=X2, b=b, box=box), NOTHING)
    assert finding.verdict == "holds"
    assert Fraction(least) * (1 - Fraction(1, 10**5)) <= Fraction(finding.evidence["b_min"]) <= Fraction(least)


@pytest.mark.parametrize(
    ("b", "true_minimum"), [(2 + sin(3 * P) * Q, 0.0), (exp(P) - P / 2, 0.846573), (1 / (1 + P**2) + Q, 0.5)]
)
def test_proved_minimum_of_a_transcendental_gain(b: sympy.Expr, true_minimum: float) -> None:
    finding = check_origin(agent(b=b + 1, box=SQUARE), NOTHING)
    assert finding.verdict == "holds"
    assert (true_minimum + 1) * (1 - 1e-4) <= float(Fraction(finding.evidence["b_min"])) <= true_minimum + 1 + 1e-6


@pytest.mark.parametrize(
    ("b", "box", "at"),
    [
        (0, {}, {}),
        (-1, {}, {}),
        (P, {P: (0, 1)}, {"p": "0"}),
        (P**2, {P: (-1, 2)}, {"p": "0"}),
        ((P - Fraction(1, 2)) ** 2, {P: (0, 1)}, {"p": "1/2"}),
        (P - Fraction(1, 10**18), {P: (0, 1)}, {"p": "0"}),
        (1 + P - Q, SQUARE, {"p": "-1", "q": "0"}),
    ],
)
def test_a_gain_that_reaches_zero_fails_with_the_point(b: Any, box: dict, at: dict[str, str]) -> None:
    finding = check_origin(agent(b=sympy.sympify(b), box=box), NOTHING)
    assert finding.verdict == "fails"
    assert "is not positive" in finding.reason
    assert finding.evidence["at"] == at


def test_a_gain_that_is_negative_inside_fails() -> None:
    finding = check_origin(agent(b=(P - Fraction(1, 7)) ** 2 - Fraction(1, 10**4), box={P: (0, 1)}), NOTHING)
    assert finding.verdict == "fails"
    p = Fraction(finding.evidence["at"]["p"])
    assert (p - Fraction(1, 7)) ** 2 <= Fraction(1, 10**4)


def test_a_gain_that_touches_zero_at_an_irrational_point_is_not_certified() -> None:
    finding = check_origin(agent(b=(P**2 - 2) ** 2, box={P: (1, 2)}), NOTHING)
    assert finding.verdict == "unknown"


def test_a_gain_with_a_pole_is_not_certified() -> None:
    finding = check_origin(agent(b=2 + 1 / P**2 - 1 / P**4, box={P: ("-1/3", 1)}), NOTHING)
    assert finding.verdict != "holds"


@pytest.mark.parametrize(
    ("f0", "f", "reason"),
    [
        ([-Z1 + 1], X2, r"f0 \(z1\) is 1 at the origin, not 0"),
        ([-Z1 + X1], 3 + X2, "f1 is 3 at the origin, not 0"),
        ([-Z1 + X1], P * cos(X1), "f1 is p at the origin, not 0 at p = "),
        ([-Z1 + X1], exp(V1) - 1 + Fraction(1, 10**18), "not 0"),
        ([-Z1 + X1], log(X1), "not defined at the origin"),
        ([-Z1 + 1 / X1], X2, "not defined at the origin"),
    ],
)
def test_drift_at_the_origin_fails(f0: list[sympy.Expr], f: sympy.Expr, reason: str) -> None:
    finding = check_origin(agent(f0, f, box={P: (1, 2)}), ROTATION)
    assert finding.verdict == "fails"
    assert re.search(reason, finding.reason)


@pytest.mark.parametrize("f", [X2 * P, sin(V1) + exp(X1) - 1, P * (cos(X2) ** 2 + sin(X2) ** 2 - 1), (P - 1) * Z1])
def test_rest_at_the_origin_holds(f: sympy.Expr) -> None:
    assert check_origin(agent([-Z1 + X1], f, box={P: (1, 2)}), ROTATION).verdict == "holds"


def test_rest_at_the_only_parameter_value_holds() -> None:
    assert check_origin(agent(f=P - 1, box={P: (1, 1)}), NOTHING).verdict == "holds"
    assert check_origin(agent(f=P - 1, box={P: (1, 2)}), NOTHING).verdict == "fails"


def test_warnings_do_not_fail() -> None:
    finding = check_origin(agent(f=X1 * log(2 + X1), box={P: (1, 2)}), NOTHING)
    assert finding.verdict == "holds"
    origin, smooth = finding.evidence["warnings"]
    assert "does not contain the origin" in origin
    assert "the logarithm of x1 + 2 needs x1 + 2 to be positive" in smooth
    assert "warnings" not in check_origin(agent(f=X1, box={P: (-1, 2)}), NOTHING).evidence
