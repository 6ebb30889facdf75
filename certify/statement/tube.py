"""What a certificate of the theorem direct/3 says about one agent, for display (docs/certificate-direct.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any

from certify.statement.exact_numbers import Matrix, Row, exact, exact_matrix, exact_row
from symbolic.plant import Interval


@dataclass(frozen=True)
class Reaching:
    """Phase 1, in which the saturation may be active: ``boxes[k]`` bounds ``z̄, x̄, ϑ, ζ`` on
    ``[grid[k], grid[k+1]]``, where ``ζ = η̄ − N x̄_n/b``. The grid is ``(0,)`` when the saturation is never active."""

    grid: Row
    boxes: Matrix


@dataclass(frozen=True)
class Tube:
    """The boxes over time: ``boxes[k]`` bounds the outputs ``z̄, x̄, ϑ̃, υ`` on ``[grid[k], grid[k+1]]``, ``tail`` what
    comes after, where they decay at ``tail_rate``; ``υ = Ψη̄ − Kϑ̃`` is ``u − u*`` while nothing saturates.

    ``grid[0] = T1`` is the end of ``reaching``; ``ranges[k]`` encloses ``z`` at the end of step ``k`` of both phases,
    as far as known; ``rates`` are those of the kernels' majorants.
    """

    reaching: Reaching
    rates: Row
    grid: Row
    boxes: Matrix
    ranges: tuple[tuple[Interval, ...], ...]
    tail: Row
    tail_rate: Fraction

    @property
    def plant_states(self) -> int:
        """How many outputs there are before ``ϑ̃``: those of ``z̄`` and ``x̄``."""
        return len(self.tail) - 2

    @property
    def later(self) -> Matrix:
        """Every box that holds at some time from ``T1`` on."""
        return (*self.boxes, self.tail)

    def peak(self, output: int) -> Fraction:
        """The largest bound of one output from ``T1`` on."""
        return max(box[output] for box in self.later)

    @cached_property
    def times(self) -> Row:
        """The ends of the steps of both phases, from 0 on."""
        return (*self.reaching.grid, *self.grid[1:])

    @cached_property
    def states(self) -> Matrix:
        """Bounds of ``z̄, x̄`` for all time, one row per step of both phases and the last one for the tail."""
        return tuple(box[: self.plant_states] for box in (*self.reaching.boxes, *self.later))

    def furthest(self, state: int) -> Fraction:
        """The largest bound of one component of ``z̄, x̄`` over all time."""
        return max(box[state] for box in self.states)


def tube(witness: Mapping[str, Any]) -> Tube:
    """Raises ``KeyError``, ``TypeError`` or ``ValueError`` for what is not of the documented shape."""
    phase1, tail = witness["phase1"], witness["tail"]
    found = Tube(
        reaching=Reaching(exact_row(phase1["grid"]), exact_matrix(phase1["boxes"])),
        rates=exact_row(witness["rates"]),
        grid=exact_row(witness["grid"]),
        boxes=exact_matrix(witness["boxes"]),
        ranges=tuple(tuple(Interval(*exact_row(side)) for side in known) for known in witness["ranges"]),
        tail=exact_row(tail["box"]),
        tail_rate=exact(tail["rate"]),
    )
    if not (_fits(found, zeros=len(witness["steady_state"]), internal=len(witness["ell"])) and _follows(found)):
        raise ValueError("the grids and the boxes do not fit")
    return found


def _fits(found: Tube, zeros: int, internal: int) -> bool:
    """Whether the lists have the lengths that an agent with so many zero and internal states asks for."""
    first, reaching = found.plant_states, found.reaching
    steps = len(reaching.boxes) + len(found.boxes)
    return (
        first > zeros
        and bool(found.boxes and found.rates)
        and {len(box) for box in found.boxes} == {first + 2}
        and {len(box) for box in reaching.boxes} <= {first + 1 + internal}
        and len(found.grid) == len(found.boxes) + 1
        and len(reaching.grid) == len(reaching.boxes) + 1
        and len(found.ranges) <= (steps if zeros else 0)
        and {len(known) for known in found.ranges} <= {zeros}
    )


def _follows(found: Tube) -> bool:
    """Whether time begins at 0, increases, and the tube begins where phase 1 ends."""
    times = found.times
    return times[0] == 0 and found.reaching.grid[-1] == found.grid[0] and all(a < b for a, b in pairwise(times))
