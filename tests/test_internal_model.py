"""Internal models generate u* with the least order, for every parameter value; designs are checked exactly."""

from __future__ import annotations

from fractions import Fraction
from math import comb
from typing import Any

import numpy as np
import pytest
import sympy
from hand_built import CONSTANT, NOTHING, ROTATION, V1, V2, X1, X2, Z1, P, Q, S, agent, exosystem
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Rational, exp, log, sin, sqrt

from symbolic.design import characteristic_polynomial, design_polynomials, internal_model_pair, is_controllable
from symbolic.errors import InputError
from symbolic.exact_field import as_expression
from symbolic.hurwitz import hurwitz_test
from symbolic.identity import normal_form
from symbolic.internal_model import InternalModel, NoInternalModel, internal_model
from symbolic.plant import Agent, Exosystem, InternalModelChoice, Plant
from symbolic.regulator import SteadyState, solve_regulator

THETA = Rational(4, 5)
TWO_FREQUENCIES = exosystem([0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 2], [0, 0, -2, 0])
UNIT_BOX = {P: (1, 2), Q: (1, 2)}


def model_of(plant: Agent, exo: Exosystem, s_star: sympy.Expr = S) -> InternalModel | NoInternalModel:
    steady = solve_regulator(plant, exo)
    assert isinstance(steady, SteadyState), steady
    return internal_model(plant, exo, steady, s_star)


def matrix(rows: Any) -> sympy.Matrix:
    return sympy.Matrix([[as_expression(entry) for entry in row] for row in rows])


def derivatives(u: sympy.Expr, exo: Exosystem, count: int) -> list[sympy.Expr]:
    velocity = exo.S * sympy.Matrix(exo.states) if exo.states else []
    found = [u]
    for _ in range(count):
        rate = sympy.Add(*(found[-1].diff(v) * speed for v, speed in zip(exo.states, velocity, strict=True)))
        found.append(sympy.expand(rate))
    return found


def assert_generates(model: InternalModel, u: sympy.Expr, exo: Exosystem) -> None:
    """The theorem: the relation for every w, τ' = Φτ, TΦ − MT = NΓ, T nonsingular, Ψ = Γ T⁻¹, so u* = Ψ (Tτ)."""
    tau = derivatives(u, exo, model.order)
    relation = tau[-1] - sum(as_expression(c) * d for c, d in zip(model.ell, tau[:-1], strict=True))
    assert normal_form(relation) == 0
    if model.order == 0:
        return
    T, Phi, M = matrix(model.T), matrix(model.Phi), matrix(model.M)
    N, Gamma, psi = matrix([[entry] for entry in model.N]), matrix([model.Gamma]), matrix([model.psi])
    assert all(entry == 0 or normal_form(entry) == 0 for entry in (*(T * Phi - M * T - N * Gamma), *(psi * T - Gamma)))
    assert normal_form(T.det()) != 0
    characteristic = (M + N * psi).charpoly().as_expr() - Phi.charpoly().as_expr()  # M + NΨ is similar to Φ
    assert characteristic.expand() == 0 or normal_form(characteristic) == 0


def least_order(u: sympy.Expr, exo: Exosystem, most: int) -> int:
    """The same number from ranks: rows of values of (u*, u*', …) at random (s, v, w)."""
    names = sorted({*u.free_symbols, *exo.states}, key=str)
    functions = sympy.lambdify(names, derivatives(u, exo, most), "numpy")
    rng = np.random.default_rng(1)
    rows = np.array([functions(*rng.uniform(1, 2, len(names))) for _ in range(4 * most)], float)
    rows /= np.maximum(np.abs(rows).max(axis=0), 1e-300)
    ranks = [int(np.linalg.matrix_rank(rows[:, :k], 1e-8)) for k in range(1, most + 1)]
    return next(k for k in range(1, most + 1) if k == most or ranks[k] == ranks[k - 1])


