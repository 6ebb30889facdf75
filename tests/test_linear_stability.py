"""The necessary condition on given gains: what it refutes is unstable, and what is stable it does not refute."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy
from flint import arb
from hypothesis import given, settings
from hypothesis import strategies as st

from certify.bounds.balls import lower, to_arb, upper
from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds
from certify.bounds.rationals import log10_estimate, scientific
from certify.gains.hurwitz_boundary import enclosed_determinants, hurwitz_determinants, observer_threshold
from certify.gains.linear_stability import LinearVerdict, necessary_condition
from certify.gains.loop_matrix import LoopMatrix, assemble, plant_slopes
from certify.gains.second_order_chain import chain_margin
from certify.inequalities.exact_psd import PositiveDefinite, prove_positive_definite
from certify.inequalities.instability import InstabilityProof, prove_instability
from certify.inequalities.lyapunov import Inconclusive
from certify.inequalities.matrices import Matrix, lyapunov_form, matrix, quadratic_form, to_float
from certify.optimum import Optimum
from symbolic.controller import AgentController
from symbolic.derivation import derive
from symbolic.derived import Derivation
from symbolic.internal_model import InternalModel
from symbolic.plant import COST_VARIABLE, Agent, InitialBox, Interval, symbol
from symbolic.plant_file import load_plant
from symbolic.steady_state import SteadyState

EXAMPLE = Path(__file__).parent.parent / "examples" / "five_agents_published.toml"
s, v1, w1, w2, z1, x1, x2, x3 = COST_VARIABLE, *(symbol(name) for name in ("v1", "w1", "w2", "z1", "x1", "x2", "x3"))
UNIT = Interval(Fraction(-1), Fraction(1))
TWO = Interval(Fraction(2), Fraction(2))
BINOMIAL = {1: (1,), 2: (1, 2), 3: (1, 3, 3)}


def fractions(values: Sequence[object]) -> tuple[Fraction, ...]:
    return tuple(Fraction(str(value)) for value in values)


def make_agent(
    order: int,
    f: object = 0,
    zero: Mapping[sympy.Symbol, object] | None = None,
    b: object = 1,
    box: Mapping[str, tuple[object, object]] | None = None,
) -> Agent:
    start = Interval(Fraction(0), Fraction(0))
    zero, box = zero or {}, box or {}
    return Agent(
        1,
        order,
        tuple(zero),
        tuple(map(sympy.sympify, zero.values())),
        sympy.sympify(f),
        sympy.sympify(b),
        s**2,
        tuple(symbol(name) for name in box),
        tuple(Interval(*fractions(ends)) for ends in box.values()),
        InitialBox((start,) * len(zero), (start,) * order, None, start, start),
    )


def make_controller(order: int, K: object, h: object, g: object = 1, model: bool = False) -> AgentController:
    """Binomial design polynomials, and for ``model`` the internal model of a constant."""
    gamma = fractions(BINOMIAL[order - 1]) if order > 1 else ()
    observer = fractions(BINOMIAL[order]) if order > 1 else ()
    M, N, psi = (((Fraction(-2),),), (Fraction(3),), (Fraction(2, 3),)) if model else ((), (), ())
    gain = None if order == 1 else Fraction(str(h))
    return AgentController(1, gamma, observer, M, N, psi, Fraction(str(g)), Fraction(str(K)), Fraction(1), gain)


def steady(*z_star: object) -> SteadyState:
    return SteadyState(tuple(map(sympy.sympify, z_star)), sympy.S.Zero, "user")


def condition(
    agent: Agent, controller: AgentController, *z_star: object, at: Fraction | Interval = Fraction(2)
) -> LinearVerdict:
    return necessary_condition(agent, controller, steady(*z_star), at, [UNIT], [v1])


# the matrix


@pytest.mark.parametrize("model", [False, True])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_matrix_is_the_jacobian_of_the_closed_loop(order: int, model: bool) -> None:
    chain = [symbol(f"x{k + 1}") for k in range(order)]
    f = w1 * z1 * chain[0] * chain[-1] + chain[0] ** 3 - v1 * chain[-1] + sympy.sin(z1)
    agent = make_agent(order, f, {z1: -z1 + w1 * x1**2 + v1 * z1}, 2 + w1, {"w1": (1, 2)})
    controller = make_controller(order, 7, 11, 3, model)
    z_star = s * v1 / (1 + w1)

    observer = [symbol(f"o{k + 1}") for k in range(order)] if order > 1 else []
    eta = [symbol("e1")] if model else []
    measured = observer or chain
    g, K, h = sympy.Integer(3), sympy.Integer(7), sympy.Integer(11)
    weights = [*map(sympy.Rational, controller.gamma), 1]
    theta = (
        sum(g ** (order - 1 - k) * weights[k] * measured[k] for k in range(order)) - g ** (order - 1) * weights[0] * s
    )
    u = -K * theta + sum(sympy.Rational(p) * e for p, e in zip(controller.psi, eta, strict=True))
    rates = [agent.zero_dynamics[0], *chain[1:], agent.f + agent.b * u]
    rates += [
        (observer[k + 1] if k + 1 < order else 0)
        + h ** (k + 1) * sympy.Rational(controller.observer[order - 1 - k]) * (chain[0] - observer[0])
        for k in range(len(observer))
    ]
    rates += [-2 * eta[0] + 3 * u] if model else []
    states = [z1, *chain, *observer, *eta]
    at = {z1: z_star, **dict.fromkeys([*chain, *observer, *eta], sympy.S.Zero), x1: s, measured[0]: s}
    expected = sympy.Matrix(rates).jacobian(states).xreplace(at)

    values = {s: sympy.Rational(2), v1: sympy.S.Zero, w1: sympy.Rational(3, 2)}
    slopes = [entry.xreplace(values) for entry in plant_slopes(agent, steady(z_star)).entries]
    found = assemble(agent, controller, fractions(slopes)).at(controller.h)
    assert sympy.Matrix(found) == expected.xreplace(values)


# Hurwitz determinants


@settings(deadline=None)
@given(st.integers(1, 5), st.integers(0, 10**6), st.integers(-30, 10))
def test_determinants_agree_with_the_eigenvalues(n: int, seed: int, shift: int) -> None:
    values = np.random.default_rng(seed).integers(-9, 10, (n, n)) + shift // 3 * np.eye(n, dtype=int)
    A = matrix([[int(entry) for entry in row] for row in values])
    abscissa = max(np.linalg.eigvals(to_float(A)).real)
    minors = hurwitz_determinants(A)
    balls = enclosed_determinants([[to_arb(entry) for entry in row] for row in A])
    assert all(lower(ball) <= minor <= upper(ball) for ball, minor in zip(balls, minors, strict=True))
    if abs(abscissa) > 1e-6:
        assert all(minor > 0 for minor in minors) == (abscissa < 0)
    if any(minor < 0 for minor in minors):
        assert abscissa > -1e-9


def test_a_wide_enclosure_holds_every_determinant() -> None:
    minors = enclosed_determinants([[arb(-1, 0.5), arb(0)], [arb(1), arb(-2)]])
    for corner in (Fraction(-3, 2), Fraction(-1, 2)):
        exact = hurwitz_determinants(matrix([[corner, 0], [1, -2]]))
        assert all(lower(ball) <= minor <= upper(ball) for ball, minor in zip(minors, exact, strict=True))


# the closed formula for the chain of two integrators


@settings(max_examples=60, deadline=None)
@given(st.fractions("1/3", 500), st.fractions("1/2", 9), st.fractions("1/2", 900), st.fractions("1/5", 5))
def test_the_chain_is_stable_exactly_when_the_closed_formula_says_so(
    K: Fraction, g: Fraction, h: Fraction, b: Fraction
) -> None:
    controller = make_controller(2, K, h, g)
    verdict = condition(make_agent(2, b=sympy.Rational(b.numerator, b.denominator)), controller)
    margin = chain_margin(controller, b)
    assert verdict.status == ("passes" if margin > 0 else "refuted" if margin < 0 else "inconclusive")
    assert verdict.smallest_h is not None and verdict.largest_failing_h is not None
    assert chain_margin(replace(controller, h=verdict.smallest_h), b) > 0
    assert chain_margin(replace(controller, h=verdict.largest_failing_h), b) <= 0
    assert verdict.smallest_h <= verdict.largest_failing_h * Fraction(1001, 1000)


def test_on_the_boundary_neither_is_claimed() -> None:
    """``K = 1/2, g = 1, h = 1`` by hand: ``2h³ = K(h + 2)²`` at ``K = 2/9``."""
    controller = make_controller(2, "2/9", 1)
    assert chain_margin(controller, Fraction(1)) == 0
    verdict = condition(make_agent(2), controller)
    assert verdict.status == "inconclusive"
    assert verdict.determinant == 0 and verdict.log10_determinant is None
    assert "neither stable nor unstable for certain" in verdict.reason


def test_the_closed_formula_is_for_second_order_only() -> None:
    with pytest.raises(ValueError, match="two integrators"):
        chain_margin(make_controller(3, 1, 1), Fraction(1))
    with pytest.raises(ValueError, match="two integrators"):
        chain_margin(make_controller(1, 1, 1), Fraction(1))


# the observer gain


@pytest.mark.parametrize("order", [2, 3])
def test_from_the_threshold_on_every_observer_gain_is_stable(order: int) -> None:
    agent, controller = make_agent(order), make_controller(order, 50, 1, 2, model=True)
    slopes = fractions([0] * order + [1])
    loop = assemble(agent, controller, slopes)
    threshold = observer_threshold(loop)
    assert threshold is not None and 0 < threshold.below < threshold.above < threshold.below * Fraction(1001, 1000)
    for factor in (1, Fraction(11, 10), 3, 100, 10**6):
        assert all(minor > 0 for minor in hurwitz_determinants(loop.at(threshold.above * factor)))
    assert any(minor <= 0 for minor in hurwitz_determinants(loop.at(threshold.below * Fraction(99, 100))))


def test_thresholds_at_the_edges() -> None:
    minus, one = matrix([[-1]]), matrix([[1]])
    assert observer_threshold(LoopMatrix((minus, minus))) is not None
    always = observer_threshold(LoopMatrix((minus, minus)))
    assert always is not None and always.above == always.below == 0
    assert observer_threshold(LoopMatrix((minus, one))) is None
    assert observer_threshold(LoopMatrix((matrix([[0]]), matrix([[0]])))) is None
    two = observer_threshold(LoopMatrix((matrix([[2]]), minus)))
    assert two is not None and two.below <= 2 < two.above


def test_no_observer_gain_helps_a_feedback_that_is_too_weak() -> None:
    verdict = condition(make_agent(2, 100 * x2), make_controller(2, 10, 1000))
    assert verdict.status == "refuted"
    assert verdict.smallest_h is None
    assert verdict.reason.endswith("; no h is enough while the other gains are kept")


def test_an_agent_of_order_one_has_no_observer() -> None:
    stable = condition(make_agent(1, w1 * x1, box={"w1": (-1, 3)}), make_controller(1, 4, None))
    assert (stable.status, stable.smallest_h) == ("passes", None)
    refuted = condition(make_agent(1, w1 * x1, box={"w1": (-1, 5)}), make_controller(1, 4, None))
    assert refuted.status == "refuted"
    assert refuted.vertex == (("w1", Fraction(5)),)
    assert (refuted.determinant_index, refuted.determinant) == (1, Fraction(-1))
    assert "w1 = 5" in refuted.reason


# the example


@cache
def example() -> Derivation:
    return derive(load_plant(EXAMPLE), sympy.Integer(2))


@cache
def example_box() -> tuple[tuple[Interval, ...], tuple[sympy.Symbol, ...]]:
    exosystem = load_plant(EXAMPLE).exosystem
    bounds = exosystem_bounds(exosystem)
    assert isinstance(bounds, ExosystemBounds)
    return bounds.sharp, exosystem.states


def example_verdict(index: int, K: int, g: int, h: int) -> LinearVerdict:
    derived = example().agents[index]
    model = derived.internal_model
    assert isinstance(model, InternalModel)
    gains = (Fraction(g), Fraction(K), Fraction(1000), Fraction(h))
    controller = AgentController(
        derived.id, derived.design.gamma, derived.design.observer, model.M, model.N, model.psi, *gains
    )
    assert isinstance(derived.steady_state, SteadyState)
    return necessary_condition(
        derived.agent, controller, derived.steady_state, Optimum(Fraction(2), TWO), *example_box()
    )


@pytest.mark.parametrize("g", [1, 5])
@pytest.mark.parametrize("index", range(5))
def test_the_published_gains_are_refuted_for_every_agent(index: int, g: int) -> None:
    verdict = example_verdict(index, 40000, g, 100)
    assert verdict.status == "refuted"
    assert verdict.determinant is not None and verdict.determinant < 0
    assert verdict.smallest_h is not None and verdict.largest_failing_h is not None
    low, high = (20000, 20200) if index < 2 else (45000, 45100)
    assert low < verdict.largest_failing_h < verdict.smallest_h < high
    assert "the steady state is unstable at p1 = " in verdict.reason
    assert f"h of about {scientific(verdict.smallest_h, 4)}" in verdict.reason
    box = dict(
        zip(
            map(str, example().agents[index].agent.parameters), example().agents[index].agent.parameter_box, strict=True
        )
    )
    assert verdict.vertex is not None
    assert all(value in (box[name].lo, box[name].hi) for name, value in verdict.vertex if name in box)
    if index < 2:
        form = verdict.growing_form
        assert form is not None and quadratic_form(form.P, form.direction) == form.value > 0
        assert len(form.vertices) == 2
        for A in form.vertices:
            assert isinstance(prove_positive_definite(lyapunov_form(A, form.P)), PositiveDefinite)
    else:
        assert verdict.growing_form is None


@pytest.mark.parametrize("index", range(5))
def test_a_faster_observer_passes_and_gains_that_converge_in_simulations_pass(index: int) -> None:
    for K, g, h in ((40000, 1, 45100), (100, 5, 500)):
        verdict = example_verdict(index, K, g, h)
        assert verdict.status == "passes"
        assert "necessary condition only" in verdict.reason
        assert verdict.vertex is None


def test_a_frozen_instability_near_the_threshold_is_not_called_a_refutation() -> None:
    verdict = example_verdict(0, 40000, 1, 20100)
    assert verdict.status == "inconclusive"
    assert "but v(t) moves" in verdict.reason and "frozen" in verdict.reason
    assert verdict.determinant is not None and verdict.determinant < 0


# time-varying loops, enclosures, bad input


def test_a_loop_that_moves_with_the_exosystem_is_refuted_only_by_a_growing_form() -> None:
    def verdict(size: int) -> LinearVerdict:
        return condition(make_agent(1, size * v1 * x1 - 5 * x1), make_controller(1, 1, None))

    assert verdict(5).status == "passes"
    assert verdict(7).status == "inconclusive"
    always = condition(make_agent(1, (v1 + 3) * x1), make_controller(1, 1, None))
    assert always.status == "refuted" and always.growing_form is not None
    assert "whatever v(t) is" in always.reason


def test_an_optimum_that_is_only_enclosed_needs_a_certain_sign() -> None:
    agent, controller = make_agent(2, -(x1**3) + sympy.sqrt(2) * x2), make_controller(2, 10, 100)
    thin = Interval(Fraction("1.4142135"), Fraction("1.4142136"))
    assert condition(agent, controller, at=thin).status == "passes"
    unstable = condition(replace(agent, f=20 * x1**3), controller, at=thin)
    assert unstable.status == "refuted"
    assert unstable.smallest_h is None and unstable.determinant is not None and unstable.determinant < 0
    wide = condition(replace(agent, f=20 * x1**3), controller, at=Interval(Fraction(0), Fraction(2)))
    assert wide.status == "inconclusive"
    assert "neither stable nor unstable for certain" in wide.reason
    point = condition(agent, controller, at=Interval(Fraction(1), Fraction(1)))
    assert point.status == "passes"


def test_a_slope_with_a_pole_is_inconclusive() -> None:
    verdict = condition(make_agent(1, x1 / (s - 2 + 0 * x1) + x1 * sympy.log(v1)), make_controller(1, 1, None))
    assert verdict.status == "inconclusive"
    assert "could not be evaluated" in verdict.reason


def test_parameters_that_do_not_matter_are_not_counted_and_too_many_are_refused() -> None:
    names = {f"w{k}": (0, 1) for k in range(1, 13)}
    indifferent = make_agent(1, symbol("w1") * x1, box=names)
    assert condition(indifferent, make_controller(1, 2, None)).status == "passes"
    many = make_agent(1, sum(symbol(name) for name in names) * x1, box=names)
    verdict = condition(many, make_controller(1, 2, None))
    assert verdict.status == "inconclusive" and "12 parameters" in verdict.reason


def test_shapes_and_names_must_match() -> None:
    with pytest.raises(ValueError, match="order 2 is needed"):
        condition(make_agent(2), make_controller(3, 1, 1))
    with pytest.raises(ValueError, match="needs the observer gain"):
        condition(make_agent(2), replace(make_controller(2, 1, 1), h=None))
    with pytest.raises(ValueError, match="one entry per zero state"):
        condition(make_agent(1, 0, {z1: -z1}), make_controller(1, 1, None))
    with pytest.raises(ValueError, match="no interval is given for w2"):
        condition(make_agent(1, w2 * x1), make_controller(1, 1, None))


def test_numbers_of_any_size_can_be_shown() -> None:
    assert [scientific(Fraction(10) ** k) for k in (-400, -3, 0, 5, 400)] == [
        "1.00e-400",
        "0.001",
        "1",
        "100000",
        "1.00e+400",
    ]
    assert scientific(Fraction(-99999), 3) == "-100000" and scientific(Fraction(0)) == "0"
    assert scientific(Fraction("-1.2349e-9"), 4) == "-1.235e-9"
    assert log10_estimate(Fraction(-(10**500), 3)) == pytest.approx(499.5229, abs=1e-3)


# growing forms


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_unstable_matrices_have_a_growing_form_and_no_stable_one_has(n: int) -> None:
    random = np.random.default_rng(n)
    for abscissa in (1.0, 0.1):
        values = random.standard_normal((n, n))
        shifted = values + (abscissa - max(np.linalg.eigvals(values).real)) * np.eye(n)
        A: Matrix = matrix([[Fraction(round(float(entry) * 1000), 1000) for entry in row] for row in shifted])
        proof = prove_instability([A])
        assert isinstance(proof, InstabilityProof)
        assert quadratic_form(proof.P, proof.direction) == proof.value > 0
        assert isinstance(prove_positive_definite(lyapunov_form(A, proof.P)), PositiveDefinite)
        stable = matrix(
            [[entry - (Fraction(3, 2) if i == j else 0) for j, entry in enumerate(row)] for i, row in enumerate(A)]
        )
        refused = prove_instability([stable])
        assert isinstance(refused, Inconclusive) and len(refused.tried) == 2
        assert isinstance(prove_instability([A, stable]), Inconclusive)
