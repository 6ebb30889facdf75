"""The graph-balancing layer ``X(t) = e^(−Lt)`` on a grid, in fixed-point integers: ``n`` stands for ``n/2^192``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, factorial, floor
from operator import mul

from certify.checker import linear
from certify.checker.intervals import Interval
from certify.checker.linear import Matrix
from certify.checker.verdict import require

SCALE = 192
UNIT = 1 << SCALE
TERMS = 50  # of the series of e^(−LΔ): 3/50! < 2^−192
ORDER = 4  # of the polynomials in the time within a step


def fixed_up(value: Interval | Fraction) -> int:
    return ceil((value.hi if isinstance(value, Interval) else value) * UNIT)


def fixed_down(value: Interval | Fraction) -> int:
    return floor((value.lo if isinstance(value, Interval) else value) * UNIT)


def point(value: int, error: int = 0) -> Interval:
    """The interval that a fixed-point number and its error in units stand for."""
    return Interval(value - error, value + error, -SCALE)


def dot(x: Sequence[int], y: Sequence[int]) -> int:
    if len(x) != len(y):
        raise ValueError("a product of vectors of different lengths")
    return sum(map(mul, x, y))


@dataclass(frozen=True)
class StepOfMixing:
    """All ``ξ_i^i`` on one step: their ranges, and polynomials in ``σ = τ/Δ ∈ [0, 1]`` within ``error`` units."""

    low: list[int]
    high: list[int]
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
        q = linear.common_denominator([[entry * step for entry in row] for row in L])
        generator = [[int(entry * step * q) for entry in row] for row in L]
        self.X = [[UNIT * (i == j) for j in range(n)] for i in range(n)]
        self.error = 0
        self.terms = [self.X]
        for j in range(1, TERMS):
            columns = list(zip(*self.terms[-1], strict=True))
            self.terms.append([[-dot(row, column) // (q * j) for column in columns] for row in generator])
        self.flow = [[sum(term[i][j] for term in self.terms) for j in range(n)] for i in range(n)]
        self.error_of_flow = TERMS * TERMS  # the sum of all j, and less than one unit for the remainder 3/TERMS!
        self.remainder = fixed_up(self.norm ** (ORDER + 1) / factorial(ORDER + 1))
        self.keep = [max(0, fixed_down(1 - L[i][i] * step)) for i in range(n)]

    def advance(self) -> StepOfMixing:
        """One step. ``X ← e^(−LΔ) X``: the rows of the factor sum to 1, so the error so far is not amplified."""
        low, high = zip(*map(self.range_now, range(self.size)), strict=True)
        step = StepOfMixing(list(low), list(high), list(map(self.taylor, range(self.size))), self.taylor_error())
        columns = list(zip(*self.X, strict=True))
        self.X = [[dot(row, column) >> SCALE for column in columns] for row in self.flow]
        self.error += 2 * self.size * self.error_of_flow + 1
        return step

    def column(self, i: int) -> list[int]:
        return [row[i] for row in self.X]

    def range_now(self, i: int) -> tuple[int, int]:
        """``ξ_i^i`` during the step: a mean of column ``i`` in which entry ``i`` weighs at least ``1 − L_ii Δ``."""
        column, keep, own = self.column(i), self.keep[i], self.X[i][i]
        lo, hi = (keep * own + (UNIT - keep) * end >> SCALE for end in (min(column), max(column)))
        return lo - self.error - 1, hi + self.error + 2

    def range_later(self, i: int) -> tuple[int, int]:
        """``ξ_i^i`` from now on: a mean of column ``i``."""
        column = self.column(i)
        return min(column) - self.error, max(column) + self.error

    def taylor(self, i: int) -> list[int]:
        """``ξ_i^i`` during the step, within ``taylor_error`` units."""
        column = self.column(i)
        return [dot(self.terms[j][i], column) >> SCALE for j in range(ORDER + 1)]

    def taylor_error(self) -> int:
        """Per coefficient the errors of ``X``, of ``terms`` and of rounding; the remainder ``‖LΔ‖^(m+1)/(m+1)!``."""
        return (ORDER + 1) * (self.error + 2 * self.size * ORDER + 1) + self.remainder