def test_example_of_the_paper(five_agents: Plant) -> None:
    for plant, ell, psi in (
        (five_agents.agents[1], (-Fraction(16, 25), 0), (Fraction(34, 25), 3)),
        (five_agents.agents[4], (0, -Fraction(16, 25), 0), (3, Fraction(159, 25), 5)),
    ):
        steady = solve_regulator(plant, five_agents.exosystem)
        assert isinstance(steady, SteadyState)
        model = internal_model(plant, five_agents.exosystem, steady, sympy.Integer(2))
        assert isinstance(model, InternalModel)
        assert model.ell == ell and model.psi == psi and model.least and model.spectrum == "holds"
        assert plant.internal_model is not None and model.M == plant.internal_model.M
        assert_generates(model, steady.u_star.xreplace({S: sympy.Integer(2)}), five_agents.exosystem)


MODELS = {
    "zero": (agent(f=X2), ROTATION, 0),
    "constant": (agent(f=X1**2), ROTATION, 1),
    "constant without exosystem": (agent(f=P * X1, box={P: (1, 2)}), NOTHING, 1),
    "one frequency, both phases by parameters": (agent(f=P * V1 + Q * V2, box=UNIT_BOX), ROTATION, 2),
    "constant and frequency": (agent(f=P * V1 + X1, box={P: (1, 2)}), ROTATION, 3),
    "square: frequencies 0 and 2": (agent(f=P * V1**2, box={P: (1, 2)}), ROTATION, 3),
    "product: frequency 2 only": (agent(f=V1 * V2), ROTATION, 2),
    "square sum is constant": (agent(f=P * (V1**2 + V2**2), box={P: (1, 2)}), ROTATION, 1),
    "cube: frequencies 1 and 3": (agent(f=V1**3), ROTATION, 4),
    "square and cube": (agent(f=P * V1**2 + V1**3, box={P: (1, 2)}), ROTATION, 7),
    "through the zero dynamics": (agent([P * Z1 + X1 + V1], Z1 * X1, box={P: (-2, -1)}), ROTATION, 3),
    "parameter in b": (agent(f=V1 + Q * X1, b=P, box=UNIT_BOX), ROTATION, 3),
    "transcendental coefficient": (agent(f=sin(P) * V1 + exp(Q) * X1, box=UNIT_BOX), ROTATION, 3),
    "product of two frequencies": (agent(f=V1 * sympy.Symbol("v3", real=True)), TWO_FREQUENCIES, 4),
    "step": (agent(f=P * V1 + V1**2, box={P: (1, 2)}), CONSTANT, 1),
    "irrational frequency": (agent(f=V1 + V2**2), exosystem([0, sqrt(2)], [-sqrt(2), 0]), 5),
    "algebraic frequency": (agent(f=V1), exosystem([0, 1 + sqrt(2)], [-1 - sqrt(2), 0]), 2),
}


@pytest.mark.parametrize("name", MODELS)
def test_internal_models_have_the_least_order(name: str) -> None:
    plant, exo, order = MODELS[name]
    model = model_of(plant, exo)
    assert isinstance(model, InternalModel) and model.order == order == len(model.ell), model
    steady = solve_regulator(plant, exo)
    assert isinstance(steady, SteadyState)
    assert_generates(model, steady.u_star, exo)
    assert model.spectrum == ("unknown" if name == "algebraic frequency" else "holds")
    if order:
        assert least_order(steady.u_star, exo, order + 1) == order


def test_consensus_value_may_shorten_the_relation() -> None:
    plant = agent(f=(X1 - 2) * V1 + X1)
    general, special = model_of(plant, ROTATION), model_of(plant, ROTATION, sympy.Integer(2))
    assert isinstance(general, InternalModel) and isinstance(special, InternalModel)
    assert (general.order, special.order) == (3, 1)


def test_point_parameters_are_constants() -> None:
    model = model_of(agent(f=P * V1 + X1**2 * Q, box={P: (0, 0), Q: (1, 2)}), ROTATION)
    assert isinstance(model, InternalModel) and model.order == 1


