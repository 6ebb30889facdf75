"""Common quadratic Lyapunov functions: solved in floats, rounded, proved exactly (theory.md section 4).

``AᵀP + PA + 2κP ⪯ −R`` is linear in ``A``, so it holds on the convex hull of the matrices where it is proved, and on a
box of parameters when it is proved at the vertices (``vertices.vertex_matrices``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from certify.bounds.rationals import round_up
from certify.inequalities import semidefinite
from certify.inequalities.eigenvalues import largest_eigenvalue_bound, smallest_eigenvalue_bound
from certify.inequalities.exact_psd import (
    NotPositiveSemidefinite,
    PositiveDefinite,
    prove_positive_definite,
    prove_positive_semidefinite,
)
from certify.inequalities.matrices import (
    FloatMatrix,
    Matrix,
    add,
    characteristic_polynomial,
    identity,
    is_symmetric,
    largest_entry,
    lyapunov_form,
    scale,
    shape,
    to_float,
)
from certify.inequalities.rounding import roundings
from certify.inequalities.scaling import Scaling, lyapunov_estimate, scalings
from symbolic.hurwitz import hurwitz_test

Objective = Literal["min_lambda_max", "condition"]
MARGINS = (1e-4, 1e-2, 1e-1)
_LARGEST_WEIGHT = 1e6
_SHORT = 16


@dataclass(frozen=True)
class LyapunovProof:
    """Proved: ``P ≻ 0``, ``AᵀP + PA + 2κP ⪯ −rhs`` for every vertex ``A``, and the eigenvalue bounds of ``P``."""

    P: Matrix
    decay: Fraction
    rhs: Matrix
    vertices: tuple[Matrix, ...]
    largest_eigenvalue: Fraction
    smallest_eigenvalue: Fraction
    method: str

    @property
    def condition(self) -> Fraction:
        """An upper bound of ``λ_max(P)/λ_min(P)``."""
        return self.largest_eigenvalue / self.smallest_eigenvalue


@dataclass(frozen=True)
class Inconclusive:
    """No proof was found; ``tried`` lists the attempts. ``unstable_vertex`` is set when none exists for that reason."""

    reason: str
    tried: tuple[str, ...] = ()
    unstable_vertex: int | None = None


def why_not_lyapunov(vertices: Sequence[Matrix], P: Matrix, rhs: Matrix, decay: Fraction = Fraction(0)) -> str | None:
    """``None`` if ``P ≻ 0`` and ``AᵀP + PA + 2κP ⪯ −rhs`` hold exactly at every vertex, else what fails."""
    if not isinstance(prove_positive_definite(P), PositiveDefinite):
        return "P is not positive definite"
    for k, A in enumerate(vertices):
        proof = prove_positive_semidefinite(scale(-1, add(lyapunov_form(A, P, decay), rhs)))
        if isinstance(proof, NotPositiveSemidefinite):
            return f"the inequality is violated at vertex {k + 1}"
    return None


def solve_lyapunov(
    vertices: Sequence[Matrix],
    *,
    rhs: Matrix | Literal["identity", "zero"] = "identity",
    decay: Fraction = Fraction(0),
    objective: Objective = "min_lambda_max",
) -> LyapunovProof | Inconclusive:
    """One ``P`` for all vertices with ``AᵀP + PA + 2κP ⪯ −rhs``, proved; ``rhs ⪰ 0``.

    ``min_lambda_max`` asks for the least largest eigenvalue; ``condition`` for the least condition number and is meant
    for ``rhs = "zero"``, where ``P`` is scaled to ``P ⪰ I``. Both are wishes to the solver, in the states it is given.
    Raises ``ValueError`` for matrices that are not square or differ in size.
    """
    n = _common_size(vertices)
    right = {"identity": identity(n), "zero": scale(0, identity(n))}[rhs] if isinstance(rhs, str) else rhs
    if shape(right) != (n, n) or not is_symmetric(right):
        raise ValueError(f"the right-hand side must be a symmetric {n}×{n} matrix")
    for k, A in enumerate(vertices):
        test = hurwitz_test(characteristic_polynomial(add(A, scale(decay, identity(n)))))
        if test.verdict != "holds":
            shifted = "A" if decay == 0 else f"A + {decay}·I"
            return Inconclusive(f"no P exists: {shifted} is not Hurwitz at vertex {k + 1}, {test.reason}", (), k)
    tried: list[str] = []
    for scaling in scalings(vertices, right):
        for margin in MARGINS:
            for method, estimate in _estimates(vertices, right, decay, objective, scaling, margin):
                label = f"{method}, {scaling.name}, margin {margin:g}"
                if isinstance(estimate, str):
                    tried.append(f"{label}: {estimate}")
                    continue
                reason = "no finite numbers"
                for Q in roundings(estimate):
                    P = scaling.invert(Q)
                    failure = why_not_lyapunov(vertices, P, right, decay)
                    if failure is None:
                        return _proof(vertices, P, decay, right, label)
                    reason = failure
                tried.append(f"{label}: {reason}")
    return Inconclusive(f"no P could be proved; the last attempt was {tried[-1]}", tuple(tried))


def _common_size(vertices: Sequence[Matrix]) -> int:
    if not vertices or not vertices[0]:
        raise ValueError("at least one matrix that is not empty is needed")
    n = len(vertices[0])
    if any(shape(A) != (n, n) for A in vertices):
        raise ValueError("the vertices must be square matrices of one size")
    return n


def _proof(vertices: Sequence[Matrix], P: Matrix, decay: Fraction, rhs: Matrix, method: str) -> LyapunovProof:
    if largest_entry(rhs) == 0:
        P = scale(round_up(1 / smallest_eigenvalue_bound(P), _SHORT), P)
    return LyapunovProof(
        P, decay, rhs, tuple(vertices), largest_eigenvalue_bound(P), smallest_eigenvalue_bound(P), method
    )


def _estimates(
    vertices: Sequence[Matrix], rhs: Matrix, decay: Fraction, objective: Objective, scaling: Scaling, margin: float
) -> Iterator[tuple[str, FloatMatrix | str]]:
    """Float candidates in scaled states with a margin, each with the name of its method, or why there is none."""
    import numpy as np

    systems = [to_float(scaling.system(A)) for A in vertices]
    weight = to_float(scaling.form(rhs))
    size = float(np.max(np.abs(weight))) or 1.0
    slack = weight / size + margin * np.eye(len(weight))
    yield "LMI", _scaled(_linear_matrix_inequality(systems, slack, float(decay), objective, scaling), size)
    if len(systems) == 1:
        shifted = systems[0] + float(decay) * np.eye(len(weight))
        solution = lyapunov_estimate(shifted, slack)
        yield "Lyapunov equation", _scaled("no solution in floats" if solution is None else solution, size)


def _scaled(estimate: FloatMatrix | str, size: float) -> FloatMatrix | str:
    return estimate if isinstance(estimate, str) else estimate * size


def _linear_matrix_inequality(
    systems: Sequence[FloatMatrix], slack: FloatMatrix, decay: float, objective: Objective, scaling: Scaling
) -> FloatMatrix | str:
    import cvxpy
    import numpy as np

    n = len(slack)
    Q, level = cvxpy.Variable((n, n), symmetric=True), cvxpy.Variable()
    constraints = [A.T @ Q + Q @ A + 2 * decay * Q + slack << 0 for A in systems]
    if objective == "condition":
        constraints += [Q >> np.eye(n), Q << level * np.eye(n)]
    else:
        squares = np.array([float(factor) ** 2 for factor in scaling.factors])
        constraints.append(Q << level * np.diag(np.minimum(np.max(squares) / squares, _LARGEST_WEIGHT)))
    outcome = semidefinite.solve(cvxpy.Problem(cvxpy.Minimize(level), constraints))
    return np.asarray(Q.value, dtype=np.float64) if outcome.has_values else outcome.reason
