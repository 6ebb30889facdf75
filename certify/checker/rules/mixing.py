"""The graph-balancing layer ``X(t) = e^(−Lt)`` on a grid, in fixed-point integers: ``n`` stands for ``n/2^128``."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, factorial, floor

from certify.checker import linear
from certify.checker.intervals import Interval
from certify.checker.linear import Matrix, dot
from certify.checker.verdict import require

SCALE = 128
UNIT = 1 << SCALE
TERMS = 36  # of the series of e^(−LΔ): 3/36! < 2^−128
ORDER = 6  # of the polynomials in the time within a step


def fixed_up(value: Interval | Fraction) -> int:
    return ceil((value.hi if isinstance(value, Interval) else value) * UNIT)


def fixed_down(value: Interval | Fraction) -> int:
    return floor((value.lo if isinstance(value, Interval) else value) * UNIT)


def point(value: int, error: int = 0) -> Interval:
    """The interval that a fixed-point number and its error in units stand for."""
    return Interval(value - error, value + error, -SCALE)


@dataclass(frozen=True)
class StepOfMixing:
    """All ``ξ_i^i`` on one step: lower bounds, and polynomials in ``σ = τ/Δ ∈ [0, 1]`` within ``error`` units."""

    low: list[int]
    taylor: list[list[int]]
    error: int


class Mixing:
    """``X(t_k)`` for ``k = 0, 1, …``, row-stochastic, every entry within ``error`` units of the entry of ``X``.

    ``terms[j]`` is ``(−LΔ)^j/j!`` within ``j`` units: each term's error is at most one more than the last one's.
    """

    def __init__(self, L: Matrix, step: Fraction) -> None:
        n = self.size = len(L)
        self.norm = linear.row_sum_bound(L) * step
        require(step > 0 and self.norm <= 1, "mixing: Δ > 0, ‖LΔ‖ ≤ 1", norm=self.norm)
        generator, q = linear.integers([[entry * step for entry in row] for row in L])
        self.X = [[UNIT * (i == j) for j in range(n)] for i in range(n)]
        self.error = 0
        self.terms = [self.X]
        for j in range(1, TERMS):
            columns = list(zip(*self.terms[-1], strict=True))
            self.terms.append([[-dot(row, column) // (q * j) for column in columns] for row in generator])
        self.flow = [[sum(term[i][j] for term in self.terms) for j in range(n)] for i in range(n)]
        self.error_of_flow = TERMS * TERMS  # the sum of all j, and less than one unit for the remainder 3/TERMS!
        self.keep = [max(0, fixed_down(1 - L[i][i] * step)) for i in range(n)]
        self.remainder = fixed_up(self.norm ** (ORDER + 1) / factorial(ORDER + 1))

    def advance(self) -> StepOfMixing:
        """One step. ``X ← e^(−LΔ) X``: the rows of the factor sum to 1, so the error so far is not amplified."""
        agents = range(self.size)
        step = StepOfMixing(list(map(self.low_now, agents)), list(map(self.taylor, agents)), self.taylor_error())
        columns = list(zip(*self.X, strict=True))
        self.X = [[dot(row, column) >> SCALE for column in columns] for row in self.flow]
        self.error += 2 * self.size * self.error_of_flow + 1
        return step

    def column(self, i: int) -> list[int]:
        return [row[i] for row in self.X]

    def low_now(self, i: int) -> int:
        """Below ``ξ_i^i`` on the step: a mean of column ``i`` in which entry ``i`` weighs at least ``1 − L_ii Δ``."""
        column, keep = self.column(i), self.keep[i]
        return (keep * column[i] + (UNIT - keep) * min(column) >> SCALE) - self.error - 1

    def low_later(self, i: int) -> int:
        """Below ``ξ_i^i`` from now on: a mean of column ``i``."""
        return min(self.column(i)) - self.error

    def taylor(self, i: int) -> list[int]:
        """``ξ_i^i`` during the step, within ``taylor_error`` units."""
        column = self.column(i)
        return [dot(self.terms[j][i], column) >> SCALE for j in range(ORDER + 1)]

    def taylor_error(self) -> int:
        """Per coefficient the errors of ``X``, of ``terms`` and of rounding; the remainder ``‖LΔ‖^(m+1)/(m+1)!``."""
        return (ORDER + 1) * (self.error + 2 * self.size * ORDER + 1) + self.remainder
