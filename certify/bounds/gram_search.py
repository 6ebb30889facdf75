"""The numerical search for Gram matrices; its results are floats and prove nothing (``sums_of_squares`` does).

The coefficients given are of size one; whoever calls has scaled them.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from certify.bounds.gram import Coefficients, Monomial
from certify.inequalities.semidefinite import solve

if TYPE_CHECKING:
    import cvxpy

_LARGEST_MULTIPLE = 1e6
_NEGLIGIBLE = 1e-6


def search_gram(
    target: Coefficients, constraints: Sequence[Coefficients], bases: Sequence[Sequence[Monomial]]
) -> list[np.ndarray] | str:
    """Gram matrices of the main part and the multipliers, as far inside the cone as they go; or why there are none."""
    import cvxpy

    grams = _gram_variables(bases)
    margin = cvxpy.Variable()
    inside = [gram - margin * np.eye(gram.shape[0]) >> 0 for gram in grams if gram.shape[0]]
    equations = _matching(_floats(target), {}, None, constraints, bases, grams)
    outcome = solve(cvxpy.Problem(cvxpy.Maximize(margin), [*inside, *equations, margin <= 1]))
    if not outcome.has_values:
        return f"no Gram matrix was found: {outcome.reason}"
    if outcome.objective is not None and outcome.objective < -_NEGLIGIBLE:
        return "every Gram matrix the solver sees has a negative eigenvalue: probably not a sum of squares"
    return [np.asarray(gram.value) if gram.shape[0] else np.zeros((0, 0)) for gram in grams]


def search_multiple(
    target: Coefficients,
    subtracted: Coefficients,
    constraints: Sequence[Coefficients],
    bases: Sequence[Sequence[Monomial]],
) -> float | None:
    """An estimate of the largest ``t`` with ``target − t·subtracted`` a sum of squares on the domain."""
    import cvxpy

    grams = _gram_variables(bases)
    multiple = cvxpy.Variable()
    equations = _matching(_floats(target), _floats(subtracted), multiple, constraints, bases, grams)
    cones = [gram >> 0 for gram in grams if gram.shape[0]]
    outcome = solve(cvxpy.Problem(cvxpy.Maximize(multiple), [*cones, *equations, multiple <= _LARGEST_MULTIPLE]))
    return outcome.objective


def _floats(coefficients: Coefficients) -> dict[Monomial, float]:
    return {m: float(c) for m, c in coefficients.items()}


def _gram_variables(bases: Sequence[Sequence[Monomial]]) -> list[cvxpy.Variable]:
    import cvxpy

    return [cvxpy.Variable((len(basis), len(basis)), symmetric=True) for basis in bases]


def _matching(
    target: dict[Monomial, float],
    subtracted: dict[Monomial, float],
    multiple: cvxpy.Variable | None,
    constraints: Sequence[Coefficients],
    bases: Sequence[Sequence[Monomial]],
    grams: Sequence[cvxpy.Variable],
) -> list[cvxpy.Constraint]:
    """One linear equation per monomial of ``main + Σ σ_k g_k = target − multiple·subtracted``."""
    import cvxpy

    weights: dict[Monomial, list[np.ndarray]] = {}
    one: Coefficients = {(0,) * len(next(iter(target or subtracted))): Fraction(1)}
    for index, (basis, factor) in enumerate(zip(bases, (one, *constraints), strict=True)):
        for i, left in enumerate(basis):
            for j, right in enumerate(basis):
                for shift, coefficient in factor.items():
                    monomial = tuple(a + b + c for a, b, c in zip(left, right, shift, strict=True))
                    row = weights.setdefault(monomial, [np.zeros((len(b), len(b))) for b in bases])
                    row[index][i, j] += float(coefficient)
    equations = []
    for monomial in weights.keys() | target.keys() | subtracted.keys():
        parts = weights.get(monomial, [])
        left_side = sum(
            (cvxpy.sum(cvxpy.multiply(w, gram)) for w, gram in zip(parts, grams, strict=False) if w.any()), 0.0
        )
        right_side = target.get(monomial, 0.0)
        if multiple is not None and monomial in subtracted:
            right_side = right_side - multiple * subtracted[monomial]
        equations.append(left_side == right_side)
    return equations
