"""The optimum: exact where it is rational, else enclosed to 1e-12 with proved signs."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath
import pytest
import sympy
from hand_built import NOTHING, agent
from sympy import atan, cosh, exp, log, sqrt

from certify.optimum import NoOptimumError, optimum
from symbolic.plant import COST_VARIABLE, Digraph, Plant

s = COST_VARIABLE


def plant(*costs: sympy.Expr) -> Plant:
    agents = tuple(replace(agent(), id=k, cost=cost) for k, cost in enumerate(costs, 1))
    return Plant("test", Digraph(len(costs), ()), NOTHING, agents, "")


def test_the_paper_s_optimum(five_agents: Plant) -> None:
    found = optimum(five_agents)
    assert found.exact == 2
    assert found.enclosure.is_point


@pytest.mark.parametrize(
    ("costs", "exact"),
    [
        ([(s - 1) ** 2, 3 * s**2], Fraction(1, 4)),
        ([sqrt(2) * (s - 1) ** 2, sqrt(2) * s**2], Fraction(1, 2)),
        ([s**2 + log(cosh(s - 1)), s**2 + log(cosh(s + 1))], Fraction(0)),
        ([s**2 + log(exp(s) + exp(-s))], Fraction(0)),
    ],
)
def test_rational_optima_are_exact(costs: list[sympy.Expr], exact: Fraction) -> None:
    assert optimum(plant(*costs)).exact == exact


@pytest.mark.parametrize(
    "costs",
    [
        [s**2 / 2 + log(1 + exp(s))],
        [sqrt(2) * (s - 1) ** 2, s**2],
        [s**2 + atan(s - 3), (s + 5) ** 2],
        [(s - 10**6) ** 2 + log(1 + exp(s))],
        [(s - sympy.Rational(1, 10**6)) ** 2 + atan(s) / 10**9],
    ],
)
def test_other_optima_are_enclosed(costs: list[sympy.Expr]) -> None:
    found = optimum(plant(*costs))
    assert found.exact is None
    low, high = found.enclosure.lo, found.enclosure.hi
    assert high - low <= Fraction(1, 10**12) * max(1, abs(low))
    slope = sympy.lambdify(s, sympy.diff(sympy.Add(*costs), s), "mpmath")
    with mpmath.workdps(60):
        assert (
            slope(mpmath.mpf(low.numerator) / low.denominator)
            <= 0
            <= slope(mpmath.mpf(high.numerator) / high.denominator)
        )


@pytest.mark.parametrize(
    ("cost", "reason"), [(s**4, "agent 2: .*unbounded"), (log(1 + exp(s)), "agent 2: .*tends to 0")]
)
def test_no_optimum_without_strong_convexity(cost: sympy.Expr, reason: str) -> None:
    with pytest.raises(NoOptimumError, match=reason):
        optimum(plant(s**2, cost))