@pytest.mark.parametrize(
    ("f", "s_star", "verdict", "term"),
    [
        (1 / (2 + V1), S, "fails", r"1/(v1 + 2)"),
        (X1 / (1 + V1**2), sympy.Integer(1), "fails", "1/(v1**2 + 1)"),
        (X1 / (1 + V1**2), S, "unknown", "1/(v1**2 + 1)"),
        (sin(V1) * P, S, "fails", "sin(v1)"),
        (exp(V1 + V2**2) - 1, S, "fails", "exp(v1 + v2**2)"),
        (sqrt(1 + V1**2), S, "unknown", "sqrt(v1**2 + 1)"),
        (sin(V1) + exp(V1), S, "unknown", "sin(v1)"),
        (exp(sqrt(2) * V1) - exp(V1), S, "unknown", "exp(sqrt(2)*v1)"),
        (exp(V1) + exp(V1 / 2) - 2, S, "unknown", "exp(v1)"),
    ],
)
def test_other_steady_inputs_are_refused(f: sympy.Expr, s_star: sympy.Expr, verdict: str, term: str) -> None:
    answer = model_of(agent(f=f, box={P: (1, 2)}), ROTATION, s_star)
    assert isinstance(answer, NoInternalModel) and answer.verdict == verdict
    assert answer.evidence["term"] in (term, "exp(v1)", "exp(v1/2)")
    assert ("is not shown to be" if verdict == "unknown" else "is not a polynomial in v") in answer.reason


@pytest.mark.parametrize(
    "f",
    [
        (V1**2 - 1) / (V1 - 1),
        sin(V1) ** 2 + sympy.cos(V1) ** 2 + V1,
        exp(V1) * exp(-V1) * V1,
        exp(log(4) * V1) - exp(log(2) * V1) ** 2 + V1,
        (V1 + V1 * P) / (1 + P),
    ],
)
def test_hidden_polynomials_are_seen(f: sympy.Expr) -> None:
    assert isinstance(model_of(agent(f=f, box={P: (1, 2)}), ROTATION), InternalModel)


def test_too_long_relations_are_unknown() -> None:
    for f, reason in ((V1**12 + (V1 * X1) ** 13, "order 24 or less"), (V1**25, "degree in v may pass 16")):
        answer = model_of(agent(f=f), ROTATION)
        assert isinstance(answer, NoInternalModel) and answer.verdict == "unknown" and reason in answer.reason


def test_growing_exosystem_is_reported() -> None:
    """A4 is decided elsewhere; the internal model says that Φ has other eigenvalues, or multiple ones."""
    ramp, growth = exosystem([0, 1], [0, 0]), exosystem([0, 1], [-1, Rational(1, 10**18)])
    for exo in (ramp, growth):
        model = model_of(agent(f=V1), exo)
        assert isinstance(model, InternalModel) and model.order == 2 and model.spectrum == "fails"


@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2), st.integers(-3, 3)), min_size=1, max_size=4))
def test_order_of_random_polynomials(terms: list[tuple[int, int, int]]) -> None:
    u = sum((c * V1**i * V2**j for i, j, c in terms), sympy.Integer(0))
    model = model_of(agent(f=-u), ROTATION)
    assert isinstance(model, InternalModel)
    assert_generates(model, u, ROTATION)
    expected = set()
    a, b = sympy.symbols("a b")
    modes = sympy.Poly(sympy.expand(u.xreplace({V1: (a + b) / 2, V2: (a - b) / (2 * sympy.I)})), a, b)
    for (i, j), c in modes.terms():
        if c != 0:
            expected.add(i - j)
    assert model.order == len(expected)


def choice(M: list[list[int]], N: list[int]) -> InternalModelChoice:
    return InternalModelChoice(tuple(tuple(Fraction(e) for e in row) for row in M), tuple(Fraction(e) for e in N))


