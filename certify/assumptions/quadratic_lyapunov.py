"""A common quadratic Lyapunov function of finitely many matrices, proved exactly (theory.md sections 2, A6, and 4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import sympy
from flint import fmpq, fmpq_mat

from certify.bounds.rationals import round_down
from certify.inequalities.exact_psd import (
    NotPositiveSemidefinite,
    PositiveDefinite,
    prove_positive_definite,
    prove_positive_semidefinite,
)
from certify.inequalities.matrices import (
    Matrix,
    add,
    from_flint,
    identity,
    kronecker,
    largest_entry,
    lyapunov_form,
    scale,
    subtract,
    to_flint,
    to_float,
    transpose,
)
from symbolic.hurwitz import HurwitzTest, hurwitz_test

_SHRINK = (Fraction(999, 1000), Fraction(9, 10), Fraction(1, 2), Fraction(1, 10), Fraction(1, 1000))
_SHORT_BITS = 20


@dataclass(frozen=True)
class QuadraticProof:
    """``V0 = z̄ᵀ P z̄``, ``P ≻ 0``, and ``AᵀP + PA ⪯ −a0 I`` for every given ``A``; ``a0 > 0``."""

    P: Matrix
    a0: Fraction


@dataclass(frozen=True)
class Refutation:
    """``xᵀ(AᵀP + PA)x = value ≥ 0`` for matrix number ``index`` at ``x = witness ≠ 0``."""

    index: int
    witness: tuple[Fraction, ...]
    value: Fraction


def common_lyapunov(matrices: Sequence[Matrix]) -> QuadraticProof | None:
    """The first cheap candidate that is proved: ``½I``, then a solution at the mean matrix; None if neither is.

    A scalar has the exact answer ``P = ½``, ``a0 = −max A``.
    """
    for P in _candidates(matrices):
        found = _proof(P, matrices)
        if found is not None:
            return found
    return None


def solved_lyapunov(matrices: Sequence[Matrix]) -> QuadraticProof | None:
    """The linear matrix inequality over all matrices, solved, rounded and proved (``inequalities.lyapunov``)."""
    from certify.inequalities.lyapunov import LyapunovProof, solve_lyapunov  # cvxpy takes a second to import

    found = solve_lyapunov(matrices)
    return _proof(found.P, matrices) if isinstance(found, LyapunovProof) else None


def _proof(P: Matrix, matrices: Sequence[Matrix]) -> QuadraticProof | None:
    if not isinstance(prove_positive_definite(P), PositiveDefinite):
        return None
    found = decay(P, matrices)
    return QuadraticProof(P, found) if isinstance(found, Fraction) else None


def decay(P: Matrix, matrices: Sequence[Matrix]) -> Fraction | Refutation:
    """A proved ``a0 > 0``, close to the largest (the largest for scalars), with ``AᵀP + PA ⪯ −a0 I`` for all ``A``."""
    size = len(P)
    forms = [scale(-1, lyapunov_form(A, P)) for A in matrices]
    for index, form in enumerate(forms):
        verdict = prove_positive_definite(form)
        if not isinstance(verdict, PositiveDefinite):
            return Refutation(index, verdict.witness, -verdict.value)
    if size == 1:
        return min(form[0][0] for form in forms)
    guess = min(_smallest_eigenvalue(form) for form in forms)
    while True:
        for factor in _SHRINK:
            a0 = round_down(guess * factor, _SHORT_BITS)
            if a0 > 0 and not any(_falls_short(form, a0) for form in forms):
                return a0
        guess /= 10**6


def _falls_short(form: Matrix, a0: Fraction) -> bool:
    return isinstance(
        prove_positive_semidefinite(subtract(form, scale(a0, identity(len(form))))), NotPositiveSemidefinite
    )


def _smallest_eigenvalue(form: Matrix) -> Fraction:
    """An estimate of the smallest eigenvalue of a positive definite matrix; positive."""
    import numpy as np

    size = largest_entry(form)
    estimate = size * Fraction(float(np.linalg.eigvalsh(to_float(scale(1 / size, form)))[0]))
    return max(estimate, size / 10**12)


def _candidates(matrices: Sequence[Matrix]) -> Iterator[Matrix]:
    size = len(matrices[0])
    yield scale(Fraction(1, 2), identity(size))
    if size == 1:
        return
    mean = matrices[0]
    for A in matrices[1:]:
        mean = add(mean, A)
    solution = lyapunov_solution(scale(Fraction(1, len(matrices)), mean))
    if solution is not None:
        yield solution


def lyapunov_solution(A: Matrix) -> Matrix | None:
    """``P`` with ``AᵀP + PA = −I``, rounded to short dyadic entries; None when the equation is singular."""
    size = len(A)
    transposed = transpose(A)
    operator = to_flint(add(kronecker(identity(size), transposed), kronecker(transposed, identity(size))))
    right = fmpq_mat(size * size, 1, [fmpq(-int(k % (size + 1) == 0)) for k in range(size * size)])
    try:
        entries = [row[0] for row in from_flint(operator.solve(right))]
    except ZeroDivisionError:
        return None
    unit = max(abs(entry) for entry in entries) / 2**_SHORT_BITS
    short = [round(entry / unit) * round_down(unit, 2) for entry in entries]
    return tuple(tuple(short[min(i, j) * size + max(i, j)] for j in range(size)) for i in range(size))


def not_hurwitz(A: Matrix) -> HurwitzTest | None:
    """The failed test of the characteristic polynomial; None when every eigenvalue has a negative real part."""
    exact = sympy.Matrix(len(A), len(A), [sympy.Rational(e.numerator, e.denominator) for row in A for e in row])
    coefficients = exact.charpoly().all_coeffs()
    test = hurwitz_test([Fraction(int(c.p), int(c.q)) for c in coefficients])
    return None if test.verdict == "holds" else test
