"""Instability proved by a quadratic form (Chetaev): it grows along every solution and is positive somewhere.

If ``AᵀP + PA ≻ 0`` for every ``A`` in a compact convex set and ``x0ᵀP x0 > 0``, then ``x' = A(t)x`` with ``A(t)`` in
that set is unstable: ``V = xᵀPx`` obeys ``V' >= ε|x|²``, so a solution that starts with ``V > 0``, however near the
origin, leaves. Terms of higher order do not change that near the origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from certify.inequalities import semidefinite
from certify.inequalities.exact_psd import (
    NotPositiveSemidefinite,
    PositiveDefinite,
    prove_positive_definite,
    prove_positive_semidefinite,
)
from certify.inequalities.lyapunov import Inconclusive
from certify.inequalities.matrices import FloatMatrix, Matrix, Row, lyapunov_form, scale, to_float
from certify.inequalities.rounding import roundings
from certify.inequalities.scaling import balanced_states, lyapunov_estimate


@dataclass(frozen=True)
class InstabilityProof:
    """Proved: ``AᵀP + PA ≻ 0`` for every vertex ``A``, and ``value = directionᵀ P direction > 0``."""

    P: Matrix
    vertices: tuple[Matrix, ...]
    direction: Row
    value: Fraction
    method: str


def prove_instability(vertices: Sequence[Matrix]) -> InstabilityProof | Inconclusive:
    """One indefinite or positive form that grows at every vertex, hence on their convex hull; or what was tried."""
    scaling = balanced_states(vertices)
    systems = [to_float(scaling.system(A)) for A in vertices]
    mean = np.mean(systems, axis=0)
    tried: list[str] = []
    for method in ("Lyapunov equation", "LMI"):
        if method == "LMI":
            estimate = _growing_form(systems)
        else:
            solution = lyapunov_estimate(mean, -np.eye(len(mean)))
            estimate = "no solution in floats" if solution is None else solution
        if isinstance(estimate, str):
            tried.append(f"{method}: {estimate}")
            continue
        reason = "no candidate"
        for Q in roundings(estimate):
            P = scaling.invert(Q)
            proof = _prove(vertices, P, method)
            if isinstance(proof, InstabilityProof):
                return proof
            reason = proof
        tried.append(f"{method}: {reason}")
    return Inconclusive(f"no growing quadratic form was found; the last attempt was {tried[-1]}", tuple(tried))


def _prove(vertices: Sequence[Matrix], P: Matrix, method: str) -> InstabilityProof | str:
    for k, A in enumerate(vertices):
        if not isinstance(prove_positive_definite(lyapunov_form(A, P)), PositiveDefinite):
            return f"the form does not grow at vertex {k + 1}"
    positive = prove_positive_semidefinite(scale(-1, P))
    if not isinstance(positive, NotPositiveSemidefinite):
        return "the form is nowhere positive"
    return InstabilityProof(P, tuple(vertices), positive.witness, -positive.value, method)


def _growing_form(systems: Sequence[FloatMatrix]) -> FloatMatrix | str:
    import cvxpy

    n = len(systems[0])
    Q, size, unit = cvxpy.Variable((n, n), symmetric=True), cvxpy.Variable(), np.eye(n)
    constraints = [A.T @ Q + Q @ A >> unit for A in systems] + [Q << size * unit, Q >> -size * unit]
    outcome = semidefinite.solve(cvxpy.Problem(cvxpy.Minimize(size), constraints))
    return np.asarray(Q.value, dtype=np.float64) if outcome.has_values else outcome.reason
