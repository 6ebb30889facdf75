"""Definiteness is decided exactly, every refusal has a witness; eigenvalue and norm bounds are proved and close."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest
import sympy
from counted import at_most
from hypothesis import given, settings
from hypothesis import strategies as st

from certify.inequalities.eigenvalues import largest_eigenvalue_bound, norm_bound, smallest_eigenvalue_bound
from certify.inequalities.exact_psd import (
    NotPositiveDefinite,
    NotPositiveSemidefinite,
    PositiveDefinite,
    PositiveSemidefinite,
    prove_positive_definite,
    prove_positive_semidefinite,
)
from certify.inequalities.matrices import (
    Matrix,
    add,
    block_diagonal,
    congruence,
    diagonal,
    identity,
    inverse,
    kronecker,
    lyapunov_form,
    matrix,
    multiply,
    quadratic_form,
    scale,
    subtract,
    to_float,
    transpose,
)

ENTRIES = st.integers(-4, 4)


def square(n: int) -> st.SearchStrategy[Matrix]:
    return st.lists(st.lists(ENTRIES, min_size=n, max_size=n), min_size=n, max_size=n).map(matrix)


SQUARES = st.integers(1, 5).flatmap(square)


def eigenvalues(A: Matrix) -> np.ndarray:
    return np.linalg.eigvalsh(to_float(A))


@settings(deadline=None)
@given(SQUARES)
def test_symmetric_integer_matrices_are_decided_with_witnesses(A: Matrix) -> None:
    S = add(A, transpose(A))
    minors = [sympy.Matrix([row[:k] for row in S[:k]]).det() for k in range(1, len(S) + 1)]
    strict, weak = prove_positive_definite(S), prove_positive_semidefinite(S)
    assert isinstance(strict, PositiveDefinite) == all(minor > 0 for minor in minors)
    if isinstance(strict, NotPositiveDefinite):
        assert any(strict.witness)
        assert strict.value == quadratic_form(S, strict.witness) <= 0
    if isinstance(weak, NotPositiveSemidefinite):
        assert weak.value == quadratic_form(S, weak.witness) < 0
    else:
        assert min(eigenvalues(S)) >= -1e-9
        assert weak.rank == sympy.Matrix(S).rank()


@settings(deadline=None)
@given(SQUARES)
def test_gram_matrices_are_semidefinite_and_definite_only_with_full_rank(A: Matrix) -> None:
    gram = multiply(transpose(A), A)
    assert isinstance(prove_positive_semidefinite(gram), PositiveSemidefinite)
    full_rank = sympy.Matrix(A).det() != 0
    assert isinstance(prove_positive_definite(gram), PositiveDefinite) == full_rank


def test_the_gram_matrix_that_is_only_semidefinite_is_refused_with_its_kernel() -> None:
    """(x² − y²)² as a Gram matrix in (x², xy, y²): a solver calls it positive definite within its tolerance."""
    gram = matrix([[1, 0, -1], [0, 0, 0], [-1, 0, 1]])
    refused = prove_positive_definite(gram)
    assert isinstance(refused, NotPositiveDefinite)
    assert refused.value == 0 and any(refused.witness)
    assert prove_positive_semidefinite(gram) == PositiveSemidefinite((Fraction(1), Fraction(0), Fraction(0)))


@pytest.mark.parametrize("gap", [Fraction(1, 10**18), Fraction(-1, 10**18)])
def test_a_gap_far_below_floats_decides(gap: Fraction) -> None:
    S = matrix([[1, 1], [1, 1 + gap]])
    assert isinstance(prove_positive_definite(S), PositiveDefinite) == (gap > 0)
    assert isinstance(prove_positive_semidefinite(S), PositiveSemidefinite) == (gap > 0)


def test_a_zero_pivot_with_a_nonzero_column_is_indefinite() -> None:
    refused = prove_positive_semidefinite(matrix([[0, 1], [1, 5]]))
    assert isinstance(refused, NotPositiveSemidefinite)
    assert refused.value == -1


@pytest.mark.parametrize("decide", [prove_positive_definite, prove_positive_semidefinite])
def test_asymmetric_and_ragged_matrices_are_refused(decide: object) -> None:
    assert callable(decide)
    with pytest.raises(ValueError, match="symmetric"):
        decide(matrix([[1, 2], [3, 4]]))
    with pytest.raises(ValueError, match="symmetric"):
        decide(matrix([[1, 2, 3], [2, 1, 1]]))


def test_the_empty_matrix_is_positive_definite() -> None:
    assert prove_positive_definite(()) == PositiveDefinite(())


@pytest.mark.parametrize("denominators", [lambda g: 2**50, lambda g: 10**15, lambda g: g.randint(2**49, 2**50)])
def test_thirty_by_thirty_with_fifty_bit_entries_is_left_to_the_library(denominators: object) -> None:
    assert callable(denominators)
    g = random.Random(3)
    A = matrix([[Fraction(g.randint(-(2**50), 2**50), denominators(g)) for _ in range(30)] for _ in range(30)])
    S = add(add(A, transpose(A)), diagonal([Fraction(60)] * 30))
    with at_most(300_000):
        assert isinstance(prove_positive_definite(S), PositiveDefinite)


def test_long_denominators_do_not_hide_a_negative_direction() -> None:
    g = random.Random(5)
    A = matrix([[Fraction(g.randint(1, 10**15), g.randint(10**14, 10**15)) for _ in range(8)] for _ in range(7)])
    gram = multiply(transpose(A), A)
    assert isinstance(prove_positive_definite(gram), NotPositiveDefinite)
    assert isinstance(prove_positive_semidefinite(gram), PositiveSemidefinite)
    below = subtract(gram, diagonal([Fraction(1, 10**60)] * 8))
    refused = prove_positive_semidefinite(below)
    assert isinstance(refused, NotPositiveSemidefinite) and refused.value < 0


@settings(deadline=None, max_examples=50)
@given(SQUARES, st.integers(-30, 30))
def test_eigenvalue_and_norm_bounds_are_on_the_right_side_and_close(A: Matrix, exponent: int) -> None:
    A = scale(Fraction(10) ** exponent, A)
    S = add(A, transpose(A))
    high, low, norm = largest_eigenvalue_bound(S), smallest_eigenvalue_bound(S), norm_bound(A)
    n, true, size = len(S), eigenvalues(S), float(np.abs(to_float(S)).max())
    assert isinstance(prove_positive_semidefinite(subtract(scale(high, identity(n)), S)), PositiveSemidefinite)
    assert isinstance(prove_positive_semidefinite(subtract(S, scale(low, identity(n)))), PositiveSemidefinite)
    gram = multiply(transpose(A), A)
    assert isinstance(prove_positive_semidefinite(subtract(scale(norm**2, identity(n)), gram)), PositiveSemidefinite)
    assert float(high) <= true[-1] + 1e-3 * abs(true[-1]) + 1e-11 * size
    assert float(low) >= true[0] - 1e-3 * abs(true[0]) - 1e-11 * size
    assert float(norm) <= np.linalg.norm(to_float(A), 2) * (1 + 1e-3)


def test_smallest_eigenvalue_of_a_badly_conditioned_matrix_is_still_tight() -> None:
    hilbert = matrix([[Fraction(1, i + j + 1) for j in range(12)] for i in range(12)])
    bound = smallest_eigenvalue_bound(hilbert)
    assert Fraction("1.0469e-16") < bound < Fraction("1.0480e-16")
    assert isinstance(prove_positive_definite(subtract(hilbert, diagonal([bound] * 12))), PositiveDefinite)


def test_numbers_beyond_floats_have_bounds() -> None:
    huge = scale(Fraction(10) ** 400, matrix([[2, 1], [1, 2]]))
    assert 3 * Fraction(10) ** 400 <= largest_eigenvalue_bound(huge) <= Fraction("3.003") * 10**400
    assert norm_bound(diagonal([Fraction(7), Fraction(-9)])) >= 9


def test_eigenvalue_bounds_need_a_symmetric_matrix() -> None:
    with pytest.raises(ValueError, match="symmetric"):
        largest_eigenvalue_bound(matrix([[0, 1], [0, 0]]))
    with pytest.raises(ValueError, match="not empty"):
        smallest_eigenvalue_bound(())
    assert norm_bound(()) == 0


@settings(deadline=None, max_examples=30)
@given(square(3), square(2), square(3))
def test_matrix_algebra_agrees_with_sympy(A: Matrix, B: Matrix, C: Matrix) -> None:
    a, b, c = (sympy.Matrix(X) for X in (A, B, C))
    assert sympy.Matrix(multiply(A, C, A)) == a * c * a
    assert sympy.Matrix(kronecker(A, B)) == sympy.kronecker_product(a, b)
    assert sympy.Matrix(block_diagonal(A, B)) == sympy.diag(a, b)
    assert sympy.Matrix(congruence(A, C)) == c.T * a * c
    S = add(C, transpose(C))
    assert sympy.Matrix(lyapunov_form(A, S, 3)) == a.T * sympy.Matrix(S) + sympy.Matrix(S) * a + 6 * sympy.Matrix(S)
    if a.det() != 0:
        assert multiply(A, inverse(A)) == identity(3)
    else:
        with pytest.raises(ValueError, match="singular"):
            inverse(A)


@pytest.mark.parametrize("entry", [0.5, True, sympy.Float("0.5"), sympy.sqrt(2), "1/2", None])
def test_only_exact_numbers_enter_a_matrix(entry: object) -> None:
    with pytest.raises(ValueError, match="not an exact rational"):
        matrix([[entry]])


def test_ragged_rows_are_refused() -> None:
    with pytest.raises(ValueError, match="one length"):
        matrix([[1, 2], [3]])


def test_entries_that_stay_long_when_they_are_shortened_are_decided() -> None:
    """``10^-400`` has 1329 bits after the point whatever is done to it."""
    tiny = Fraction(1, 10**400)
    assert isinstance(prove_positive_definite(((tiny,),)), PositiveDefinite)
    assert isinstance(prove_positive_semidefinite(((tiny, tiny), (tiny, tiny))), PositiveSemidefinite)
    assert isinstance(prove_positive_definite(((-tiny,),)), NotPositiveDefinite)
