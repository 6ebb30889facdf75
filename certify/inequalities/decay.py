"""Norms that decay as fast as a condition number allows: ``AᵀP + PA ⪯ −2κP``, ``P ⪰ I`` (theory.md section 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from certify.bounds.rationals import round_down
from certify.inequalities.lyapunov import Inconclusive, LyapunovProof, solve_lyapunov
from certify.inequalities.matrices import Matrix, to_float

_NEAREST = Fraction(99, 100)
_SHORT = 12


def decay_optimal(
    vertices: Sequence[Matrix],
    *,
    condition_limit: Fraction = Fraction(10**6),
    rtol: Fraction = Fraction(1, 50),
) -> LyapunovProof | Inconclusive:
    """The proof with the largest rate ``κ`` found whose ``P`` has a proved condition number within the limit.

    ``κ`` is below the slowest rate of any vertex alone; bisection stops at ``rtol`` of that. A larger limit allows a
    larger rate: near a multiple eigenvalue the condition number grows without bound. ``d/dt ‖x‖_P <= −κ‖x‖_P`` on the
    hull of the vertices. Raises ``ValueError`` as ``solve_lyapunov``.
    """
    best = _attempt(vertices, Fraction(0), condition_limit)
    if isinstance(best, Inconclusive):
        return best
    abscissa = max(float(np.max(np.linalg.eigvals(to_float(A)).real)) for A in vertices)
    if not abscissa < 0:
        return best
    fastest = round_down(Fraction(-abscissa) * _NEAREST, _SHORT)
    last = _attempt(vertices, fastest, condition_limit)
    if isinstance(last, LyapunovProof):
        return last
    low, high = Fraction(0), fastest
    while high - low > rtol * fastest:
        middle = round_down((low + high) / 2, _SHORT)
        attempt = _attempt(vertices, middle, condition_limit)
        if isinstance(attempt, LyapunovProof):
            low, best = middle, attempt
        else:
            high = middle
    return best


def _attempt(vertices: Sequence[Matrix], decay: Fraction, limit: Fraction) -> LyapunovProof | Inconclusive:
    proof = solve_lyapunov(vertices, rhs="zero", decay=decay, objective="condition")
    if isinstance(proof, LyapunovProof) and proof.condition > limit:
        return Inconclusive(f"the condition number is not proved to be at most {limit}")
    return proof
