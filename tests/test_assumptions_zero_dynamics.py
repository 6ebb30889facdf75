"""A6: quadratic functions found and proved, given ones proved or refused with a point, one unstable corner found."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest
import sympy
from hand_built import NOTHING, ROTATION, V1, X1, Z1, Z2, P, Q, agent
from sympy import Rational, log, sin, sqrt, tanh

from certify.assumptions.a6_zero_dynamics import check_zero_dynamics
from certify.assumptions.findings import Finding
from certify.assumptions.quadratic_lyapunov import common_lyapunov, decay, solved_lyapunov
from certify.inequalities.matrices import Matrix, matrix
from symbolic.errors import InputError
from symbolic.plant import Agent, Exosystem, symbol
from symbolic.regulator import solve_regulator
from symbolic.steady_state import SteadyState

THIRD = symbol("q3")
OSCILLATOR = [Z2, -P * Z1 - Q * Z2 + X1]


def decide(plant: Agent, exosystem: Exosystem = NOTHING) -> Finding:
    found = solve_regulator(plant, exosystem)
    return check_zero_dynamics(plant, exosystem, found if isinstance(found, SteadyState) else None, Fraction(2))


def proved_decay(finding: Finding, A: Matrix) -> None:
    """``AᵀP + PA + a0 I ⪯ 0`` recomputed from the evidence alone."""
    P0 = matrix([[Rational(entry) for entry in row] for row in finding.evidence["P"]])
    found = decay(P0, [A])
    assert isinstance(found, Fraction)
    assert found >= Fraction(finding.evidence["a0"]) * Fraction(9, 10)


def test_scalar_zero_dynamics_have_the_exact_rate() -> None:
    finding = decide(agent([P * Z1 + X1], box={P: ("-3/2", "-1/2")}))
    assert finding.verdict == "holds"
    assert finding.evidence["V0"] == "z1**2/2"
    assert finding.evidence["P"] == [["1/2"]]
    assert finding.evidence["a0"] == "1/2"
    assert finding.evidence["a6_plus"] == "i"


def test_no_zero_dynamics() -> None:
    assert decide(agent()).verdict == "holds"


def test_two_states_over_the_corners_of_the_box() -> None:
    finding = decide(agent(OSCILLATOR, box={P: (1, 2), Q: (1, 3)}))
    assert finding.verdict == "holds"
    for p, q in ((1, 1), (1, 3), (2, 1), (2, 3), (Rational(3, 2), 2)):
        proved_decay(finding, matrix([[0, 1], [-p, -q]]))


HARD = [matrix([[0, 1], [-p, Rational(-7, 10)]]) for p in (Rational(1, 2), Rational(3, 2))]


def test_the_solver_finds_what_the_simple_candidates_miss() -> None:
    assert common_lyapunov(HARD) is None
    proof = solved_lyapunov(HARD)
    assert proof is not None
    assert isinstance(decay(proof.P, HARD), Fraction)
    assert decide(agent([Z2, -P * Z1 - Rational(7, 10) * Z2 + X1], box={P: ("1/2", "3/2")})).verdict == "holds"


def test_no_common_quadratic_function_is_unknown() -> None:
    finding = decide(agent([Z2, -P * Z1 - Z2 / 10 + X1], box={P: ("1/2", "3/2")}))
    assert finding.verdict == "unknown"
    assert "every corner of W is stable but no common quadratic V0" in finding.reason


UNSTABLE = {
    "at one end": ([P * Z1 + X1], {P: (-1, "1/1000000000000")}, {"p": "1/1000000000000"}),
    "marginal at one end": ([P * Z1 + X1], {P: (-1, 0)}, {"p": "0"}),
    "at one corner": (OSCILLATOR, {P: (1, 2), Q: ("-1/10", 3)}, {"p": "1", "q": "-1/10"}),
    "at one corner of three": (
        [-Z1 + P * Q * THIRD * Z1 + X1],
        {P: (0, 1), Q: (0, 1), THIRD: (0, "11/10")},
        {"p": "1", "q": "1", "q3": "11/10"},
    ),
    "not affine in the parameter": ([(P**2 - Rational(1, 4)) * Z1 + X1], {P: (-1, 1)}, {"p": "-1"}),
    "for one reference": ([-Z1 + X1 * Z1], {}, {"x1": "1"}),
    "everywhere": ([Z1], {}, {}),
}


@pytest.mark.parametrize(("f0", "box", "at"), UNSTABLE.values(), ids=UNSTABLE)
def test_an_unstable_point_is_the_witness(f0: list[sympy.Expr], box: dict, at: dict[str, str]) -> None:
    finding = decide(agent(f0, box=box))
    assert finding.verdict == "fails"
    assert "not stable" in finding.reason
    assert finding.evidence["at"] == at


NONLINEAR = {
    "cubic": [-Z1 - Z1**3 + X1],
    "cubic with rotation": [-Z1 + Z2 - Z1**3, -Z1 - Z2 + X1],
    "saturation": [-Z1 - tanh(Z1) + X1],
    "weak sine": [-Z1 + sin(Z1) / 2 + X1],
    "crossed sines": [-Z1 + sin(Z2) / 4, -Z2 + sin(Z1) / 4 + X1],
    "reference": [-Z1 - X1**2 * Z1 + X1],
    "quadratic in a parameter": [-(1 + P**2) * Z1 + X1],
    "cubic, quadratic in a parameter": [-Z1 - Z1**3 + Z2, -Z1 - (1 + P**2) * Z2 + X1],
    "cubic, exponential": [-Z1 - Z1**3 - sympy.exp(Z1) + 1 + X1],
}


@pytest.mark.parametrize("f0", NONLINEAR.values(), ids=NONLINEAR)
def test_nonlinear_zero_dynamics_with_a_quadratic_function(f0: list[sympy.Expr]) -> None:
    finding = decide(agent(f0, box={P: (-1, 1)}))
    assert finding.verdict == "holds"
    assert finding.evidence["a6_plus"] == "i"


def test_a_disturbance_that_stays_small_is_allowed() -> None:
    assert decide(agent([-2 * Z1 + V1 * Z1 + X1]), ROTATION).verdict == "holds"
    failing = decide(agent([-Z1 / 2 + V1 * Z1 + X1]), ROTATION)
    assert (failing.verdict, failing.evidence["at"]) == ("fails", {"v1": "1"})


@pytest.mark.parametrize(
    ("f0", "reason"),
    [
        ([-Z1 - log(1 + Z1) + X1], "logarithm of z1 \\+ 1 needs"),
        ([-Z1 - sqrt(1 + Z1**2) + X1], "not all of which are Hurwitz"),
        ([-Z1 + Z1**2 + X1], "no proved bounds"),
    ],
)
def test_what_cannot_be_decided_is_unknown(f0: list[sympy.Expr], reason: str) -> None:
    finding = decide(agent(f0))
    assert finding.verdict == "unknown"
    assert re.search(reason, finding.reason)


def test_a_scalar_that_leaves_the_steady_state_fails() -> None:
    finding = decide(agent([-Z1 + Z1**2]))
    assert finding.verdict == "fails"
    assert "do not point towards the steady state" in finding.reason


GIVEN = {
    "quadratic": ([-Z1 + X1], Z1**2 / 2, "i"),
    "quartic": ([-Z1 + X1], Z1**2 / 2 + Z1**4 / 4, None),
    "quadratic form": ([Z2, -Z1 - Z2 + X1], 3 * Z1**2 + 2 * Z1 * Z2 + 2 * Z2**2, "i"),
    "cascade": ([-Z1, Z1**2 - Z2 + X1], 4 * Z1**2 + Z1**4 + Z2**2, None),
}


@pytest.mark.parametrize(("f0", "V0", "plus"), GIVEN.values(), ids=GIVEN)
def test_a_given_function_is_proved(f0: list[sympy.Expr], V0: sympy.Expr, plus: str | None) -> None:
    finding = decide(agent(f0, lyapunov=V0))
    assert finding.verdict == "holds"
    assert Fraction(finding.evidence["a0"]) > 0
    assert finding.evidence["a6_plus"] == plus


def test_a_function_that_is_not_quadratic_comes_with_a_note() -> None:
    finding = decide(agent([-Z1, Z1**2 - Z2 + X1], lyapunov=4 * Z1**2 + Z1**4 + Z2**2))
    assert "F1" in finding.evidence["note"]


REFUSED = {
    "F11": ([Z1], -(Z1**2) / 2, "not positive definite: V0 = -1/2 at z1 = 1|not stable"),
    "negative": ([-Z1], -(Z1**2) / 2, "not positive definite"),
    "indefinite": ([-Z1, -Z2 + X1], Z1**2 - Z2**2, "not positive definite"),
    "semidefinite": ([-Z1, -Z2 + X1], Z1**2, "not positive definite"),
    "an offset": ([-Z1], 1 + Z1**2, r"V0\(0\) = 1 is not 0"),
    "too flat": ([-Z1], Z1**4, "no negative definite quadratic part"),
    "rising": ([-Z1 + 10 * Z2, -Z2 + X1], Z1**2 + Z2**2, "does not decrease: its derivative is 16 at z1 = 1, z2 = 1"),
    "rising between the samples": (
        [-Z1 + Rational(201, 100) * Z2, -Z2 + X1],
        Z1**2 + Z2**2,
        "does not decrease along|no negative definite quadratic part|does not decrease: its derivative",
    ),
    "rising far away": ([-Z1 + Z1**3 / 100], Z1**2, "do not point towards the steady state"),
}


@pytest.mark.parametrize(("f0", "V0", "reason"), REFUSED.values(), ids=REFUSED)
def test_a_wrong_function_is_refused_with_a_point(f0: list[sympy.Expr], V0: sympy.Expr, reason: str) -> None:
    finding = decide(agent(f0, lyapunov=V0))
    assert finding.verdict == "fails"
    assert re.search(reason, finding.reason), finding.reason


def test_a_wrong_function_is_refused_at_one_corner() -> None:
    finding = decide(agent(OSCILLATOR, box={P: (1, 9), Q: (1, 2)}, lyapunov=3 * Z1**2 + 2 * Z1 * Z2 + 2 * Z2**2))
    assert finding.verdict == "fails"
    assert finding.evidence["at"]["p"] == "9"


@pytest.mark.parametrize(
    ("f0", "V0"),
    [
        ([-Z1 + X1], Z1**2 / (1 + Z1**2)),
        ([-Z1 + Z1**3 * Z2, -Z2 - 4 * Z1**4 * Z2**3 + X1], Z1**2 + Z2**2 / 100),  # F1's system: needs its own V0
        ([-Z1, -Z2 + X1], Z1**2 + Z2**2 + sqrt(2) * Z1**4),
    ],
)
def test_an_undecided_function_does_not_hold(f0: list[sympy.Expr], V0: sympy.Expr) -> None:
    assert decide(agent(f0, lyapunov=V0)).verdict != "holds"


def test_foreign_names_in_a_given_function() -> None:
    with pytest.raises(InputError, match=r"agent 1: zero_dynamics_lyapunov: p may not appear in V0"):
        decide(agent([-Z1 + X1], box={P: (1, 2)}, lyapunov=P * Z1**2))


@pytest.mark.parametrize("scale", [Rational(1, 10**6), Rational(10**6)])
def test_the_verdict_survives_scaling_a_state(scale: sympy.Rational) -> None:
    f0 = [Z2 * scale, (-P * Z1 - Q * Z2 * scale + X1) / scale]
    assert decide(agent(f0, box={P: (1, 2), Q: (1, 3)})).verdict == "holds"
    assert decide(agent(f0, box={P: (1, 2), Q: ("-1/10", 3)})).verdict == "fails"
