"""Lyapunov inequalities: every Hurwitz matrix is certified, no other one is, and what is certified holds exactly."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from certify.inequalities import lyapunov, semidefinite
from certify.inequalities.decay import decay_optimal
from certify.inequalities.exact_psd import (
    PositiveDefinite,
    PositiveSemidefinite,
    prove_positive_definite,
    prove_positive_semidefinite,
)
from certify.inequalities.lyapunov import Inconclusive, LyapunovProof, solve_lyapunov, why_not_lyapunov
from certify.inequalities.matrices import (
    FloatMatrix,
    Matrix,
    add,
    diagonal,
    identity,
    lyapunov_form,
    matrix,
    scale,
    subtract,
    to_float,
)
from certify.inequalities.rounding import power_of_two, round_symmetric, round_vector, roundings
from certify.inequalities.scaling import Scaling, lyapunov_estimate, scalings
from certify.inequalities.vertices import vertex_matrices
from symbolic.plant import Interval, symbol

ROTATION = matrix([[0, 1], [-1, 0]])


def exact(values: FloatMatrix) -> Matrix:
    return matrix([[Fraction(round(float(entry) * 1000), 1000) for entry in row] for row in values])


def random_matrix(n: int, seed: int, abscissa: float) -> Matrix:
    values = np.random.default_rng(seed).standard_normal((n, n))
    return exact(values + (abscissa - max(np.linalg.eigvals(values).real)) * np.eye(n))


def stretched(A: Matrix, exponent: int) -> Matrix:
    """Every second state in units ``10^exponent`` times smaller."""
    factors = tuple(Fraction(10) ** (exponent if i % 2 else 0) for i in range(len(A)))
    return Scaling("test", factors).system(A)


def assert_holds(proof: LyapunovProof) -> None:
    n = len(proof.P)
    assert isinstance(prove_positive_definite(proof.P), PositiveDefinite)
    for A in proof.vertices:
        left = add(lyapunov_form(A, proof.P, proof.decay), proof.rhs)
        assert isinstance(prove_positive_semidefinite(scale(-1, left)), PositiveSemidefinite)
    above = subtract(scale(proof.largest_eigenvalue, identity(n)), proof.P)
    below = subtract(proof.P, scale(proof.smallest_eigenvalue, identity(n)))
    assert isinstance(prove_positive_semidefinite(above), PositiveSemidefinite)
    assert isinstance(prove_positive_semidefinite(below), PositiveSemidefinite)
    assert proof.smallest_eigenvalue > 0


@pytest.mark.parametrize("exponent", [0, 6, -6])
@pytest.mark.parametrize("n", [2, 3, 5, 8])
def test_random_hurwitz_matrices_are_certified_in_any_units(n: int, exponent: int) -> None:
    for seed, abscissa in ((1, -1.0), (2, -0.05)):
        A = stretched(random_matrix(n, seed, abscissa), exponent)
        proof = solve_lyapunov([A])
        assert isinstance(proof, LyapunovProof)
        assert_holds(proof)
        if exponent == 0:
            least = lyapunov_estimate(to_float(A), np.eye(n))
            assert least is not None
            assert float(proof.largest_eigenvalue) <= np.linalg.eigvalsh(least)[-1] * 1.01


@pytest.mark.parametrize("exponent", [0, 6, -6])
@pytest.mark.parametrize("n", [2, 3, 5, 8])
def test_no_other_matrix_is_certified(n: int, exponent: int) -> None:
    for seed, abscissa in ((1, 1.0), (2, 0.01)):
        refused = solve_lyapunov([stretched(random_matrix(n, seed, abscissa), exponent)])
        assert isinstance(refused, Inconclusive)
        assert refused.unstable_vertex == 0
        assert "not Hurwitz at vertex 1" in refused.reason


@pytest.mark.parametrize(
    "A",
    [
        ROTATION,
        matrix([[0]]),
        matrix([[-1, 0], [0, Fraction(1, 10**30)]]),
        matrix([[-1, 10**12], [0, 0]]),
        matrix([[Fraction(-1, 10**9), 10**9], [Fraction(-1, 10**9), Fraction(1, 10**9)]]),
    ],
)
def test_marginal_and_badly_scaled_matrices_are_not_certified(A: Matrix) -> None:
    assert isinstance(solve_lyapunov([A]), Inconclusive)
    assert isinstance(solve_lyapunov([A], rhs="zero", objective="condition"), Inconclusive)


def test_the_candidate_of_a_solver_that_lies_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        lyapunov, "_estimates", lambda *_: iter([("oracle", np.eye(2)), ("oracle", -np.eye(2)), ("oracle", "silent")])
    )
    refused = solve_lyapunov([matrix([[-1, 5], [0, -1]])])
    assert isinstance(refused, Inconclusive)
    assert refused.unstable_vertex is None
    assert any("violated at vertex 1" in line for line in refused.tried)
    assert any("not positive definite" in line for line in refused.tried)
    assert any("silent" in line for line in refused.tried)
    assert refused.tried[-1] in refused.reason


def test_a_failed_solver_leaves_the_equation_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(semidefinite, "solve", lambda *_: semidefinite.Outcome("failed", "solver_error", "no luck"))
    proof = solve_lyapunov([matrix([[-1, 5], [0, -1]])])
    assert isinstance(proof, LyapunovProof)
    assert proof.method.startswith("Lyapunov equation")
    refused = solve_lyapunov([matrix([[-1, 5], [0, -1]]), matrix([[-1, 4], [0, -1]])])
    assert isinstance(refused, Inconclusive)
    assert "no luck" in refused.reason


def test_one_matrix_for_several_vertices() -> None:
    vertices = [exact(np.array([[0, 1], [-2 - p, -3 - q]])) for p in (-0.5, 0.5) for q in (-1, 1)]
    proof = solve_lyapunov(vertices)
    assert isinstance(proof, LyapunovProof)
    assert_holds(proof)
    middle = matrix([[0, 1], [-2, -3]])
    assert why_not_lyapunov([middle], proof.P, proof.rhs) is None


def test_vertices_without_a_common_matrix_are_inconclusive() -> None:
    first, second = matrix([[-1, 10], [0, -1]]), matrix([[-1, 0], [-10, -1]])
    assert isinstance(solve_lyapunov([first]), LyapunovProof)
    assert isinstance(solve_lyapunov([second]), LyapunovProof)
    refused = solve_lyapunov([first, second])
    assert isinstance(refused, Inconclusive)
    assert refused.unstable_vertex is None and len(refused.tried) >= 3


def test_the_unstable_vertex_is_named() -> None:
    refused = solve_lyapunov([matrix([[-1]]), matrix([[Fraction(1, 10)]])])
    assert isinstance(refused, Inconclusive)
    assert refused.unstable_vertex == 1
    assert "vertex 2" in refused.reason


def test_other_right_hand_sides_and_rates() -> None:
    A = random_matrix(3, 5, -1.0)
    R = diagonal([Fraction(1), Fraction(0), Fraction(7)])
    proof = solve_lyapunov([A], rhs=R, decay=Fraction(1, 2))
    assert isinstance(proof, LyapunovProof)
    assert_holds(proof)
    assert proof.rhs == R and proof.decay == Fraction(1, 2)
    refused = solve_lyapunov([A], decay=Fraction(2))
    assert isinstance(refused, Inconclusive) and "A + 2·I is not Hurwitz" in refused.reason


def test_why_not_lyapunov_finds_each_fault() -> None:
    A, rhs = matrix([[-1, 0], [0, -2]]), identity(2)
    assert why_not_lyapunov([A], identity(2), rhs) is None
    assert why_not_lyapunov([A], scale(Fraction(1, 2), identity(2)), rhs) is None
    assert (
        why_not_lyapunov([A], scale(Fraction(499, 1000), identity(2)), rhs) == "the inequality is violated at vertex 1"
    )
    assert why_not_lyapunov([A, ROTATION], identity(2), rhs) == "the inequality is violated at vertex 2"
    assert why_not_lyapunov([A], matrix([[1, 0], [0, 0]]), rhs) == "P is not positive definite"


def test_sizes_must_match() -> None:
    with pytest.raises(ValueError, match="at least one matrix"):
        solve_lyapunov([])
    with pytest.raises(ValueError, match="square matrices of one size"):
        solve_lyapunov([ROTATION, identity(3)])
    with pytest.raises(ValueError, match="symmetric 2×2"):
        solve_lyapunov([ROTATION], rhs=identity(3))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_decay_optimal_norm_is_near_the_slowest_eigenvalue(seed: int) -> None:
    A = random_matrix(3, seed, -0.5)
    proof = decay_optimal([A])
    assert isinstance(proof, LyapunovProof)
    assert_holds(proof)
    slowest = -max(np.linalg.eigvals(to_float(A)).real)
    assert 0.97 * slowest <= float(proof.decay) <= slowest
    assert proof.smallest_eigenvalue >= Fraction(999, 1000)


def test_a_larger_condition_number_buys_a_larger_rate_at_a_multiple_eigenvalue() -> None:
    chain = matrix([[0, 1, 0], [0, 0, 1], [-1, -3, -3]])
    rates = []
    for limit in (100, 10**4, 10**6):
        proof = decay_optimal([chain], condition_limit=Fraction(limit))
        assert isinstance(proof, LyapunovProof)
        assert_holds(proof)
        assert proof.condition <= limit
        rates.append(proof.decay)
    assert rates[0] < rates[1] < rates[2] < 1
    assert rates[2] > Fraction(9, 10)


def test_there_is_no_decaying_norm_for_an_unstable_matrix_or_within_a_condition_number_below_one() -> None:
    assert isinstance(decay_optimal([matrix([[1]])]), Inconclusive)
    refused = decay_optimal([random_matrix(3, 1, -0.5)], condition_limit=Fraction(1))
    assert isinstance(refused, Inconclusive) and "condition number" in refused.reason


def test_vertices_of_a_parameter_box() -> None:
    p, q, r = symbol("p"), symbol("q"), symbol("r")
    box = {
        p: Interval(Fraction(-1), Fraction(2)),
        q: Interval(Fraction(3), Fraction(4)),
        r: Interval(*[Fraction(5)] * 2),
    }
    found = vertex_matrices(sympy.Matrix([[p * q, 1], [r**2, sympy.Rational(1, 3)]]), box)
    third = Fraction(1, 3)
    assert set(found) == {matrix([[pq, 1], [25, third]]) for pq in (-3, -4, 6, 8)}
    with pytest.raises(ValueError, match="not affine in p"):
        vertex_matrices(sympy.Matrix([[p**2]]), box)
    with pytest.raises(ValueError, match="not affine in q"):
        vertex_matrices(sympy.Matrix([[p / q]]), box)
    with pytest.raises(ValueError, match="not rational"):
        vertex_matrices(sympy.Matrix([[sympy.sqrt(r) * p]]), box)
    with pytest.raises(ValueError, match="says nothing about p"):
        vertex_matrices(sympy.Matrix([[p]]), {})


@settings(deadline=None)
@given(st.integers(1, 4), st.integers(4, 40), st.integers(0, 10**6))
def test_rounded_matrices_are_symmetric_short_and_near(n: int, bits: int, seed: int) -> None:
    values = np.random.default_rng(seed).standard_normal((n, n)) * 10.0 ** (seed % 40 - 20)
    rounded = round_symmetric(values, bits)
    assert rounded == tuple(zip(*rounded, strict=True))
    size = np.max(np.abs(values))
    assert np.max(np.abs(to_float(rounded) - (values + values.T) / 2)) <= size * 2.0**-bits
    denominators = {entry.denominator for row in rounded for entry in row}
    assert all(entry & (entry - 1) == 0 for entry in denominators)


def test_more_digits_come_nearer_and_nothing_else_is_rounded() -> None:
    candidates = list(roundings(np.array([[np.pi, 1.0], [1.0, 2.0]])))
    errors = [abs(float(candidate[0][0]) - np.pi) for candidate in candidates]
    assert errors == sorted(errors, reverse=True) and len(candidates) > 3
    assert len(list(roundings(np.eye(2)))) == 1
    assert round_vector([1.0, -0.25], 8) == (Fraction(1), Fraction(-1, 4))
    with pytest.raises(ValueError, match="finite"):
        round_symmetric(np.array([[np.nan]]), 8)
    with pytest.raises(ValueError, match="power of two"):
        power_of_two(0.0)


def test_every_scaling_carries_its_inverse() -> None:
    A = stretched(random_matrix(4, 3, -1.0), 6)
    P = identity(4)
    found = list(scalings([A], identity(4)))
    assert len(found) >= 2
    for item in found:
        assert item.invert(item.form(P)) == P
        left = item.form(lyapunov_form(A, P))
        assert left == lyapunov_form(item.system(A), item.form(P))
