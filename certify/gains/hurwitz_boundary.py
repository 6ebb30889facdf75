"""Hurwitz determinants: exact, in balls where entries are enclosed, and as polynomials in the observer gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import arb, arb_mat, ctx, fmpq, fmpq_mat, fmpq_poly

from certify.bounds.balls import lower, upper
from certify.bounds.rationals import round_down, round_up
from certify.gains.loop_matrix import LoopMatrix
from certify.inequalities.matrices import Matrix, Row, characteristic_polynomial, to_flint

_PRECISION = 256
_BITS = 16


def hurwitz_determinants(A: Matrix) -> Row:
    """``Δ_1, …, Δ_m`` of the characteristic polynomial ``λ^m + …`` of a square matrix, exact.

    All are positive iff every eigenvalue has a negative real part. If one is negative, some eigenvalue has a positive
    real part: were all of them in the closed left half plane, every ``Δ_k`` would be a limit of positive numbers.
    """
    coefficients = characteristic_polynomial(A)
    m = len(A)
    minors = []
    for k in range(1, m + 1):
        block = fmpq_mat(
            k, k, [fmpq(e.numerator, e.denominator) for e in _hurwitz_entries(coefficients, k, Fraction(0))]
        )
        value = block.det()
        minors.append(Fraction(int(value.p), int(value.q)))
    return tuple(minors)


def enclosed_determinants(A: Sequence[Sequence[arb]]) -> tuple[arb, ...]:
    """The same for a matrix of balls; a ball of the result holds the determinant of every matrix in the enclosure."""
    m = len(A)
    with ctx.workprec(_PRECISION):
        coefficients = list(reversed(arb_mat(m, m, [entry for row in A for entry in row]).charpoly().coeffs()))
        return tuple(arb_mat(k, k, _hurwitz_entries(coefficients, k, arb(0))).det() for k in range(1, m + 1))


def _hurwitz_entries(coefficients: Sequence[Any], k: int, zero: Any) -> list[Any]:
    """Row by row the leading ``k × k`` block of the Hurwitz matrix: ``a_(2j − i + 1)`` at ``(i, j)``, from 0."""
    return [
        coefficients[2 * j - i + 1] if 0 <= 2 * j - i + 1 < len(coefficients) else zero
        for i in range(k)
        for j in range(k)
    ]


@dataclass(frozen=True)
class Threshold:
    """For every ``h >= above`` all Hurwitz determinants are positive; at some ``h >= below`` (close to it) one
    vanishes.

    ``below = 0`` when they are positive for every ``h > 0``; then ``above`` is 0 too.
    """

    below: Fraction
    above: Fraction


def observer_threshold(loop: LoopMatrix) -> Threshold | None:
    """The largest real ``h > 0`` at which a Hurwitz determinant of ``A(h)`` vanishes, bracketed; exact root isolation.

    ``None`` if some determinant is not positive for large ``h``: then no ``h`` is large enough.
    """
    largest: arb | None = None
    for minor in _determinant_polynomials(loop):
        if minor.degree() < 0 or minor.leading_coefficient() <= 0:
            return None
        root = _largest_real_root(minor)
        if root is not None and root > 0 and (largest is None or root.upper() > largest.upper()):
            largest = root
    if largest is None:
        return Threshold(Fraction(0), Fraction(0))
    below, above = round_down(lower(largest), _BITS), round_up(upper(largest) * (1 + Fraction(1, 2**_BITS)), _BITS)
    return Threshold(max(Fraction(0), below), above)


def _largest_real_root(polynomial: fmpq_poly) -> arb | None:
    with ctx.workprec(_PRECISION):
        real = [root.real for root, _ in polynomial.numer().complex_roots() if root.imag.is_zero()]
    return max(real, key=lambda root: upper(root)) if real else None


def _determinant_polynomials(loop: LoopMatrix) -> list[fmpq_poly]:
    """``Δ_1(h), …, Δ_m(h)`` by fraction-free elimination; stops after one that is identically zero."""
    m = len(loop.powers[0])
    coefficients = _characteristic_polynomial(loop)
    entries = _hurwitz_entries(coefficients, m, fmpq_poly())
    rows = [entries[i * m : (i + 1) * m] for i in range(m)]
    minors: list[fmpq_poly] = []
    previous = fmpq_poly([1])
    for k in range(m):
        pivot = rows[k][k]
        minors.append(pivot)
        if pivot.degree() < 0:
            return minors
        for i in range(k + 1, m):
            for j in range(k + 1, m):
                rows[i][j] = (pivot * rows[i][j] - rows[i][k] * rows[k][j]) // previous
        previous = pivot
    return minors


def _characteristic_polynomial(loop: LoopMatrix) -> list[fmpq_poly]:
    """``1, a_1(h), …, a_m(h)`` by the method of Faddeev and LeVerrier over ``Q[h]``."""
    m = len(loop.powers[0])
    powers = [to_flint(power).table() for power in loop.powers]
    A = [[fmpq_poly([power[i][j] for power in powers]) for j in range(m)] for i in range(m)]
    coefficients = [fmpq_poly([1])]
    product = [[fmpq_poly() for _ in range(m)] for _ in range(m)]
    for k in range(1, m + 1):
        for i in range(m):
            product[i][i] += coefficients[-1]
        product = [[_dot(A[i], product, j) for j in range(m)] for i in range(m)]
        trace = sum((product[i][i] for i in range(m)), fmpq_poly())
        coefficients.append(trace * fmpq(-1, k))
    return coefficients


def _dot(row: Sequence[fmpq_poly], columns: Sequence[Sequence[fmpq_poly]], j: int) -> fmpq_poly:
    total = fmpq_poly()
    for entry, other in zip(row, columns, strict=True):
        if entry.degree() >= 0 and other[j].degree() >= 0:
            total += entry * other[j]
    return total
