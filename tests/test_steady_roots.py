"""Steady states without closed form: the zero of a falling ``f0``, enclosed by the search and proved by the checker."""

from __future__ import annotations

import copy
from fractions import Fraction
from typing import Any

import pytest
import sympy
from hand_built import CONSTANT, NOTHING, V1, X1, Z1, Z2, P, agent

from certify.assumptions.check import check_assumptions
from certify.bounds.roots import SHARPNESS, root_brackets
from certify.certificate import canonical
from certify.checker import check
from certify.pipeline import design_gains
from symbolic.plant import Interval
from symbolic.plant_file import parse_plant
from symbolic.regulator import solve_regulator
from symbolic.steady_state import NoSteadyState, SteadyState, root_symbol

TEXT = """
schema = "consensus-plant/1"
name = "root"
network = { agents = 1, edges = [] }
initial = { box = [-1, 1], reference = 0, observer = 0, eta = 0 }

[[agent]]
ids = [1]
order = 1
f = "-x1 + z1"
b = 1
cost = "(s - 1)^2"
uncertain = { p = [1, 1.1] }
zero_dynamics = { z1 = "-z1 - p*z1^3 + x1" }
"""
ONE = Interval(Fraction(1), Fraction(1))


@pytest.mark.parametrize(
    ("f0", "s"),
    [
        (-Z1 - Z1**3 + X1, 1),
        (-P * Z1 - Z1**5 + X1, 2),
        (-2 * Z1 - sympy.sin(Z1) + P * X1, 1),
        (-sympy.sinh(Z1) - P * Z1 + X1, -3),
        (-Z1 - sympy.tanh(Z1) + X1, Fraction(1, 10**9)),
        (-Z1 - Z1**3 + X1, 0),
    ],
)
def test_the_bracket_holds_the_zero_for_all_parameters_and_is_sharp(f0: sympy.Expr, s: int | Fraction) -> None:
    plant, optimum = agent([f0], box={P: (1, 2)}), Interval(Fraction(s), Fraction(s))
    steady = solve_regulator(plant, NOTHING)
    assert isinstance(steady, SteadyState) and steady.z_star == (root_symbol(Z1),) and steady.source == "root"
    found = root_brackets(plant, steady, optimum)
    assert isinstance(found, dict)
    value = sympy.lambdify((Z1, X1, P), f0)
    zeros = []
    for p in (1, 1.5, 2):
        low, high = -100.0, 100.0
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (middle, high) if value(middle, float(s), p) > 0 else (low, middle)
        zeros.append(low)
    bracket, room = found[Z1], float(8 * SHARPNESS) * max(map(abs, zeros)) + 1e-15
    assert min(zeros) - room <= float(bracket.lo) <= min(zeros) + 1e-15
    assert max(zeros) - 1e-15 <= float(bracket.hi) <= max(zeros) + room


@pytest.mark.parametrize(
    ("f0", "words"),
    [
        ([-Z1 - Z1**3 + 4 * Z1 * X1 + X1], "not shown to be negative"),  # it rises near 0
        ([sympy.exp(-Z1) - 1 + 2 * X1], "no zero that was found"),
    ],
)
def test_what_is_not_a_unique_zero_is_said_to_be_open(f0: list[sympy.Expr], words: str) -> None:
    plant = agent(f0)
    steady = solve_regulator(plant, NOTHING)
    assert isinstance(steady, SteadyState)
    found = root_brackets(plant, steady, ONE)
    assert isinstance(found, str) and words in found


def test_what_depends_on_time_or_on_a_root_needs_an_answer_of_the_users() -> None:
    driven = solve_regulator(agent([-Z1 - Z1**3 + V1]), CONSTANT)
    assert isinstance(driven, NoSteadyState) and "give steady_state" in driven.reason
    follower = solve_regulator(agent([-Z1 - Z1**3 + X1, -Z2 + Z1]), NOTHING)
    assert isinstance(follower, NoSteadyState) and "depends on z1" in follower.reason


@pytest.fixture(scope="module")
def certified() -> Any:
    result = design_gains(parse_plant(TEXT.encode(), "root.toml"), "direct")
    assert result.status == "certified", result.reason
    return result.certificate


def verdict(certificate: Any, text: str = TEXT) -> Any:
    return check(text.encode(), canonical(certificate) + b"\n")


def changed(certificate: Any, root: list[str]) -> Any:
    other = copy.deepcopy(certificate)
    other["witness"]["agents"][0]["steady_state"] = [{"root": root}]
    return other


def test_a_plant_without_closed_form_is_checked_and_certified(certified: Any) -> None:
    report = check_assumptions(parse_plant(TEXT.encode(), "root.toml"))
    assert report.of("A3", 1).verdict == report.of("A5", 1).verdict == "holds"
    lo, hi = map(Fraction, certified["witness"]["agents"][0]["steady_state"][0]["root"])
    assert -lo - lo**3 * Fraction(11, 10) + 1 >= 0 >= -hi - hi**3 + 1 and hi - lo < Fraction(2, 100)
    assert verdict(certified).status == "verified"


def test_the_checker_refuses_intervals_without_the_zero(certified: Any) -> None:
    """Below it, above it, turned round, of another length; and an expression that is no steady state."""
    for root in (["0", "1/2"], ["7/10", "1"], ["1", "1/2"], ["1/2"], ["1/2", "3/4", "1"], []):
        assert verdict(changed(certified, root)).status in ("rejected", "malformed"), root
    assert "f0(lo, s, w)" in verdict(changed(certified, ["0", "1/2"])).obligation
    other = copy.deepcopy(certified)
    other["witness"]["agents"][0]["steady_state"] = ["17*s/25"]
    assert "A3" in verdict(other).obligation


def test_the_checker_refuses_a_zero_that_may_not_be_unique(certified: Any) -> None:
    """``z' = z − z³ + …`` rises at 0; nor may the zero depend on an exosystem."""
    for old, new, words in (
        ("-z1 - p*z1^3 + x1", "z1/10 - p*z1^3 + x1", "∂f0/∂z < 0"),
        ("-z1 - p*z1^3 + x1", "-z1 - p*z1^3 + x1 + 0*log(z1)", "A3"),
    ):
        text = TEXT.replace(old, new)
        other = copy.deepcopy(certified)
        other["claim"]["plant_sha256"] = parse_plant(text.encode(), "other.toml").sha256
        found = verdict(other, text)
        assert found.status == "rejected" and words in found.obligation, found
