"""Nonnegativity by sums of squares: exact identities for what is accepted, and no proof of what is false."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from certify.bounds import gram_search
from certify.bounds.gram import Gram
from certify.bounds.sums_of_squares import (
    NonnegativityProof,
    NoProof,
    largest_multiple,
    polynomial,
    prove_nonnegative,
)
from certify.inequalities.exact_psd import PositiveSemidefinite, prove_positive_semidefinite
from symbolic.plant import symbol

X, Y = symbol("x"), symbol("y")


def poly(expression: sympy.Expr) -> sympy.Poly:
    return sympy.Poly(expression, X, Y, domain="QQ")


def is_proof(p: sympy.Poly, found: NonnegativityProof | NoProof, *domain: sympy.Poly) -> bool:
    """The identity and every semidefiniteness, recomputed."""
    if isinstance(found, NoProof):
        return False
    total = polynomial(found.main, p.gens)
    for gram, g in zip(found.multipliers, domain, strict=True):
        total += polynomial(gram, p.gens) * g
    grams = (found.main, *found.multipliers)
    semidefinite = all(
        isinstance(prove_positive_semidefinite(gram.matrix), PositiveSemidefinite) for gram in grams if gram.basis
    )
    return semidefinite and (total - p).is_zero


SUMS = {
    "zero": 0 * X,
    "constant": sympy.Integer(3),
    "quartic": X**4 + X**2,
    "only semidefinite, unique": X**2 - 2 * X + 1,
    "binary quartic": 2 * X**4 + 2 * X**3 * Y - X**2 * Y**2 + 5 * Y**4,
    "mixed degrees": X**2 * Y**2 + X**2 + 1,
    "two squares": (X + Y) ** 2 + (X * Y - 1) ** 2,
    "tiny": (X**4 + X**2 * Y**2 + Y**4) / 10**9,
    "huge": (X**4 + X**2 * Y**2 + Y**4) * 10**9,
    "beyond floats": (X**4 + X**2 * Y**2 + Y**4) * 10**400,
}


@pytest.mark.parametrize("expression", SUMS.values(), ids=SUMS)
def test_sums_of_squares_are_proved(expression: sympy.Expr) -> None:
    assert is_proof(poly(expression), prove_nonnegative(poly(expression)))


NOT_PROVED = {
    "negative square": -(X**2),
    "negative constant": sympy.Integer(-1),
    "odd": X**3,
    "linear": X + 10**6,
    "negative between": X**4 - X**2,
    "barely negative": (X**2 - 1) ** 2 - sympy.Rational(1, 10**12),
    "positive but no sum of squares": X**4 * Y**2 + X**2 * Y**4 - 3 * X**2 * Y**2 + 1,
}


@pytest.mark.parametrize("expression", NOT_PROVED.values(), ids=NOT_PROVED)
def test_what_is_no_sum_of_squares_is_not_proved(expression: sympy.Expr) -> None:
    assert isinstance(prove_nonnegative(poly(expression)), NoProof)


def test_a_domain_makes_the_difference() -> None:
    p, disc = poly(Y**2 * (3 - X**2 - X)), poly(1 - X**2)
    assert isinstance(prove_nonnegative(p), NoProof)
    assert is_proof(p, prove_nonnegative(p, [disc]), disc)
    assert isinstance(prove_nonnegative(poly(Y**2 * (1 - X**2 - X)), [disc]), NoProof)


def test_squares_that_vanish_with_the_polynomial() -> None:
    p, disc = poly(Y**2 * (2 - X**2 + X**4 / 10 + X * Y)) + poly(Y**4), poly(1 - X**2)
    assert is_proof(p, prove_nonnegative(p, [disc], [Y]), disc)
    assert isinstance(prove_nonnegative(p - poly(3 * Y**2), [disc], [Y]), NoProof)
    assert isinstance(prove_nonnegative(poly(Y + 10 * Y**2), [disc], [Y]), NoProof)


def test_largest_multiple_is_an_estimate_of_the_best() -> None:
    estimate = largest_multiple(poly(3 * X**2 + X**4 + Y**2), poly(X**2 + Y**2))
    assert estimate is not None
    assert float(estimate) == pytest.approx(1, rel=1e-5)


@settings(max_examples=25)
@given(st.lists(st.integers(-4, 4), min_size=6, max_size=6), st.integers(1, 5))
def test_a_square_plus_a_margin_is_proved(c: list[int], margin: int) -> None:
    square = (c[0] + c[1] * X + c[2] * Y + c[3] * X**2 + c[4] * X * Y + c[5] * Y**2) ** 2
    p = poly(square + margin * (1 + X**2 + Y**2 + X**4 + Y**4) / 10)
    assert is_proof(p, prove_nonnegative(p))


def test_a_solver_that_lies_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gram_search, "search_gram", lambda target, constraints, bases: [np.eye(len(bases[0]))])
    assert isinstance(prove_nonnegative(poly(X**4 - X**2)), NoProof)


def test_coefficients_must_be_rational() -> None:
    with pytest.raises(ValueError, match="not rational"):
        prove_nonnegative(sympy.Poly(sympy.sqrt(2) * X**2, X, extension=True))


def test_the_empty_gram_matrix_is_zero() -> None:
    assert polynomial(Gram((), ()), (X, Y)).is_zero
