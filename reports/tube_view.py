"""What a certificate of the theorem direct/1 says about one agent, for display (docs/certificate-direct.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

from reports.exact_numbers import Matrix, Row, exact, exact_matrix, exact_row


@dataclass(frozen=True)
class Tube:
    """The boxes over time: ``boxes[k]`` bounds the outputs ``z̄, x̄, ϑ̃, Ψη̄`` on ``[grid[k], grid[k+1]]``, ``tail``
    what comes after, where they decay at ``tail_rate``.

    ``duration`` is ``T1``, the length of phase 1 (0 for order 1); ``rates`` are those of the kernels' majorants.
    """

    duration: Fraction
    observer_rate: Fraction | None
    observer_norm: Matrix
    rates: Row
    grid: Row
    boxes: Matrix
    tail: Row
    tail_rate: Fraction

    def peak(self, output: int) -> Fraction:
        """The largest bound of one output over all boxes."""
        return max(box[output] for box in (*self.boxes, self.tail))

    @property
    def outputs(self) -> int:
        return len(self.tail)


def tube(witness: Mapping[str, Any]) -> Tube:
    """Raises ``KeyError``, ``TypeError`` or ``ValueError`` for what is not of the documented shape."""
    phase1, rate, tail = witness["phase1"], witness["observer_rate"], witness["tail"]
    found = Tube(
        duration=Fraction(0) if phase1 is None else exact(phase1["duration"]),
        observer_rate=None if rate is None else exact(rate),
        observer_norm=exact_matrix(witness["observer_norm"]),
        rates=exact_row(witness["rates"]),
        grid=exact_row(witness["grid"]),
        boxes=exact_matrix(witness["boxes"]),
        tail=exact_row(tail["box"]),
        tail_rate=exact(tail["rate"]),
    )
    shapes = {len(box) for box in found.boxes} <= {found.outputs} and len(found.grid) == len(found.boxes) + 1
    if not (shapes and found.boxes and found.rates and all(a < b for a, b in pairwise(found.grid))):
        raise ValueError("the grid and the boxes do not fit")
    return found
