"""Quadratic forms that a neutrally stable linear system keeps: ``SᵀQ + QS = 0``, ``Q ≻ 0``, exactly."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

from flint import fmpq, fmpq_mat

from certify.inequalities import semidefinite
from certify.inequalities.exact_psd import PositiveDefinite, prove_positive_definite
from certify.inequalities.matrices import (
    Matrix,
    Row,
    add,
    identity,
    largest_entry,
    lyapunov_form,
    scale,
    shape,
    to_float,
)
from certify.inequalities.rounding import PRECISIONS, round_vector

_ASIDE = 1e-3
_LARGEST = 1e4


def invariant_quadratic(S: Matrix, points: Sequence[Row] | None = None, emphasis: int | None = None) -> Matrix | None:
    """A rational ``Q ≻ 0`` with ``SᵀQ + QS = 0``, or ``None`` if none was found; then ``vᵀQv`` stays constant.

    Among all of them (an exact null space) it is chosen so that the ellipsoid through the farthest of the ``points``
    (default: the corners of the unit box) fits a small box, or a box that is thin in the state ``emphasis``. There is
    one iff the eigenvalues of ``S`` are imaginary and semisimple. Raises ``ValueError`` if ``S`` is not square.
    """
    n = len(S)
    if shape(S) != (n, n) or n == 0:
        raise ValueError("S must be a square matrix that is not empty")
    corners = list(product((Fraction(-1), Fraction(1)), repeat=n)) if points is None else list(points)
    return choose_form(invariant_forms(S), corners, emphasis)


def choose_form(basis: Sequence[Matrix], points: Sequence[Row], emphasis: int | None = None) -> Matrix | None:
    """A positive definite combination of the forms, proved, chosen as in ``invariant_quadratic``; or ``None``."""
    if len(basis) == 1:
        candidates = [basis[0], scale(-1, basis[0])]
    else:
        candidates = [_combine(basis, weights) for weights in _weights(basis, points, emphasis)]
    for Q in candidates:
        if isinstance(prove_positive_definite(Q), PositiveDefinite):
            return Q
    return None


def invariant_forms(S: Matrix) -> list[Matrix]:
    """A basis of the symmetric solutions of ``SᵀQ + QS = 0``, exact."""
    n = len(S)
    places = [(i, j) for i in range(n) for j in range(i, n)]
    units = [_unit(n, i, j) for i, j in places]
    columns = [lyapunov_form(S, unit) for unit in units]
    entries = [column[i][j] for i, j in places for column in columns]
    system = fmpq_mat(len(places), len(places), [fmpq(entry.numerator, entry.denominator) for entry in entries])
    reduced, rank = system.rref()
    rows = [[Fraction(int(entry.p), int(entry.q)) for entry in row] for row in reduced.tolist()[:rank]]
    pivots = [next(k for k, entry in enumerate(row) if entry != 0) for row in rows]
    basis = []
    for free in sorted(set(range(len(places))) - set(pivots)):
        form = units[free]
        for row, pivot in zip(rows, pivots, strict=True):
            form = add(form, scale(-row[free], units[pivot]))
        basis.append(form)
    return basis


def _unit(n: int, i: int, j: int) -> Matrix:
    return tuple(tuple(Fraction(int((p, q) in ((i, j), (j, i)))) for q in range(n)) for p in range(n))


def _combine(basis: Sequence[Matrix], weights: Sequence[Fraction]) -> Matrix:
    total = scale(0, basis[0])
    for weight, form in zip(weights, basis, strict=True):
        total = add(total, scale(weight, form))
    return total


def _weights(basis: Sequence[Matrix], points: Sequence[Row], emphasis: int | None) -> list[tuple[Fraction, ...]]:
    """Weights that keep ``Σ_k (Q⁻¹)_kk / size_k²`` small where ``pᵀQp <= 1`` at every point; estimates."""
    import cvxpy
    import numpy as np

    if not basis or not points:
        return []
    n = len(basis[0])
    spread = np.array([float(max(abs(point[k]) for point in points)) for k in range(n)])
    size = np.where(spread > 0, spread, np.max(spread) or 1.0)
    weights, squares = cvxpy.Variable(len(basis)), cvxpy.Variable(n)
    unit = [to_float(form) * np.outer(size, size) / float(largest_entry(form)) for form in basis]
    Q = sum(weights[k] * form for k, form in enumerate(unit))
    columns = to_float(identity(n))
    constraints = [
        cvxpy.bmat([[Q, columns[:, [k]]], [columns[[k], :], cvxpy.reshape(squares[k], (1, 1), order="C")]]) >> 0
        for k in range(n)
    ]
    constraints.append(Q << _LARGEST * columns)
    for point in {tuple(float(x) for x in point) for point in points}:
        scaled = np.array(point) / size
        constraints.append(scaled @ Q @ scaled <= 1)
    importance = np.array([1.0 if emphasis in (None, k) else _ASIDE for k in range(n)])
    outcome = semidefinite.solve(cvxpy.Problem(cvxpy.Minimize(importance @ squares), constraints))
    if not outcome.has_values:
        return []
    found = [float(w) / float(largest_entry(form)) for w, form in zip(weights.value, basis, strict=True)]
    return [round_vector(found, bits) for bits in PRECISIONS]
