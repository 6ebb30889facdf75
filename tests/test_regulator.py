"""Steady states: found ones satisfy the regulator equation, unsolvable ones are refused with a proof."""

from __future__ import annotations

import re

import pytest
import sympy
from hand_built import CONSTANT, NOTHING, ROTATION, V1, V2, X1, X2, Z1, Z2, P, Q, S, agent, exosystem
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Rational, cos, exp, log, sin, sqrt

from symbolic.errors import InputError
from symbolic.identity import normal_form, zero_test
from symbolic.plant import Agent, Exosystem, Plant
from symbolic.regulator import NoSteadyState, SteadyState, solve_regulator
from symbolic.steady_state import regulator_residuals

THETA = Rational(4, 5)
Z_KNOWN = S**2 + V1  # a steady state to build nonlinear zero dynamics around


def assert_steady(plant: Agent, exo: Exosystem) -> SteadyState:
    """The theorem: ∂z*/∂v S v = f0(z*, s, v, w), z*(0, 0, w) = 0 and b u* = −f(z*, s, 0, v, w)."""
    found = solve_regulator(plant, exo)
    assert isinstance(found, SteadyState), found
    assert all(normal_form(residual) == 0 for residual in regulator_residuals(plant, exo, found.z_star))
    origin = dict.fromkeys((S, *exo.states), sympy.Integer(0))
    assert all(normal_form(z.xreplace(origin)) == 0 for z in found.z_star)
    at_rest = dict.fromkeys(plant.chain, sympy.Integer(0)) | {X1: S}
    at_rest |= dict(zip(plant.zero_states, found.z_star, strict=True))
    assert normal_form(plant.b * found.u_star + plant.f.xreplace(at_rest)) == 0
    return found


def test_example_of_the_paper(five_agents: Plant) -> None:
    p1, v1, v2 = sympy.symbols("p1 v1 v2", real=True)
    found = assert_steady(five_agents.agents[0], five_agents.exosystem)
    expected = -11 * p1 * v1 / (p1**2 + THETA**2) - 11 * THETA * v2 / (p1**2 + THETA**2) - S / p1
    assert normal_form(found.z_star[0] - expected) == 0
    assert found.u_star == -12 * v2
    third = solve_regulator(five_agents.agents[2], five_agents.exosystem)
    assert isinstance(third, SteadyState) and third.source == "none" and third.z_star == ()


def test_printed_steady_state_is_refused(five_agents: Plant) -> None:
    """F19: the paper prints ``+ p_i1 a s/θ`` instead of ``− s/p_i1``."""
    p1, v1, v2 = sympy.symbols("p1 v1 v2", real=True)
    printed = -11 * p1 * v1 / (p1**2 + THETA**2) - 11 * THETA * v2 / (p1**2 + THETA**2) + p1 * S / THETA
    first = five_agents.agents[0]
    answer = solve_regulator(Agent(**{**first.__dict__, "steady_state": (printed,)}), five_agents.exosystem)
    assert isinstance(answer, NoSteadyState) and answer.verdict == "fails"
    assert "the residual of the regulator equation of z1 is not zero" in answer.reason
    assert answer.evidence["residual"] == str(-5 * p1**2 * S / 4 - S)
    assert "- s/p1" in answer.evidence["z1* found"]


SOLVABLE = {
    "linear": (agent([P * Z1 + X1 + V1], Z1 * X1, box={P: (-2, -1)}), ROTATION),
    "rotation invertible without damping": (agent([V1]), ROTATION),
    "two coupled states": (agent([-Z1 + P * Z2 + V1 * V2, -Q * Z1 - Z2 + X1**3], box={P: (1, 2), Q: (1, 2)}), ROTATION),
    "no exosystem": (agent([P * Z1 + X1], Z1 * X2, box={P: (-2, -1)}), NOTHING),
    "constant disturbance": (agent([-Z1 + X1 + V1**2]), CONSTANT),
    "triangular": (agent([-Z1 + X1 + V1, -2 * Z2 + Z1**2], Z2), ROTATION),
    "nonlinear": (agent([-Z1 - Z1**3 + (Z_KNOWN + Z_KNOWN**3).subs(S, X1) + THETA * V2]), ROTATION),
    "rational": (agent([-Z1 / (1 + Z1**2) + X1 / (1 + X1**2)]), ROTATION),
    "coefficients in s": (agent([-(1 + X1**2) * Z1 + V1]), ROTATION),
    "transcendental in s": (agent([-Z1 + sin(X1)]), ROTATION),
    "transcendental in the parameter": (agent([-exp(P) * Z1 + X1 + V1], box={P: (0, 1)}), ROTATION),
    "irrational": (agent([-sqrt(2) * Z1 + X1 + V1]), exosystem([0, sqrt(2)], [-sqrt(2), 0])),
    "denominator vanishes outside the box": (agent([(P**2 - 2) * Z1 + X1], box={P: (-1, 1)}), ROTATION),
    "definite form in the denominator": (
        agent([-(P**2 + P * Q + Q**2) * Z1 + X1], box={P: (-1, 1), Q: ("1/2", 1)}),
        ROTATION,
    ),
    "factor cancels": (agent([P * Z1 + P * X1], box={P: (-1, 1)}), ROTATION),
    "zero at a pole that is not there": (agent([P * Z1 + V1], box={P: (-1, 0)}), ROTATION),
    "point parameter": (agent([P * Z1 + X1], box={P: (-3, -3)}), ROTATION),
}


