"""Exact linear algebra over Q on lists of rows."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import lcm
from operator import mul
from typing import TypeVar

from certify.checker.verdict import Undecided, spend

Q = TypeVar("Q", int, Fraction)
Row = Sequence[Fraction]
Matrix = Sequence[Row]


def identity(n: int) -> Matrix:
    return [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]


def transpose(A: Matrix) -> Matrix:
    return [list(column) for column in zip(*A, strict=True)]


def product(A: Matrix, B: Matrix) -> Matrix:
    spend(10 * len(A) * len(B) * (len(B[0]) if B else 0))
    (left, p), (right, q) = integers(A), integers(B)
    columns = list(zip(*right, strict=True))
    return [[Fraction(dot(row, column), p * q) for column in columns] for row in left]


def apply(A: Matrix, x: Row) -> list[Fraction]:
    return [dot(row, x) for row in A]


def dot(x: Sequence[Q], y: Sequence[Q]) -> Q:
    if len(x) != len(y):
        raise ValueError("a product of vectors of different lengths")
    return sum(map(mul, x, y))


def combine(a: Fraction | int, A: Matrix, b: Fraction | int, B: Matrix) -> Matrix:
    """``a A + b B``."""
    return [[a * x + b * y for x, y in zip(left, right, strict=True)] for left, right in zip(A, B, strict=True)]


def is_symmetric(A: Matrix) -> bool:
    return all(len(row) == len(A) for row in A) and list(map(list, A)) == transpose(A)


def row_sum_bound(A: Matrix) -> Fraction:
    """``⌈A⌉ = max_j Σ_k |A_jk|``, which is at least the largest eigenvalue of a symmetric matrix."""
    return max((sum((abs(entry) for entry in row), Fraction(0)) for row in A), default=Fraction(0))


def integers(A: Matrix) -> tuple[list[list[int]], int]:
    """Integer entries over one denominator."""
    scale = common_denominator(A)
    return [[entry.numerator * (scale // entry.denominator) for entry in row] for row in A], scale


def common_denominator(A: Matrix) -> int:
    scale = 1
    for row in A:
        for entry in row:
            scale = lcm(scale, entry.denominator)
            spend(1 + (scale.bit_length() // 256) ** 2)
    spend(len(A) ** 2 * (1 + scale.bit_length() // 64))
    return scale


def definiteness(A: Matrix) -> str:
    """``positive``, ``semidefinite`` or ``indefinite``, for a symmetric matrix: the signs of the pivots of LDLᵀ.

    Fraction-free elimination; a zero pivot is allowed only if the rest of its row is zero, and is then left out.
    """
    B, _ = integers(A)
    n, previous, verdict = len(B), 1, "positive"
    for k in range(n):
        pivot = B[k][k]
        spend((n - k) ** 2 * (4 + pivot.bit_length() // 64))
        if pivot < 0 or (pivot == 0 and any(B[k][k:])):
            return "indefinite"
        if pivot == 0:
            verdict = "semidefinite"
            continue
        for i in range(k + 1, n):
            for j in range(i, n):
                B[i][j] = B[j][i] = (pivot * B[i][j] - B[i][k] * B[k][j]) // previous
        previous = pivot
    return verdict


def is_positive_definite(A: Matrix) -> bool:
    return is_symmetric(A) and definiteness(A) == "positive"


def is_nonnegative(A: Matrix) -> bool:
    """``A ⪰ 0``."""
    return is_symmetric(A) and definiteness(A) != "indefinite"


def solve(A: Matrix, B: Matrix) -> Matrix:
    """The ``X`` with ``A X = B``, by fraction-free elimination. Raises ``Undecided`` if ``A`` is singular."""
    n, pivot = len(A), 1
    rows, _ = integers([[*left, *right] for left, right in zip(A, B, strict=True)])
    for k in range(n):
        best = next((i for i in range(k, n) if rows[i][k]), None)
        if best is None:
            raise Undecided("a matrix is singular")
        rows[k], rows[best] = rows[best], rows[k]
        previous, pivot = pivot, rows[k][k]
        spend(n * len(rows[0]) * (10 + (pivot.bit_length() // 64) ** 2))
        for i in range(n):
            if i != k:
                factor = rows[i][k]
                rows[i] = [(pivot * x - factor * y) // previous for x, y in zip(rows[i], rows[k], strict=True)]
    return [[Fraction(entry, pivot) for entry in row[n:]] for row in rows]


def inverse(A: Matrix) -> Matrix:
    return solve(A, identity(len(A)))
