"""The graph-balancing layer ``ξ(t) = e^(−Lt)``: enclosures on a time grid and its limit (docs/certificate.md section
2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import arb, arb_mat, ctx

from certify.bounds.balls import PRECISION, to_arb
from certify.bounds.conversions import ball_power

Rows = tuple[tuple[Fraction, ...], ...]


@dataclass(frozen=True)
class Mixing:
    """Enclosures of the diagonal ``ξ_i^i`` of the row-stochastic matrix ``X(t) = e^(−Lt)``.

    ``matrices[k]`` encloses ``X(t_k)``, ``t_k = k·step``; ``ranges[k][i]`` encloses ``ξ_i^i`` on ``[t_k, t_k + step]``;
    ``smallest``, ``largest`` are its extremes over all ``t >= 0``. ``residual[i] >= |ξ_i^i(t) − r_i| e^(λ̂(t − T0))``
    for ``t >= T0``, where ``λ̂`` is any rate with ``Rm L + LᵀRm ⪰ 2λ̂(Rm − r rᵀ)``.
    """

    step: Fraction
    matrices: tuple[arb_mat, ...]
    ranges: tuple[tuple[tuple[arb, arb], ...], ...]
    smallest: tuple[arb, ...]
    largest: tuple[arb, ...]
    residual: tuple[arb, ...]

    @property
    def steps(self) -> int:
        return len(self.ranges)


def mixing(laplacian: Rows, left_null_vector: Sequence[Fraction], step: Fraction, steps: int) -> Mixing:
    """Enclose ``ξ_i^i`` on ``steps`` steps and beyond. Entries of ``L`` and ``step`` are in matching units of time.

    Within a step ``ξ_i^i`` is a mean of column ``i`` of ``X(t_k)`` that gives entry ``i`` itself at least the weight
    ``e^(−L_ii step) >= 1 − L_ii step``; later, every entry of a column is a mean of the column now.
    """
    size = len(laplacian)
    with ctx.workprec(PRECISION):
        generator = arb_mat([[-to_arb(entry * step) for entry in row] for row in laplacian])
        flow = generator.exp()
        keep = [to_arb(max(Fraction(0), 1 - laplacian[i][i] * step)) for i in range(size)]
        current = arb_mat(size, size, [arb(int(i == j)) for i in range(size) for j in range(size)])
        matrices, ranges = [current], []
        for _ in range(steps):
            columns = _columns(current)
            ranges.append(tuple(_within_step(columns[i], i, keep[i]) for i in range(size)))
            current = flow * current
            matrices.append(current)
        columns = _columns(current)
        last = [(_least(column), _greatest(column)) for column in columns]
        smallest = tuple(_least([row[i][0] for row in ranges] + [last[i][0]]) for i in range(size))
        largest = tuple(_greatest([row[i][1] for row in ranges] + [last[i][1]]) for i in range(size))
        r = [to_arb(entry) for entry in left_null_vector]
        residual = tuple(_norm([(columns[i][j] - r[i], r[j]) for j in range(size)], r[i]) for i in range(size))
    return Mixing(step, tuple(matrices), tuple(ranges), smallest, largest, residual)


def _norm(deviations: Sequence[tuple[arb, arb]], unit: arb) -> arb:
    """An upper bound of ``√(Σ w x²/unit)`` over the pairs ``(x, w)``.

    Once a column has mixed to the last bit its deviations are balls around 0: their squares are taken of upper ends,
    since a ball that reaches below 0 has no root.
    """
    total = sum((weight * ball_power(deviation.abs_upper(), 2) for deviation, weight in deviations), arb(0))
    return (total / unit).upper().sqrt().upper()


def _columns(matrix: arb_mat) -> list[list[arb]]:
    return matrix.transpose().tolist()


def _within_step(column: Sequence[arb], index: int, keep: arb) -> tuple[arb, arb]:
    own = column[index]
    low = keep * own + (1 - keep) * _least(column)
    high = keep * own + (1 - keep) * _greatest(column)
    return _least([own, low]), _greatest([own, high])


def _least(values: Sequence[arb]) -> arb:
    return min(value.lower() for value in values)


def _greatest(values: Sequence[arb]) -> arb:
    return max(value.upper() for value in values)
