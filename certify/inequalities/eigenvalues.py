"""Proved bounds of extreme eigenvalues and norms: a guess in floats, a proof by exact LDLᵀ."""

from __future__ import annotations

from fractions import Fraction

from certify.bounds.rationals import round_down, round_up, sqrt_up
from certify.inequalities.exact_psd import (
    PositiveDefinite,
    PositiveSemidefinite,
    prove_positive_definite,
    prove_positive_semidefinite,
    shorten,
)
from certify.inequalities.matrices import (
    Matrix,
    diagonal,
    inverse,
    is_symmetric,
    largest_entry,
    multiply,
    scale,
    subtract,
    to_float,
    transpose,
)

TOLERANCE = Fraction(1, 1000)
_TINY = Fraction(1, 2**40)
_ILL_CONDITIONED = Fraction(1, 10**6)
_SHORT = 24


def largest_eigenvalue_bound(P: Matrix, rtol: Fraction = TOLERANCE) -> Fraction:
    """A rational ``>= λ_max(P)``, within ``rtol`` of it.

    The tolerance is relative to ``λ_max``, or to 1e-12 of the norm where that is more.

    Raises ``ValueError`` if ``P`` is not symmetric or empty.
    """
    import numpy as np

    if not P or not is_symmetric(P):
        raise ValueError("eigenvalue bounds need a symmetric matrix that is not empty")
    if diagonal([row[i] for i, row in enumerate(P)]) == P:
        return max(row[i] for i, row in enumerate(P))
    P = shorten(P, 1)
    size = largest_entry(P)
    unit = round_up(size, 2)
    guess = unit * Fraction(float(np.linalg.eigvalsh(to_float(scale(1 / unit, P)))[-1]))
    slack = rtol / 4 * max(abs(guess), size * _TINY)
    limit = size * len(P)
    while guess + slack < limit:
        candidate = round_up(guess + slack, _SHORT)
        if isinstance(prove_positive_semidefinite(subtract(diagonal([candidate] * len(P)), P)), PositiveSemidefinite):
            return candidate
        slack *= 2
    return limit


def smallest_eigenvalue_bound(P: Matrix, rtol: Fraction = TOLERANCE) -> Fraction:
    """A rational ``<= λ_min(P)``; tight to ``rtol`` also for positive definite matrices that are badly conditioned."""
    bound = -largest_eigenvalue_bound(scale(-1, P), rtol)
    if bound < largest_entry(P) * _ILL_CONDITIONED and isinstance(prove_positive_definite(P), PositiveDefinite):
        return max(bound, round_down(1 / largest_eigenvalue_bound(inverse(P), rtol)))
    return bound


def norm_bound(A: Matrix, rtol: Fraction = TOLERANCE) -> Fraction:
    """A rational ``>= ‖A‖``, the largest singular value, within ``rtol`` of it; zero for an empty matrix."""
    if not A or not A[0]:
        return Fraction(0)
    gram = multiply(transpose(A), A) if len(A) >= len(A[0]) else multiply(A, transpose(A))
    return round_up(sqrt_up(largest_eigenvalue_bound(gram, rtol)), _SHORT)
