"""Exact matrices as tuples of rows of ``Fraction``: hashable values; the arithmetic is python-flint's ``fmpq_mat``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypeAlias

import sympy
from flint import fmpq, fmpq_mat

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]
FloatMatrix: TypeAlias = "npt.NDArray[np.float64]"


def matrix(rows: Iterable[Iterable[Any]]) -> Matrix:
    """A matrix from rows of integers, ``Fraction`` or SymPy rationals; ``ValueError`` for floats or ragged rows."""
    result = tuple(tuple(_exact(entry) for entry in row) for row in rows)
    if len({len(row) for row in result}) > 1:
        raise ValueError("the rows of a matrix must have one length")
    return result


def _exact(entry: object) -> Fraction:
    if isinstance(entry, sympy.Rational):
        return Fraction(int(entry.p), int(entry.q))
    if isinstance(entry, (int, Fraction)) and not isinstance(entry, bool):
        return Fraction(entry)
    raise ValueError(f"{entry!r} is not an exact rational number")


def to_flint(A: Matrix) -> fmpq_mat:
    columns = len(A[0]) if A else 0
    return fmpq_mat(len(A), columns, [fmpq(entry.numerator, entry.denominator) for row in A for entry in row])


def from_flint(A: fmpq_mat) -> Matrix:
    return tuple(tuple(Fraction(int(entry.p), int(entry.q)) for entry in row) for row in A.tolist())


def to_float(A: Matrix) -> FloatMatrix:
    """The nearest floats, for estimates and solvers only; raises ``OverflowError`` beyond the range of floats."""
    import numpy as np

    return np.array([[float(entry) for entry in row] for row in A], dtype=np.float64).reshape(shape(A))


def shape(A: Matrix) -> tuple[int, int]:
    return len(A), len(A[0]) if A else 0


def identity(n: int) -> Matrix:
    return diagonal([Fraction(1)] * n)


def diagonal(entries: Sequence[Fraction]) -> Matrix:
    return tuple(
        tuple(entry if i == j else Fraction(0) for j in range(len(entries))) for i, entry in enumerate(entries)
    )


def transpose(A: Matrix) -> Matrix:
    return tuple(zip(*A, strict=True))


def add(A: Matrix, B: Matrix) -> Matrix:
    return tuple(tuple(a + b for a, b in zip(p, q, strict=True)) for p, q in zip(A, B, strict=True))


def subtract(A: Matrix, B: Matrix) -> Matrix:
    return tuple(tuple(a - b for a, b in zip(p, q, strict=True)) for p, q in zip(A, B, strict=True))


def scale(factor: Fraction | int, A: Matrix) -> Matrix:
    return tuple(tuple(factor * entry for entry in row) for row in A)


def multiply(*factors: Matrix) -> Matrix:
    """The product of one or more matrices; raises ``ValueError`` when the shapes do not match."""
    product = to_flint(factors[0])
    for factor in factors[1:]:
        product = product * to_flint(factor)
    return from_flint(product)


def inverse(A: Matrix) -> Matrix:
    """The exact inverse; raises ``ValueError`` for a singular matrix."""
    if not A:
        return ()
    try:
        return from_flint(to_flint(A).inv())
    except ZeroDivisionError:
        raise ValueError("the matrix is singular") from None


def apply(A: Matrix, x: Sequence[Fraction]) -> Row:
    """``A x``."""
    return tuple(sum((a * b for a, b in zip(row, x, strict=True)), Fraction(0)) for row in A)


def quadratic_form(A: Matrix, x: Sequence[Fraction]) -> Fraction:
    """``xᵀ A x``."""
    return sum((a * b for a, b in zip(apply(A, x), x, strict=True)), Fraction(0))


def congruence(A: Matrix, S: Matrix) -> Matrix:
    """``Sᵀ A S``."""
    return multiply(transpose(S), A, S)


def lyapunov_form(A: Matrix, P: Matrix, decay: Fraction | int = 0) -> Matrix:
    """``AᵀP + PA + 2κP`` for a symmetric ``P`` and the decay rate ``κ``."""
    product = multiply(P, A)
    return add(add(product, transpose(product)), scale(2 * decay, P))


def characteristic_polynomial(A: Matrix) -> Row:
    """Coefficients of ``det(λI − A)``, leading one first."""
    coefficients = to_flint(A).charpoly().coeffs()
    return tuple(Fraction(int(entry.p), int(entry.q)) for entry in reversed(coefficients))


def kronecker(A: Matrix, B: Matrix) -> Matrix:
    """``A ⊗ B``."""
    return tuple(tuple(a * b for a in p for b in q) for p in A for q in B)


def block_diagonal(*blocks: Matrix) -> Matrix:
    """Square blocks along the diagonal."""
    size = sum(len(block) for block in blocks)
    rows: list[Row] = []
    for block in blocks:
        left = len(rows)
        rows.extend((Fraction(0),) * left + row + (Fraction(0),) * (size - left - len(block)) for row in block)
    return tuple(rows)


def is_symmetric(A: Matrix) -> bool:
    return all(len(row) == len(A) for row in A) and transpose(A) == A


def largest_entry(A: Matrix) -> Fraction:
    """The largest absolute value of an entry; zero for an empty matrix."""
    return max((abs(entry) for row in A for entry in row), default=Fraction(0))
