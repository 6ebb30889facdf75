"""Section 3 of docs/certificate-direct.md: increments of ``f0`` and ``f1`` over a box, coordinate by coordinate.

``f(z, x) − f(z*, s*, 0 … 0)`` is taken apart along a path on which ``x_n`` goes first, then ``x_(n−1), …, x_1``, then
``z``; every part is a partial derivative somewhere on its leg of the path, times the leg.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from certify.checker.certificate import NominalSlopes
from certify.checker.derivatives import gradient
from certify.checker.intervals import Interval, enclose, hull, symmetric, total
from certify.checker.plant import Agent
from certify.checker.rules.surroundings import Surroundings

ZERO = Interval(0, 0)


@dataclass(frozen=True)
class Slopes:
    """Enclosures of the partial derivatives on the legs, of every ``f0`` and of ``f1``."""

    f0_z: list[list[Interval]]
    f0_1: list[Interval]
    f1_z: list[Interval]
    f1_x: list[Interval]


def no_nominal(agent: Agent) -> NominalSlopes:
    nz = len(agent.zero_states)
    return NominalSlopes([[Fraction(0)] * (nz + 1)] * nz, (Fraction(0),) * (nz + agent.order), Fraction(0))


class Increments:
    """Of one agent; ``optimum`` and ``w`` enclose ``s*`` and the parameters."""

    def __init__(self, agent: Agent, optimum: Interval, w: Mapping[str, Interval]) -> None:
        self.agent, self.optimum, self.w = agent, optimum, w

    def slopes(self, around: Surroundings, z_bar: Sequence[Interval], x_bar: Sequence[Interval]) -> Slopes:
        """Over ``|z − z*| ≤ z_bar``, ``|x − (y^r, 0 … 0)| ≤ x_bar``."""
        agent, z_names = self.agent, self.agent.zero_states
        z = [steady + symmetric(size) for steady, size in zip(around.steady_state, z_bar, strict=True)]
        box = {**around.v, **self.w, **dict(zip(z_names, z, strict=True)), **dict.fromkeys(agent.chain, ZERO)}
        box["x1"] = self.optimum
        at_optimum = dict(box)
        box["x1"] = hull(self.optimum, around.y + symmetric(x_bar[0]))
        f0_1 = [gradient(f0, box, ["x1"])["x1"] for f0 in agent.zero_dynamics]
        f1_x = []
        for name, size in zip(agent.chain, x_bar, strict=True):
            if name != "x1":
                box[name] = symmetric(size)
            f1_x.append(gradient(agent.f, box, [name])[name])
        f0_z, f1_z = [], []
        if z_names:
            f0_z = [list(gradient(f0, at_optimum, z_names).values()) for f0 in agent.zero_dynamics]
            f1_z = list(gradient(agent.f, at_optimum, z_names).values())
        return Slopes(f0_z, f0_1, f1_z, f1_x)


def bounds_f0(slopes: Slopes, nominal: NominalSlopes, z_bar: Sequence[Interval], x_bar: Sequence[Interval],
              distance: Interval) -> list[Interval]:
    """Points above ``|f0_k-increment − nominal.f0_k·(z̄, x̄_1)|``."""
    return [(_remainder([*by_z, by_x], slope, [*z_bar, x_bar[0]]) + by_x.magnitude * distance).upper
            for by_z, by_x, slope in zip(slopes.f0_z, slopes.f0_1, nominal.f0, strict=True)]


def bound_f1(slopes: Slopes, nominal: NominalSlopes, z_bar: Sequence[Interval], x_bar: Sequence[Interval],
             distance: Interval) -> Interval:
    """A point above ``|Δf − nominal.f1·(z̄, x̄)|``."""
    rest = _remainder([*slopes.f1_z, *slopes.f1_x], nominal.f1, [*z_bar, *x_bar])
    return (rest + slopes.f1_x[0].magnitude * distance).upper


def _remainder(partials: Sequence[Interval], nominal: Sequence[Fraction], sizes: Sequence[Interval]) -> Interval:
    return total((partial - enclose(slope)).magnitude * size
                 for partial, slope, size in zip(partials, nominal, sizes, strict=True))
