"""Gram matrices of polynomials, exactly: expanded, rounded to short entries, projected onto given coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from certify.inequalities.exact_psd import PositiveSemidefinite, prove_positive_semidefinite
from certify.inequalities.matrices import FloatMatrix, Matrix

Monomial = tuple[int, ...]
Basis = tuple[Monomial, ...]
Coefficients = dict[Monomial, Fraction]


@dataclass(frozen=True)
class Gram:
    """The polynomial ``m(x)ᵀ G m(x)``, ``G ⪰ 0`` proved; ``basis`` holds the exponents of the monomials ``m``."""

    basis: Basis
    matrix: Matrix


def expansion(gram: Gram) -> Coefficients:
    """The coefficients of ``m(x)ᵀ G m(x)``."""
    total: Coefficients = {}
    for i, left in enumerate(gram.basis):
        for j, right in enumerate(gram.basis):
            monomial = plus(left, right)
            total[monomial] = total.get(monomial, Fraction(0)) + gram.matrix[i][j]
    return {m: c for m, c in total.items() if c}


def plus(left: Monomial, right: Monomial) -> Monomial:
    return tuple(a + b for a, b in zip(left, right, strict=True))


def times(left: Coefficients, right: Coefficients) -> Coefficients:
    total: Coefficients = {}
    for m, c in left.items():
        for n, d in right.items():
            total[plus(m, n)] = total.get(plus(m, n), Fraction(0)) + c * d
    return total


def short_matrix(values: FloatMatrix, bits: int) -> Matrix:
    size = len(values)
    largest = max((abs(float(entry)) for row in values for entry in row), default=0.0)
    if largest == 0:
        return tuple((Fraction(0),) * size for _ in range(size))
    unit = Fraction(2) ** (Fraction(largest).numerator.bit_length() - Fraction(largest).denominator.bit_length() - bits)
    rounded = [[round(Fraction(float(entry)) / unit) * unit for entry in row] for row in values]
    return tuple(tuple((rounded[i][j] + rounded[j][i]) / 2 for j in range(size)) for i in range(size))


def projected(gram: Gram, target: Coefficients) -> Gram | None:
    """The nearest matrix with exactly the target's coefficients: entries that make a monomial share its defect."""
    places: dict[Monomial, list[tuple[int, int]]] = {}
    for i, left in enumerate(gram.basis):
        for j, right in enumerate(gram.basis):
            places.setdefault(plus(left, right), []).append((i, j))
    if any(c and m not in places for m, c in target.items()):
        return None
    entries = [list(row) for row in gram.matrix]
    for monomial, where in places.items():
        defect = target.get(monomial, Fraction(0)) - sum((entries[i][j] for i, j in where), Fraction(0))
        for i, j in where:
            entries[i][j] += defect / len(where)
    projected = Gram(gram.basis, tuple(map(tuple, entries)))
    wanted = {m: c for m, c in target.items() if c}
    return projected if expansion(projected) == wanted else None


def is_semidefinite(gram: Gram) -> bool:
    return not gram.basis or isinstance(prove_positive_semidefinite(gram.matrix), PositiveSemidefinite)
