"""Linear programs ``min p·x``, ``A x ≥ 1``, ``x ≥ 0`` with few columns and many similar rows, such as majorants make.

The simplex method (Dantzig's rule) on every eighth row, then its dual on what is violated, until nothing is: a fifth
of what a solver for large sparse programs takes. What comes out is checked by whoever asked; nothing rests on it.
"""

from __future__ import annotations

import numpy as np

STRIDE = 8
OPTIMAL = 1e-9
FEASIBLE = 1e-8
SMALLEST_PIVOT = 1e-9
MOST_PIVOTS = 400
ROUNDS = 20
LARGEST_GAP = 1e-4


def least_cover(A: np.ndarray, prices: np.ndarray) -> np.ndarray | None:
    """The cheapest ``x`` of shape ``(n,)`` for ``A`` of shape ``(m, n)``, whose first column is positive.

    ``None`` where rounding errors or cycles keep it from being found: what is returned has a dual solution beside it.
    """
    program = _Dictionary(A, prices)
    lowest = int(A[:, 0].argmin())
    program.add(np.unique(np.append(np.arange(0, len(A), STRIDE), [lowest, len(A) - 1])))
    program.pivot(program.row(lowest), 0)  # the first column alone is feasible
    solved = program.improve()
    for _ in range(ROUNDS):
        if not solved:
            break
        x = program.x()
        slack = A @ x - 1
        beside = np.concatenate([[np.inf], slack, [np.inf]])
        violated = np.flatnonzero((slack < -FEASIBLE) & (slack <= beside[:-2]) & (slack <= beside[2:]))
        if not len(violated):
            return x if program.gap(x) <= LARGEST_GAP * float(prices @ x) else None
        program.add(violated)
        solved = program.repair()
    return None


class _Dictionary:
    """Row 0 holds the cost, the others the basic variables, as affine functions of the non-basic ones (constants last).

    Variable ``k < n`` is ``x_k``, variable ``n + i`` the slack of row ``i``.
    """

    def __init__(self, A: np.ndarray, prices: np.ndarray) -> None:
        self.A, self.prices, self.count = A, prices, len(prices)
        self.entries = np.append(prices, 0.0)[None]
        self.outside = list(range(self.count))
        self.basic: list[int] = []
        self.pivots = 0

    def add(self, rows: np.ndarray) -> None:
        """Slacks of more rows become basic."""
        x = np.zeros((self.count, self.count + 1))
        for place, variable in enumerate(self.outside):
            if variable < self.count:
                x[variable, place] = 1
        for place, variable in enumerate(self.basic):
            if variable < self.count:
                x[variable] = self.entries[place + 1]
        slacks = self.A[rows] @ x
        slacks[:, -1] -= 1
        self.entries = np.vstack([self.entries, slacks])
        self.basic += (rows + self.count).tolist()

    def row(self, index: int) -> int:
        """Where the slack of a row of ``A`` is basic."""
        return self.basic.index(self.count + index) + 1

    def x(self) -> np.ndarray:
        x = np.zeros(self.count)
        for variable, value in zip(self.basic, self.entries[1:, -1].tolist(), strict=True):
            if variable < self.count:
                x[variable] = value
        return x

    def gap(self, x: np.ndarray) -> float:
        """How much cheaper than ``x`` another point of the same size may be, by the dual solution ``y ≥ 0``."""
        slacks = [
            (place, variable - self.count) for place, variable in enumerate(self.outside) if variable >= self.count
        ]
        places, rows = np.array(slacks, dtype=int).reshape(-1, 2).T
        y = np.maximum(self.entries[0, places], 0)
        lacking = np.minimum(self.prices - y @ self.A[rows], 0)
        return float(self.prices @ x - y.sum() - lacking @ x)

    def pivot(self, row: int, column: int) -> None:
        """The basic variable of ``row`` and the non-basic one of ``column`` change places."""
        by = self.entries[row, column]
        exchanged = self.entries[row] / -by
        exchanged[column] = 1 / by
        along = self.entries[:, column, None].copy()
        self.entries[:, column] = 0
        self.entries += along * exchanged
        self.entries[row] = exchanged
        self.basic[row - 1], self.outside[column] = self.outside[column], self.basic[row - 1]
        self.pivots += 1

    def improve(self) -> bool:
        """From a feasible point to the best one."""
        while self.pivots < MOST_PIVOTS:
            column = int(self.entries[0, :-1].argmin())
            if self.entries[0, column] >= -OPTIMAL:
                return True
            row = _first(self.entries[1:, -1], -self.entries[1:, column])
            if row is None:
                return False
            self.pivot(row + 1, column)
        return False

    def repair(self) -> bool:
        """From a point that is too cheap to the best feasible one."""
        while self.pivots < MOST_PIVOTS:
            row = int(self.entries[1:, -1].argmin()) + 1
            if self.entries[row, -1] >= -OPTIMAL:
                return True
            column = _first(self.entries[0, :-1], self.entries[row, :-1])
            if column is None:
                return False
            self.pivot(row, column)
        return False


def _first(left: np.ndarray, speed: np.ndarray) -> int | None:
    """Which of some quantities is used up first; ``None`` if none is."""
    times = np.full(len(left), np.inf)
    np.divide(np.maximum(left, 0), speed, out=times, where=speed > SMALLEST_PIVOT)
    first = int(times.argmin())
    return first if times[first] < np.inf else None
