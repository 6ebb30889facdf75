"""The observer's error in the first phase (section 4 of docs/certificate-direct.md): ``e' = h E3 e + e_n ẋ_n``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor

from flint import arb_mat

from certify.checker import linear
from certify.checker.balls import BITS, above, ball, balls, exact, interval, precision
from certify.checker.intervals import Interval
from certify.checker.linear import Matrix, Row
from certify.checker.rules.loop import observer_matrix
from certify.checker.verdict import Undecided, spend

SMALL = Fraction(1, 1 << 64)
MOST = 16_384


@dataclass(frozen=True)
class Table:
    """``|e^(E3 τ)| ≤ max(bounds[j], rest)`` for ``τ ≥ j·step``, ``≤ rest`` after them; ``area ≥ ∫|e^(E3 τ)| dτ``."""

    step: Fraction
    bounds: Sequence[arb_mat]
    rest: arb_mat
    area: arb_mat


def tabulate(observer: Row) -> Table:
    """From ``E_j = e^(E3 j·step)`` to second order, until it is small. Raises ``Undecided`` if it stays large."""
    with precision(BITS):
        return _tabulate(observer_matrix(observer))


def _tabulate(E3: Matrix) -> Table:
    n, step = len(E3), Fraction(1, 1 << (ceil(4 * linear.row_sum_bound(E3)) - 1).bit_length())
    E, d = balls(exact(E3)), ball(step)
    once, twice, later = E * d, E * E * d**2, (_sizes(E) * d).exp()
    powers, sums = [balls(exact(linear.identity(n))), once.exp()], arb_mat(n, n)
    covers: list[arb_mat] = []
    while not _is_small(value := _sizes(now := powers[len(covers)])):
        if len(covers) == MOST:
            raise Undecided("the observer is too slow")
        spend(500 + 200 * n**2)
        slope, bend = _sizes(once * now), _sizes(twice * now) * later
        covers.append(value + slope + bend / 2)
        sums += (value + slope / 2 + bend / 6) * d
        if len(covers) == len(powers):
            powers.append(powers[len(covers) // 2] * powers[(len(covers) + 1) // 2])  # halves: rounding does not grow
    for j in reversed(range(len(covers) - 1)):
        covers[j] = _larger(covers[j], covers[j + 1])
    return Table(step, covers, _beyond(covers[0]), sums + _beyond(sums))


class Observer:
    """Bounds of ``|e|`` from its start on, for an agent with an observer."""

    def __init__(self, h: Fraction, table: Table, at_start: Sequence[Interval]) -> None:
        self.h, self.table = h, table
        with precision(BITS):
            self.start = arb_mat([[above(size)] for size in at_start])

    def error(self, t: Fraction, acceleration: Interval) -> list[Interval]:
        """``|e_i(t)| ≤ Σ_k (L_j)_ik m_k + Λ_i X2/h`` from ``t`` on, while ``|ẋ_n| ≤ X2`` from the start on."""
        table = self.table
        j = floor(self.h * t / table.step)
        with precision(BITS):
            bound = _larger(table.bounds[j], table.rest) if j < len(table.bounds) else table.rest
            forced = arb_mat([[row[-1]] for row in table.area.tolist()]) * (above(acceleration) / ball(self.h))
            return [interval(size).upper for size in (bound * self.start + forced).entries()]


def _beyond(A: arb_mat) -> arb_mat:
    """``2r·rowsum(A)`` with ``r = 2^−64`` above the norm of the last power: what is to come after the table."""
    return arb_mat([[2 * ball(SMALL) * sum(row[1:], row[0])] * len(row) for row in A.tolist()])


def _is_small(A: arb_mat) -> bool:
    small = ball(SMALL)
    return all(sum(row[1:], row[0]) <= small for row in A.tolist())


def _sizes(A: arb_mat) -> arb_mat:
    return arb_mat([[entry.abs_upper() for entry in row] for row in A.tolist()])


def _larger(A: arb_mat, B: arb_mat) -> arb_mat:
    return arb_mat(
        [
            [a.max(b) for a, b in zip(left, right, strict=True)]
            for left, right in zip(A.tolist(), B.tolist(), strict=True)
        ]
    )
