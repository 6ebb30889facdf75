"""The set the claim is about as a unit cube: exact points of ``W``, ``V0`` and the box from numbers in [0, 1]."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice, pairwise, product

import numpy as np

from symbolic.controller import AgentController
from symbolic.plant import Agent, Interval, Plant

Point = tuple[Fraction, ...]

_RESOLUTION = 2**20


@dataclass(frozen=True)
class Box:
    """A product of intervals; only those that are no points are coordinates of the cube."""

    sides: tuple[Interval, ...]

    @property
    def free(self) -> tuple[int, ...]:
        return tuple(k for k, side in enumerate(self.sides) if not side.is_point)

    def point(self, cube: Sequence[float]) -> Point:
        """The exact point at ``cube`` in ``[0, 1]^free``, rounded to a grid that contains the corners."""
        values = [side.lo for side in self.sides]
        for k, t in zip(self.free, cube, strict=True):
            side = self.sides[k]
            values[k] = side.lo + (side.hi - side.lo) * Fraction(round(float(t) * _RESOLUTION), _RESOLUTION)
        return tuple(values)

    def corners(self, limit: int, generator: np.random.Generator) -> list[tuple[float, ...]]:
        """All corners of the cube, or ``limit`` different ones drawn at random, the two extreme ones among them."""
        n = len(self.free)
        if 2**n <= limit:
            return list(product((0.0, 1.0), repeat=n))
        return list(islice(_random_corners(n, generator), limit))

    def contains(self, point: Sequence[Fraction]) -> bool:
        return len(point) == len(self.sides) and all(
            side.lo <= value <= side.hi for side, value in zip(self.sides, point, strict=True)
        )


def _random_corners(n: int, generator: np.random.Generator) -> Iterator[tuple[float, ...]]:
    seen = {(0.0,) * n, (1.0,) * n}
    yield from sorted(seen)
    while True:
        corner = tuple(float(bit) for bit in generator.integers(2, size=n))
        if corner not in seen:
            seen.add(corner)
            yield corner


@dataclass(frozen=True)
class AgentPoint:
    """``w, z(0), x(0), x̃(0), η(0)`` of one agent, exact."""

    parameters: Point
    z: Point
    x: Point
    observer: Point
    eta: Point


def agent_box(agent: Agent, law: AgentController) -> Box:
    """``W`` and the agent's initial box; an observer that is measured follows from ``x`` and has no side."""
    initial = agent.initial
    observer = () if agent.order == 1 or initial.observer is None else initial.observer
    return Box((*agent.parameter_box, *initial.z, *initial.x, *observer, *(initial.eta,) * len(law.N)))


def agent_point(agent: Agent, law: AgentController, values: Sequence[Fraction]) -> AgentPoint:
    """The parts of a point of :func:`agent_box`."""
    initial = agent.initial
    measured = agent.order > 1 and initial.observer is None
    sizes = [len(agent.parameters), len(initial.z), agent.order, 0 if measured or agent.order == 1 else agent.order]
    ends = np.cumsum([0, *sizes, len(law.N)]).tolist()
    parameters, z, x, observer, eta = (tuple(values[a:b]) for a, b in pairwise(ends))
    if measured:
        observer = (x[0], *(Fraction(0),) * (agent.order - 1))
    return AgentPoint(parameters, z, x, observer, eta)


@dataclass(frozen=True)
class SharedPoint:
    """``v(0)`` and all ``y^r_i(0)``, exact: what the upper layer starts from (``ζ(0) = 0``, ``ξ(0) = I``)."""

    v: Point
    reference: Point

    @property
    def floats(self) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
        return tuple(map(float, self.v)), tuple(map(float, self.reference)), (0.0,) * len(self.reference)


def shared_points(plant: Plant, generator: np.random.Generator, corners: int, inner: int) -> list[SharedPoint]:
    """Corners of ``V0`` and of the box of ``y^r(0)`` first, then points drawn inside; one point if both are points."""
    nv = len(plant.exosystem.states)
    box = Box((*plant.exosystem.initial, *(agent.initial.reference for agent in plant.agents)))
    cubes = box.corners(corners, generator)
    if box.free:
        cubes += [tuple(row) for row in generator.random((inner, len(box.free)))]
    points = [box.point(cube) for cube in cubes]
    return [SharedPoint(point[:nv], point[nv:]) for point in points]
