"""Diagonal changes of state for a solver, each with its inverse; exact because the factors are powers of two."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from certify.inequalities.matrices import FloatMatrix, Matrix, to_float
from certify.inequalities.rounding import power_of_two

_LARGEST_LOGARITHM = 400


@dataclass(frozen=True)
class Scaling:
    """The states ``q = E x`` with ``E = diag(factors)``; a form ``Q`` in ``q`` is ``P = E Q E`` in ``x``."""

    name: str
    factors: tuple[Fraction, ...]

    def system(self, A: Matrix) -> Matrix:
        """``E A E⁻¹``."""
        return tuple(
            tuple(self.factors[i] * entry / self.factors[j] for j, entry in enumerate(row)) for i, row in enumerate(A)
        )

    def form(self, P: Matrix) -> Matrix:
        """``Q = E⁻¹ P E⁻¹``."""
        return tuple(
            tuple(entry / (self.factors[i] * self.factors[j]) for j, entry in enumerate(row)) for i, row in enumerate(P)
        )

    def invert(self, Q: Matrix) -> Matrix:
        """``P = E Q E``."""
        return tuple(
            tuple(entry * self.factors[i] * self.factors[j] for j, entry in enumerate(row)) for i, row in enumerate(Q)
        )


def scalings(vertices: Sequence[Matrix], rhs: Matrix) -> Iterator[Scaling]:
    """States as given, then balanced, then such that the Lyapunov solution of the mean vertex has a unit diagonal."""
    n = len(vertices[0])
    given = Scaling("states as given", (Fraction(1),) * n)
    yield given
    seen = {given.factors}
    balanced = balanced_states(vertices)
    for candidate in (balanced, _normalised(vertices, rhs, balanced)):
        if candidate is not None and candidate.factors not in seen:
            seen.add(candidate.factors)
            yield candidate


def balanced_states(vertices: Sequence[Matrix]) -> Scaling:
    """States in which the rows and columns of the matrices have like sizes."""
    import numpy as np
    import scipy.linalg

    size = sum(np.abs(to_float(A)) for A in vertices)
    _, (factors, _) = scipy.linalg.matrix_balance(size, permute=False, separate=True)
    return Scaling("balanced states", tuple(power_of_two(1 / float(factor)) for factor in factors))


def _normalised(vertices: Sequence[Matrix], rhs: Matrix, balanced: Scaling) -> Scaling | None:
    import numpy as np

    mean = np.mean([to_float(balanced.system(A)) for A in vertices], axis=0)
    weight = to_float(balanced.form(rhs))
    Q = lyapunov_estimate(mean, weight + np.eye(len(mean)) * np.max(np.abs(weight)) * 1e-9)
    if Q is None or np.min(np.diag(Q)) <= 0:
        return None
    logarithms = np.log2(np.diag(Q)) / 2
    if np.ptp(logarithms) > _LARGEST_LOGARITHM:
        return None
    return Scaling(
        "states normalised by a Lyapunov solution",
        tuple(factor * power_of_two(float(2**x)) for factor, x in zip(balanced.factors, logarithms, strict=True)),
    )


def lyapunov_estimate(A: FloatMatrix, R: FloatMatrix) -> FloatMatrix | None:
    """The float solution of ``AᵀP + PA = −R``, or ``None`` where there is none."""
    import numpy as np
    import scipy.linalg

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            P = scipy.linalg.solve_continuous_lyapunov(A.T, -R)
    except (np.linalg.LinAlgError, ValueError):
        return None
    return (P + P.T) / 2 if np.all(np.isfinite(P)) else None
