"""Positive definiteness decided exactly: LDLᵀ over Q, with a witness when it fails (theory.md section 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import floor, lcm

from flint import fmpq

from certify.bounds.rationals import round_up
from certify.inequalities.matrices import Matrix, Row, is_symmetric, largest_entry, quadratic_form, to_flint

_LONG = 1024
_SHORT = 128


@dataclass(frozen=True)
class PositiveDefinite:
    """``A ≻ 0``: pivot ``k`` of ``A = L D Lᵀ`` is at least ``pivots[k] > 0``.

    They are equal unless ``A`` has long denominators and was proved through a short ``Ã ⪯ A``; pivots keep that order.
    """

    pivots: Row


@dataclass(frozen=True)
class NotPositiveDefinite:
    """``value = xᵀAx <= 0`` at the nonzero vector ``witness``."""

    witness: Row
    value: Fraction


@dataclass(frozen=True)
class PositiveSemidefinite:
    """``A ⪰ 0``: every pivot is nonnegative and the column below a zero pivot is zero; ``A`` may be singular.

    The pivots are exact, or lower bounds as in ``PositiveDefinite`` when all of them are positive.
    """

    pivots: Row

    @property
    def rank(self) -> int:
        return sum(pivot > 0 for pivot in self.pivots)


@dataclass(frozen=True)
class NotPositiveSemidefinite:
    """``value = xᵀAx < 0`` at the vector ``witness``."""

    witness: Row
    value: Fraction


def prove_positive_definite(A: Matrix) -> PositiveDefinite | NotPositiveDefinite:
    """Decide ``A ≻ 0`` exactly; a matrix that is only semidefinite is refused with a vector of its kernel.

    Raises ``ValueError`` if ``A`` is not symmetric.
    """
    shorter = _shorter_below(A)
    if shorter is not None:
        proof = _definite(shorter)
        if isinstance(proof, PositiveDefinite):
            return proof
    return _definite(A)


def _definite(A: Matrix) -> PositiveDefinite | NotPositiveDefinite:
    """By elimination, however long the entries are."""
    elimination = _Elimination(A)
    for k in range(elimination.size):
        pivot = elimination.schur[k][k]
        if pivot <= 0:
            return NotPositiveDefinite(*elimination.evaluate(elimination.lift({k: fmpq(1)})))
        elimination.step(k)
    return PositiveDefinite(tuple(_fraction(pivot) for pivot in elimination.pivots))


def prove_positive_semidefinite(A: Matrix) -> PositiveSemidefinite | NotPositiveSemidefinite:
    """Decide ``A ⪰ 0`` exactly, singular matrices included. Raises ``ValueError`` if ``A`` is not symmetric."""
    shorter = _shorter_below(A)
    if shorter is not None:
        proof = _definite(shorter)
        if isinstance(proof, PositiveDefinite):
            return PositiveSemidefinite(proof.pivots)
    elimination = _Elimination(A)
    for k in range(elimination.size):
        S = elimination.schur
        if S[k][k] < 0:
            return NotPositiveSemidefinite(*elimination.evaluate(elimination.lift({k: fmpq(1)})))
        if S[k][k] == 0:
            for i in range(k + 1, elimination.size):
                if S[i][k] != 0:
                    vector = elimination.lift({k: -(S[i][i] + 1) / (2 * S[i][k]), i: fmpq(1)})
                    return NotPositiveSemidefinite(*elimination.evaluate(vector))
        elimination.step(k)
    return PositiveSemidefinite(tuple(_fraction(pivot) for pivot in elimination.pivots))


def _shorter_below(A: Matrix) -> Matrix | None:
    """A matrix ``Ã ⪯ A`` with short dyadic entries, or ``None`` when ``A`` is short enough already.

    Rounding moves each entry by at most ``ε``, the matrix by at most ``nε`` in norm; that is taken off the diagonal.
    """
    denominator = 1
    for row in A:
        for entry in row:
            denominator = lcm(denominator, entry.denominator)
            if denominator.bit_length() > _LONG:
                return shorten(A, -1)
    return None


def shorten(A: Matrix, direction: int) -> Matrix:
    """Short dyadic entries and ``A ⪯ Ã`` (``direction = 1``) or ``Ã ⪯ A`` (``direction = -1``)."""
    if not is_symmetric(A):
        raise ValueError("only a symmetric matrix can be shortened from one side")
    size = largest_entry(A)
    if size == 0:
        return A
    step = round_up(size, 2) / 2**_SHORT
    shift = direction * len(A) * step
    return tuple(
        tuple(floor(entry / step) * step + (shift if i == j else 0) for j, entry in enumerate(row))
        for i, row in enumerate(A)
    )


class _Elimination:
    """Symmetric elimination; ``schur`` holds the lower triangle of the Schur complement of the rows taken so far."""

    def __init__(self, A: Matrix) -> None:
        if not is_symmetric(A):
            raise ValueError("only a symmetric matrix can be positive definite")
        self.original = A
        self.size = len(A)
        self.schur: list[list[fmpq]] = to_flint(A).tolist() if A else []
        self.columns: list[list[fmpq]] = []
        self.pivots: list[fmpq] = []

    def step(self, k: int) -> None:
        """Take row ``k``; with a zero pivot its column must be zero."""
        S, pivot = self.schur, self.schur[k][k]
        self.pivots.append(pivot)
        multipliers = [fmpq(0)] * self.size
        self.columns.append(multipliers)
        if pivot == 0:
            return
        for i in range(k + 1, self.size):
            if S[i][k] != 0:
                multipliers[i] = S[i][k] / pivot
        for i in range(k + 1, self.size):
            factor, row = multipliers[i], S[i]
            if factor != 0:
                for j in range(k + 1, i + 1):
                    if S[j][k] != 0:
                        row[j] -= factor * S[j][k]

    def lift(self, part: dict[int, fmpq]) -> list[fmpq]:
        """The vector whose quadratic form in ``A`` is that of ``part`` in the Schur complement."""
        vector = [part.get(i, fmpq(0)) for i in range(self.size)]
        for j in range(len(self.columns) - 1, -1, -1):
            column = self.columns[j]
            vector[j] = -sum((column[i] * vector[i] for i in range(j + 1, self.size)), fmpq(0))
        return vector

    def evaluate(self, vector: Sequence[fmpq]) -> tuple[Row, Fraction]:
        exact = tuple(_fraction(entry) for entry in vector)
        return exact, quadratic_form(self.original, exact)


def _fraction(value: fmpq) -> Fraction:
    return Fraction(int(value.p), int(value.q))