@pytest.mark.parametrize("name", SOLVABLE)
def test_found_steady_states_satisfy_the_equation(name: str) -> None:
    plant, exo = SOLVABLE[name]
    if any(interval.is_point for interval in plant.parameter_box):
        assert solve_regulator(plant, exo) == SteadyState((S / 3,), sympy.Integer(0), "ansatz")
    else:
        assert_steady(plant, exo)


UNSOLVABLE = {
    "integrator of s": (agent([X1]), ROTATION, "the terms without v.* have no equilibrium there", {"equation": "z1"}),
    "integrator of a constant": (agent([V1]), CONSTANT, "the terms in v1", {"monomial": "v1", "degree": "1"}),
    "integrator of an invariant": (agent([V1**2]), ROTATION, r"the terms in v\d\*\*2", {"degree": "2"}),
    "oscillator at the frequency of S": (agent([Z2, -(THETA**2) * Z1 + V1]), ROTATION, "resonate", {"equation": "z2"}),
    "oscillator at twice the frequency": (
        agent([Z2, -4 * THETA**2 * Z1 + V1 * V2]),
        ROTATION,
        "resonate",
        {"degree": "2"},
    ),
    "zero inside the box": (agent([P * Z1 + X1], box={P: (-1, 1)}), ROTATION, "p = 0", {"p": "0"}),
    "zero at an end of the box": (agent([P * Z1 + X1], box={P: (-1, 0)}), ROTATION, "p = 0", {"p": "0"}),
    "zero at a corner": (
        agent([(P + Q) * Z1 + X1], box={P: (0, 1), Q: (0, 1)}),
        ROTATION,
        "q = 0",
        {"p": "0", "q": "0"},
    ),
    "irrational zero": (
        agent([(P**2 - 2) * Z1 + X1], box={P: (1, 2)}),
        ROTATION,
        r"p\*\*2 - 2 changes its sign",
        {"point 1": "p = 1", "point 2": "p = 2"},
    ),
    "point parameter": (agent([P * Z1 + X1], box={P: (0, 0)}), ROTATION, "no equilibrium", {}),
    "pole at a value of s": (agent([(X1 - 1) * Z1 + V1]), CONSTANT, "s = 1", {"monomial": "v1"}),
    "nonlinear, no linear part": (agent([Z1**2 + X1]), ROTATION, "no equilibrium at s = 1", {"equation": "z1"}),
    "f0 does not vanish": (agent([-Z1 + P], box={P: (0, 1)}), ROTATION, "is not 0 in the", {"equation": "z1"}),
    "f0 does not vanish, transcendental": (agent([-Z1 + cos(X1)]), ROTATION, "not 0", {"equation": "z1"}),
}


@pytest.mark.parametrize("name", UNSOLVABLE)
def test_unsolvable_equations_are_refuted(name: str) -> None:
    plant, exo, reason, evidence = UNSOLVABLE[name]
    answer = solve_regulator(plant, exo)
    assert isinstance(answer, NoSteadyState) and answer.verdict == "fails", answer
    assert re.search(reason, answer.reason), answer.reason
    assert evidence.items() <= dict(answer.evidence).items()


def test_an_equilibrium_that_is_not_smooth_at_zero_is_not_called_none() -> None:
    """``z' = −z³ + x1`` rests at ``s^(1/3)``: no power series finds it, and nothing says that there is none."""
    answer = solve_regulator(agent([-(Z1**3) + X1]), NOTHING)
    assert isinstance(answer, NoSteadyState) and answer.verdict == "unknown"
    assert "an equilibrium there may be, but none that is smooth at 0" in answer.reason


