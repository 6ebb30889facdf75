"""Positive definiteness of a symmetric rational matrix by an integer Cholesky factorisation with exact sums.

Scale to ``Ã = S A S``, ``S`` powers of two, ``Ã_ii < 1``; let ``F = ⌊2^2p Ã⌋`` and factor ``F − (n + 2)2^p I`` with
floored quotients and roots: ``G Gᵀ + R``, where ``0 ≤ R_ij < g_j`` beside the diagonal and ``0 ≤ R_jj ≤ 2 g_j`` on it.
Every ``g_j ≤ 2^p``, so ``‖R‖ ≤ (n + 1)2^p``: if all pivots are positive, ``2^2p Ã ⪰ 2^p − n > 0``.
"""

from __future__ import annotations

from fractions import Fraction
from math import isqrt
from operator import mul

from certify.checker.linear import Matrix
from certify.checker.verdict import spend

BITS = 96  # p: of the pivots; a condition number of 2^80 is still decided for thousands of rows


def is_positive_definite(A: Matrix) -> bool:
    """Whether ``A ≻ 0`` is proved. Nothing is said about a matrix that is nearly singular. Raises ``Undecided``."""
    n = len(A)
    spend(n**3 // 2 + 100 * n**2)
    if any(len(row) != n for row in A) or any(A[i][i] <= 0 for i in range(n)):
        return False
    shifts = [_shift(A[i][i]) for i in range(n)]
    rows: list[list[int]] = []
    for i in range(n):
        if any(A[i][j] != A[j][i] for j in range(i)):
            return False
        rows.append([_scaled(A[i][j], 2 * BITS + shifts[i] + shifts[j]) for j in range(i + 1)])
        rows[i][i] -= (n + 2) << BITS
    return _has_positive_pivots(rows)


def _has_positive_pivots(rows: list[list[int]]) -> bool:
    """Of the lower triangle of ``F − (n + 2)2^p I``, column by column."""
    factor: list[list[int]] = [[] for _ in rows]
    for j, row in enumerate(rows):
        own = factor[j]
        square = row[j] - sum(map(mul, own, own))
        pivot = isqrt(square) if square > 0 else 0
        if pivot == 0:
            return False
        for i in range(j + 1, len(rows)):
            below = factor[i]
            below.append((rows[i][j] - sum(map(mul, below, own))) // pivot)
    return True


def _shift(entry: Fraction) -> int:
    """``k`` with ``2^−5 < entry·4^k < 1``."""
    size = entry.numerator.bit_length() - entry.denominator.bit_length()  # entry < 2^(size + 1)
    return (-size - 1) // 2


def _scaled(entry: Fraction, shift: int) -> int:
    """Floor of ``entry·2^shift``."""
    p, q = entry.numerator, entry.denominator
    return (p << shift) // q if shift >= 0 else p // (q << -shift)