@pytest.mark.parametrize(
    ("given_pair", "message"),
    [
        (
            choice([[0, 1, 0], [0, 0, 1], [-6, -11, -6]], [0, 0, 1]),
            r"agent 1: internal_model\.M: .* needs a 2×2 matrix",
        ),
        (choice([[0, 1], [-2, -3]], [0, 0, 1]), r"agent 1: internal_model\.N: .* needs 2 entries"),
        (choice([[0, 1], [-2, 0]], [0, 1]), r"internal_model\.M: not Hurwitz, the Hurwitz determinant of order 1 is 0"),
        (
            choice([[0, 1], [2, -3]], [0, 1]),
            r"internal_model\.M: not Hurwitz, the Hurwitz determinant of order 2 is -6",
        ),
        (choice([[-1, 0], [0, -2]], [1, 0]), r"internal_model\.N: the pair \(M, N\) is not controllable"),
    ],
)
def test_unsuitable_pairs_are_refused(given_pair: InternalModelChoice, message: str) -> None:
    with pytest.raises(InputError, match=message):
        model_of(agent(f=V1, internal_model=given_pair), ROTATION)


def test_pair_without_an_internal_model_is_refused() -> None:
    with pytest.raises(InputError, match="identically zero, so there is no internal model"):
        model_of(agent(f=X2, internal_model=choice([[-1]], [1])), ROTATION)


@pytest.mark.parametrize("order", range(1, 7))
def test_default_pairs(order: int) -> None:
    pair = internal_model_pair(agent(), order)
    roots = sympy.Poly(characteristic_polynomial(pair.M), sympy.Symbol("x")).all_roots()
    assert sorted(roots) == [-k for k in range(order, 0, -1)]
    assert is_controllable(pair.M, pair.N)


@pytest.mark.parametrize("order", range(1, 6))
def test_default_polynomials(order: int) -> None:
    design = design_polynomials(agent(order=order))
    assert design.gamma == tuple(comb(order - 1, k) for k in range(order - 1))
    assert design.observer == (() if order == 1 else tuple(comb(order, k) for k in range(order)))


@pytest.mark.parametrize(
    ("order", "answers", "message"),
    [
        (
            3,
            {"gamma": (Fraction(1), Fraction(0))},
            r"agent 1: gamma: not Hurwitz, the Hurwitz determinant of order 1 is 0",
        ),
        (3, {"gamma": (Fraction(1),)}, r"gamma: 2 coefficients are needed for order 3, not 1"),
        (
            2,
            {"observer": (Fraction(-1), Fraction(2))},
            r"observer: not Hurwitz, the Hurwitz determinant of order 2 is -2",
        ),
        (3, {"observer": (Fraction(9), Fraction(3), Fraction(2))}, r"observer: not Hurwitz"),
        (1, {"observer": (Fraction(1),)}, r"an agent of order 1 measures its state"),
    ],
)
def test_unsuitable_polynomials_are_refused(order: int, answers: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        design_polynomials(agent(order=order, **answers))


@given(st.lists(st.tuples(st.integers(-4, 2), st.integers(0, 3)), min_size=1, max_size=3), st.integers(-3, 3))
def test_hurwitz_test_agrees_with_the_roots(pairs: list[tuple[int, int]], single: int) -> None:
    """Polynomials with known roots: a complex pair (or a real double root) each, and perhaps one real root."""
    x = sympy.Symbol("x")
    polynomial = sympy.prod([(x - re) ** 2 + im**2 for re, im in pairs]) * (x - single if single else 2)
    coefficients = [Fraction(int(c)) for c in sympy.Poly(polynomial, x).all_coeffs()]
    stable = all(re < 0 for re, _ in pairs) and single <= 0
    for scale in (1, -1, Fraction(1, 3)):
        test = hurwitz_test([scale * c for c in coefficients])
        assert test.verdict == ("holds" if stable else "fails")
        assert (test.index is None) == stable
        if test.index is not None:
            assert test.determinants[-1] <= 0 and all(minor > 0 for minor in test.determinants[:-1])
            assert len(test.determinants) == test.index


def test_hurwitz_determinants_of_a_cubic() -> None:
    a, b, c = Fraction(6), Fraction(11), Fraction(6)
    assert hurwitz_test((1, a, b, c)).determinants == (a, a * b - c, c * (a * b - c))


@pytest.mark.parametrize("coefficients", [(), (0, 1, 2)])
def test_hurwitz_test_needs_a_leading_coefficient(coefficients: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="nonzero leading coefficient"):
        hurwitz_test(coefficients)