@pytest.mark.parametrize(
    ("f0", "tried"),
    [
        ([-Z1 - Z1**3 + X1 + V1], "no polynomial of degree 8"),
        ([-Z1 + sin(V1)], "not a rational function"),
        ([-Z1 + X1, Z1 * Z2 - Z2**2 - Z2 + V1], "no polynomial of degree 8"),
    ],
)
def test_undecided_equations_say_what_was_tried(f0: list[sympy.Expr], tried: str) -> None:
    answer = solve_regulator(agent(f0), ROTATION)
    assert isinstance(answer, NoSteadyState) and answer.verdict == "unknown"
    assert "give steady_state" in answer.reason and any(tried in text for text in answer.evidence.values())


def test_resonance_behind_another_block_is_not_a_proof() -> None:
    """z2 is driven by a z1* that was found, not shown to be the only one."""
    answer = solve_regulator(agent([-Z1 - Z1**3 + X1 + X1**3, Z1]), ROTATION)
    assert isinstance(answer, NoSteadyState) and answer.verdict == "unknown"


def test_given_steady_states_are_verified() -> None:
    amplitude = log(1 + V1**2 + V2**2)
    right = solve_regulator(agent([-Z1 + amplitude], Z1, steady_state=(amplitude,)), ROTATION)
    assert right == SteadyState((amplitude,), -amplitude, "user")
    wrong = solve_regulator(agent([-Z1 + amplitude], steady_state=(log(1 + V1**2),)), ROTATION)
    assert isinstance(wrong, NoSteadyState) and wrong.verdict == "fails"
    point = {sympy.Symbol(name, real=True): sympy.Rational(wrong.evidence[name]) for name in ("v1", "v2")}
    residual = regulator_residuals(agent([-Z1 + amplitude]), ROTATION, (log(1 + V1**2),))[0]
    assert abs(residual.xreplace(point).evalf()) > 1e-3


@pytest.mark.parametrize(
    ("f0", "given", "verdict", "reason"),
    [
        ([-Z1 + X1 + 1 - exp(0)], S + 1, "fails", r"z1\*\(0, 0, w\) is not zero"),
        ([-Z1 + X1], 2 * S, "fails", "regulator equation"),
        ([X1 * (X1 - 1) * Z1 - X1**2], S / (S - 1), "fails", "undefined somewhere: s - 1 vanishes"),
        ([X1**2 * Z1 - Z1 - X1], S / (S**2 - 1), "fails", "undefined somewhere"),
        ([-Z1 + log(2 + cos(X1)) - log(3)], log(2 + cos(S)) - log(3), "holds", ""),
        ([-Z1 + log(1 + X1)], log(1 + S), "unknown", "may not be smooth everywhere"),
    ],
)
def test_given_steady_states_must_be_smooth_solutions(
    f0: list[sympy.Expr], given: sympy.Expr, verdict: str, reason: str
) -> None:
    answer = solve_regulator(agent(f0, steady_state=(sympy.sympify(given),)), NOTHING)
    if verdict == "holds":
        assert isinstance(answer, SteadyState)
    else:
        assert isinstance(answer, NoSteadyState) and answer.verdict == verdict, answer
        assert re.search(reason, answer.reason), answer.reason


def test_given_steady_state_with_a_foreign_name() -> None:
    with pytest.raises(InputError, match=r"agent 1: steady_state\.z1: x2 may not appear"):
        solve_regulator(agent([-Z1 + X1], steady_state=(S + X2,)), ROTATION)


@settings(max_examples=40)
@given(st.lists(st.integers(-3, 3), min_size=4, max_size=4), st.lists(st.integers(-3, 3), min_size=5, max_size=5))
def test_every_linear_zero_dynamics_is_decided(entries: list[int], forcing: list[int]) -> None:
    """A rational 2×2 system driven by s, v1, v1², s v1, v2³: an answer every time, and never a wrong one."""
    a, b, c, d = entries
    drive = sum((k * m for k, m in zip(forcing, (X1, V1, V1**2, X1 * V1, V2**3), strict=True)), sympy.Integer(0))
    plant = agent([a * Z1 + b * Z2 + drive, c * Z1 + d * Z2 + V1])
    answer = solve_regulator(plant, ROTATION)
    if isinstance(answer, SteadyState):
        residuals = regulator_residuals(plant, ROTATION, answer.z_star)
        assert all(zero_test(residual).verdict == "holds" for residual in residuals)
    else:
        matrix = sympy.Matrix([[a, b], [c, d]])
        resonant = [k for k in range(4) if (matrix**2 + (k * THETA) ** 2 * sympy.eye(2)).det() == 0]
        assert answer.verdict == "fails" and resonant
