"""One matrix inequality for the coordinator with every admissible damping ``D(t)`` (docs/certificate.md section 2).

A diagonal multiplier stands for all ``2^N`` vertices of the damping box. The solver proposes ``P``; exact arithmetic
decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from certify.bounds.balls import lower, upper
from certify.bounds.rationals import round_down, round_up
from certify.coordinator.envelope import Comparison
from certify.coordinator.mixing import Mixing, Rows
from certify.coordinator.nominal import CoordinatorModel
from certify.inequalities.exact_psd import (
    PositiveDefinite,
    PositiveSemidefinite,
    prove_positive_definite,
    prove_positive_semidefinite,
)
from certify.inequalities.matrices import transpose
from certify.inequalities.rounding import round_symmetric
from certify.inequalities.semidefinite import solve
from symbolic.plant import Interval

_FORTIETHS = (80, 60, 40, 32, 28, 24, 20, 16, 12, 8, 6, 4, 3, 2, 1)
RATES = (*(Fraction(k, 40) for k in _FORTIETHS), Fraction(1, 100), Fraction(1, 1000))
MARGINS = (1e-6, 1e-5, 1e-7, 1e-4)
DIGITS = (24, 32, 48)
DAMPING_BITS = 20
NEARLY = Fraction(127, 128)  # the checker's box of D is another one where curvatures are enclosed, not known


@dataclass(frozen=True)
class Unstable:
    """No Lyapunov matrix was proved for this pair ``α1, α2``; nothing is said about stability itself."""

    reason: str
    tried: int


def damping_ranges(mixing: Mixing, curvatures: Sequence[Interval]) -> tuple[Interval, ...]:
    """``[ϖ_i/ξ_i^max, l_i/ξ_i^min]``, rounded outward to short rationals."""
    return tuple(
        Interval(round_down(slope.lo / upper(high), DAMPING_BITS), round_up(slope.hi / lower(low), DAMPING_BITS))
        for slope, low, high in zip(curvatures, mixing.smallest, mixing.largest, strict=True)
    )


def stabilise(
    model: CoordinatorModel, damping: tuple[Interval, ...], mixing_rate: Fraction, rates: Sequence[Fraction] = RATES
) -> Comparison | Unstable:
    """The largest rate on the grid ``rates`` (descending) for which a Lyapunov matrix is found and proved;
    ``mixing_rate`` is passed on."""
    first, last = 0, len(rates)
    best: Comparison | None = None
    tried = 0
    while first < last:
        middle = (first + last) // 2
        tried += 1
        attempt = _at_rate(model, damping, mixing_rate, rates[middle])
        if attempt is None:
            first = middle + 1
        else:
            best, last = attempt, middle
    if best is None:
        return Unstable(f"no Lyapunov matrix was found for α1 = {model.alpha1}, α2 = {model.alpha2}", tried)
    return best


def mixing_rate(laplacian: Rows, r: Sequence[Fraction]) -> Fraction:
    """A rational ``λ̂ > 0`` with ``Rm L + LᵀRm ⪰ 2λ̂(Rm − r rᵀ)``, proved, and within a percent of the best one."""
    size = len(r)
    flow = [[r[i] * laplacian[i][j] + r[j] * laplacian[j][i] for j in range(size)] for i in range(size)]
    spread = [[(r[i] if i == j else Fraction(0)) - r[i] * r[j] for j in range(size)] for i in range(size)]
    guess = Fraction(_smallest_ratio(flow, spread) / 2).limit_denominator(1 << 16)
    for _ in range(64):
        guess = round_down(guess * Fraction(127, 128), 12)
        gap = tuple(tuple(flow[i][j] - 2 * guess * spread[i][j] for j in range(size)) for i in range(size))
        if guess > 0 and isinstance(prove_positive_semidefinite(gap), PositiveSemidefinite):
            return guess
    raise ArithmeticError("no mixing rate was proved: is the digraph strongly connected?")


def _smallest_ratio(flow: list[list[Fraction]], spread: list[list[Fraction]]) -> float:
    """The smallest generalised eigenvalue on the complement of the all-ones vector (an estimate)."""
    size = len(flow)
    if size == 1:
        return 1.0
    basis = np.linalg.svd(np.ones((1, size)))[2][1:].T
    a, b = (basis.T @ np.array(m, dtype=float) @ basis for m in (flow, spread))
    return float(np.min(np.linalg.eigvals(np.linalg.solve(b, a)).real))


def inequality(
    model: CoordinatorModel, damping: Sequence[Interval], P: Rows, multiplier: Sequence[Fraction], rate: Fraction
) -> Rows:
    """The matrix that must be positive semidefinite, exactly."""
    n, size = model.size, 2 * model.size - 1
    _, radius, A = _nominal(model, damping)
    AtP = [[sum((A[m][i] * P[m][j] for m in range(size)), Fraction(0)) for j in range(size)] for i in range(size)]
    rows = []
    for i in range(size):
        row = [
            -(AtP[i][j] + AtP[j][i] + 2 * rate * P[i][j]) - (multiplier[i] if i == j < n else 0) for j in range(size)
        ]
        rows.append(tuple(row + [-P[i][j] * radius[j] for j in range(n)]))
    for i in range(n):
        coupling = [-P[j][i] * radius[i] for j in range(size)]
        rows.append(tuple(coupling + [multiplier[i] if i == j else Fraction(0) for j in range(n)]))
    return tuple(rows)


def _nominal(model: CoordinatorModel, damping: Sequence[Interval]) -> tuple[list[Fraction], list[Fraction], Rows]:
    n, B = model.size, model.integral_basis()
    centre = [(d.lo + d.hi) / 2 for d in damping]
    radius = [(d.hi - d.lo) / 2 for d in damping]
    top = [
        tuple(-model.alpha1 * model.laplacian[i][j] - (centre[i] if i == j else 0) for j in range(n))
        + tuple(-model.alpha2 * entry for entry in B[i])
        for i in range(n)
    ]
    bottom = [
        tuple(model.alpha1 * entry for entry in model.laplacian[i]) + (Fraction(0),) * (n - 1) for i in range(n - 1)
    ]
    return centre, radius, tuple(top + bottom)


def _at_rate(
    model: CoordinatorModel, damping: tuple[Interval, ...], mixing_rate: Fraction, rate: Fraction
) -> Comparison | None:
    for margin in MARGINS:
        solution = _solve(model, damping, float(rate), margin)
        if solution is None:
            return None
        for digits in DIGITS:
            P = round_symmetric(solution[0], digits)
            multiplier = tuple(round_up(Fraction(max(float(m), 0.0)), digits) for m in solution[1])
            if _proved(model, damping, P, multiplier, rate):
                exact = all(cost.curvature is not None for cost in model.costs)
                claimed = rate if exact else NEARLY * rate
                return Comparison(P, multiplier, claimed, mixing_rate, damping)
    return None


def _proved(
    model: CoordinatorModel, damping: Sequence[Interval], P: Rows, multiplier: Sequence[Fraction], rate: Fraction
) -> bool:
    positive = isinstance(prove_positive_definite(P), PositiveDefinite) and transpose(P) == P
    return positive and isinstance(
        prove_positive_definite(inequality(model, damping, P, multiplier, rate)), PositiveDefinite
    )


def _solve(
    model: CoordinatorModel, damping: Sequence[Interval], rate: float, margin: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """The Lyapunov matrix with the best conditioned ``P_yy`` at this rate (a float proposal), or None."""
    import cvxpy as cp

    n, size = model.size, 2 * model.size - 1
    _, radius, nominal = _nominal(model, damping)
    A, G = np.array(nominal, dtype=float), np.zeros((size, n))
    G[:n] = np.diag([float(x) for x in radius])
    F = np.eye(n, size)
    P, m, t = cp.Variable((size, size), symmetric=True), cp.Variable(n, nonneg=True), cp.Variable()
    corner = -(A.T @ P + P @ A + 2 * rate * P + F.T @ cp.diag(m) @ F)
    block = cp.bmat([[corner, -P @ G], [-(P @ G).T, cp.diag(m)]])
    floor = np.diag([1.0] * n + [1e-3] * (n - 1))
    constraints = [block >> margin * np.eye(size + n), P >> floor, P[:n, :n] << t * np.eye(n)]
    outcome = solve(cp.Problem(cp.Minimize(t), constraints))
    if not outcome.has_values:
        return None
    return np.asarray(P.value), np.asarray(m.value)
