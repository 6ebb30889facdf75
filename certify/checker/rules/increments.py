"""Section 3 of docs/certificate-direct.md: increments of ``f0`` and ``f1`` over a box, by slopes along a path.

``f(z, x) − f(z*, s*, 0 … 0)`` is taken apart along a path on which ``z_1 … z_nz`` move first, then ``x_1 … x_n``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from certify.checker.intervals import Interval, symmetric, total
from certify.checker.plant import Agent
from certify.checker.rules.surroundings import Surroundings, common
from certify.checker.rules.zero_ranges import ZeroRanges
from certify.checker.slopes import ZERO, Path


@dataclass(frozen=True)
class Slopes:
    """Of every ``f0`` in ``(z, x_1)`` and of ``f1`` in ``(z, x)``."""

    f0: list[list[Interval]]
    f1: list[Interval]


class Increments:
    """Of one agent; ``optimum`` and ``w`` enclose ``s*`` and the parameters."""

    def __init__(self, agent: Agent, optimum: Interval, w: Mapping[str, Interval], ranges: ZeroRanges) -> None:
        self.agent, self.optimum, self.w, self.ranges = agent, optimum, w, ranges
        self.f0 = [Path(f0, [*agent.zero_states, "x1"]) for f0 in agent.zero_dynamics]
        self.f1 = Path(agent.f, [*agent.zero_states, *agent.chain])

    def on_step(
        self, step: int, length: Fraction, around: Surroundings, z_bar: Sequence[Interval], x_bar: Sequence[Interval]
    ) -> Slopes:
        """On a step of one of the phases, counted from 0, whose ranges of ``z`` are proved as well."""
        moved = self.box(around, z_bar, x_bar, self.ranges.during(step))
        self.ranges.prove(step, length, moved)
        return self.slopes(around, moved)

    def in_tail(self, around: Surroundings, z_bar: Sequence[Interval], x_bar: Sequence[Interval]) -> Slopes:
        return self.slopes(around, self.box(around, z_bar, x_bar, None))

    def box(
        self,
        around: Surroundings,
        z_bar: Sequence[Interval],
        x_bar: Sequence[Interval],
        ranges: Sequence[Interval] | None,
    ) -> dict[str, Interval]:
        """``v, w, z, x`` with ``|z − z*| ≤ z_bar``, ``|x − (y^r, 0 … 0)| ≤ x_bar`` and ``z`` in the ranges."""
        z = [steady + symmetric(size) for steady, size in zip(around.steady_state, z_bar, strict=True)]
        if ranges is not None:
            z = [common(*pair) for pair in zip(z, ranges, strict=True)]
        x = [symmetric(size) for size in x_bar]
        x[0] = around.y + x[0]
        return {**around.v, **self.w, **dict(zip((*self.agent.zero_states, *self.agent.chain), (*z, *x), strict=True))}

    def slopes(self, around: Surroundings, moved: Mapping[str, Interval]) -> Slopes:
        z, x, steady = self.agent.zero_states, self.agent.chain, around.steady_state
        still = {**moved, **dict(zip(z, steady, strict=True)), **dict.fromkeys(x, ZERO), "x1": self.optimum}
        return Slopes([path.slopes(still, moved) for path in self.f0], self.f1.slopes(still, moved))


def increment(
    slopes: Sequence[Interval],
    shift: Sequence[Interval],
    z_bar: Sequence[Interval],
    x_bar: Sequence[Interval],
    distance: Interval,
) -> Interval:
    """A point above ``|Σ_k (D_k + shift_k) (z̄, x̄)_k + D_1 (y^r − s*)|``, as many ``x̄`` as there are slopes."""
    sizes = [*z_bar, *x_bar][: len(slopes)]
    rest = total((slope + by).magnitude * size for slope, by, size in zip(slopes, shift, sizes, strict=True))
    return (rest + slopes[len(z_bar)].magnitude * distance).upper
