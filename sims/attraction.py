"""The certified set against what simulations show: the fates of a grid of starts on a plane, and coverage."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sims.agent_loop import AgentLoop, agent_loop, upper_layer
from sims.batch import COMPLETED, ESCAPED, BatchOptions
from sims.deadline import Deadline
from sims.executors import run_tasks
from sims.falsifier import HORIZON, TOLERANCE
from sims.fate import BROKEN, judge, windows
from sims.search_space import AgentPoint, SharedPoint, agent_box, agent_point, shared_points
from sims.signals import Array
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Agent, Interval, Plant

_DOUBLINGS, _MARGIN = 8, 1.25
CONVERGES, STAYS, ESCAPES, UNKNOWN = 0, 1, 2, 3
_PROBABILITY = 1.959963984540054  # of the normal distribution: 95 % within


@dataclass(frozen=True)
class RegionSlice:
    """Fates of a grid of starts of agent ``agent`` in the plane of two plant states, the rest at the box's centre.

    ``fates`` has shape ``(len(second), len(first))`` of 0 converges, 1 stays away, 2 escapes, 3 not decided: the worst
    over the vertices of ``W`` that were tried, ``parameters`` in number. ``certified`` are the claim's sides.
    """

    agent: int
    names: tuple[str, str]
    first: Array
    second: Array
    fates: NDArray[np.int8]
    certified: tuple[Interval, Interval]
    parameters: int


@dataclass(frozen=True)
class Coverage:
    """The part of the simulated region, within the slice's window, that the certified box covers.

    ``box`` is the box's share of the window, which is exact; ``converging`` of ``sampled`` starts converge. ``low`` and
    ``high`` come from the Wilson interval of 95 % for the converging share; at most 1.
    """

    box: float
    converging: int
    sampled: int

    @property
    def fraction(self) -> float:
        return min(1.0, self.box * self.sampled / self.converging) if self.converging else math.nan

    @property
    def low(self) -> float:
        return min(1.0, self.box / wilson(self.converging, self.sampled)[1])

    @property
    def high(self) -> float:
        least = wilson(self.converging, self.sampled)[0]
        return min(1.0, self.box / least) if least > 0 else 1.0


def slice_names(agent: Agent) -> tuple[str, str] | None:
    """The plane that says most: output and its rate, else a zero state and the output; ``None`` for one state."""
    names = [*map(str, agent.zero_states), *map(str, agent.chain)]
    if agent.order > 1:
        return names[len(agent.zero_states)], names[len(agent.zero_states) + 1]
    return (names[0], names[len(agent.zero_states)]) if agent.zero_states else None


def region_window(
    plant: Plant,
    controller: Controller,
    agent: int,
    names: tuple[str, str],
    *,
    vertices: int = 4,
    seed: int = 0,
    due: Deadline = Deadline(HORIZON, TOLERANCE),
    compiled: bool = False,
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Spans for :func:`region_slice` that show where the region ends.

    Along each of the two axes the certified side is doubled, up to 256 times, until a start there no longer converges
    for one of the vertices. Raises as :func:`region_slice`.
    """
    loop = agent_loop(plant, controller, agent)
    rows = [_row(loop, name) for name in names]
    sides = [_side(loop, row) for row in rows]
    middles = [float(side.lo + side.hi) / 2 for side in sides]
    halves = [float(side.hi - side.lo) / 2 for side in sides]
    halves = [half or max(halves) or 1.0 for half in halves]
    generator = np.random.default_rng(seed)
    corners = _parameter_corners(loop, vertices, generator)
    factors = [2.0**k for k in range(1, _DOUBLINGS + 1)]
    tried = [(axis, factor, sign) for axis in (0, 1) for factor in factors for sign in (-1.0, 1.0)]
    starts = [
        _moved(loop, corner, {rows[axis]: middles[axis] + sign * factor * halves[axis]})
        for corner in corners
        for axis, factor, sign in tried
    ]
    fates = _fates(loop, starts, shared_points(plant, generator, 2, 0)[0], due, compiled)
    worst = fates.reshape(len(corners), 2, len(factors), 2).max(axis=(0, 3))
    spans = []
    for axis in (0, 1):
        lost = np.flatnonzero(worst[axis] != CONVERGES)
        reach = _MARGIN * factors[lost[0] if lost.size else -1] * halves[axis]
        spans.append((middles[axis] - reach, middles[axis] + reach))
    return spans[0], spans[1]


def region_slice(
    plant: Plant,
    controller: Controller,
    agent: int,
    names: tuple[str, str],
    spans: tuple[tuple[float, float], tuple[float, float]],
    *,
    points: int = 31,
    vertices: int = 8,
    seed: int = 0,
    due: Deadline = Deadline(HORIZON, TOLERANCE),
    compiled: bool = False,
) -> RegionSlice:
    """``points × points`` starts in the middles of equal cells of ``spans``, each for up to ``vertices`` vertices of
    ``W``.

    ``names`` are plant states (``z1``, ``x2``). Raises ``InputError`` for a state that the agent does not have and for
    fewer than two points.
    """
    if points < 2:
        raise InputError("a slice needs at least 2 points per side")
    loop = agent_loop(plant, controller, agent)
    rows = [_row(loop, name) for name in names]
    middles = (np.arange(points) + 0.5) / points
    first, second = (low + (high - low) * middles for low, high in spans)
    grid = [(float(a), float(b)) for b in second for a in first]
    generator = np.random.default_rng(seed)
    corners = _parameter_corners(loop, vertices, generator)
    starts = [_moved(loop, corner, dict(zip(rows, place, strict=True))) for corner in corners for place in grid]
    fates = _fates(loop, starts, shared_points(plant, generator, 2, 0)[0], due, compiled)
    return RegionSlice(
        agent=agent,
        names=names,
        first=first,
        second=second,
        fates=fates.reshape(len(corners), points, points).max(axis=0),
        certified=(_side(loop, rows[0]), _side(loop, rows[1])),
        parameters=len(corners),
    )


def region_slices(
    plant: Plant,
    controller: Controller,
    agents: Sequence[int],
    *,
    points: int = 21,
    vertices: int = 4,
    seed: int = 0,
    deadlines: Mapping[int, Deadline] = MappingProxyType({}),
    compiled: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    share: Callable[[float], None] | None = None,
) -> tuple[RegionSlice, ...]:
    """The slice of :func:`slice_names` in the window of :func:`region_window` for each agent that has one.

    ``deadlines`` say by agent how long the runs last, ``workers`` and ``scheduler`` are as for
    :func:`sims.executors.run_tasks`, ``share`` is told what part is done.
    """
    settings = {"vertices": vertices, "seed": seed, "compiled": compiled}
    one = partial(_telling_slice, plant, controller, points, settings, dict(deadlines))
    found = []
    for part in run_tasks(one, agents, workers=workers, scheduler=scheduler):
        found.append(part)
        if share is not None:
            share(len(found) / len(agents))
    return tuple(part for part in found if part is not None)


def _telling_slice(
    plant: Plant,
    controller: Controller,
    points: int,
    settings: Mapping[str, Any],
    deadlines: Mapping[int, Deadline],
    agent: int,
) -> RegionSlice | None:
    due = deadlines.get(agent, Deadline(HORIZON, TOLERANCE))
    names = slice_names(plant.agents[agent - 1])
    if names is None:
        return None
    spans = region_window(plant, controller, agent, names, due=due, **settings)
    return region_slice(plant, controller, agent, names, spans, points=points, due=due, **settings)


def coverage(found: RegionSlice) -> Coverage:
    """How much of the slice's converging starts lies in the certified box.

    The grid's points stand for independent samples of the window, which for an evenly spread grid is cautious.
    """
    window = 1.0
    for places, side in zip((found.first, found.second), found.certified, strict=True):
        cell = places[1] - places[0]
        low, high = max(float(side.lo), places[0] - cell / 2), min(float(side.hi), places[-1] + cell / 2)
        window *= max(0.0, high - low) / (len(places) * cell)
    return Coverage(window, int((found.fates == CONVERGES).sum()), found.fates.size)


def wilson(hits: int, total: int) -> tuple[float, float]:
    """The Wilson interval of 95 % for ``hits`` of ``total``; all of ``[0, 1]`` without samples."""
    if total == 0:
        return 0.0, 1.0
    z2 = _PROBABILITY**2
    share = hits / total
    middle = (share + z2 / (2 * total)) / (1 + z2 / total)
    half = _PROBABILITY * math.sqrt(share * (1 - share) / total + z2 / (4 * total**2)) / (1 + z2 / total)
    return max(0.0, middle - half), min(1.0, middle + half)


def _side(loop: AgentLoop, row: int) -> Interval:
    return (*loop.agent.initial.z, *loop.agent.initial.x)[row]


def _row(loop: AgentLoop, name: str) -> int:
    names = [str(symbol) for symbol in (*loop.agent.zero_states, *loop.agent.chain)]
    if name not in names:
        raise InputError(f"agent {loop.agent.id} has no plant state {name}; it has {', '.join(names)}")
    return names.index(name)


def _parameter_corners(loop: AgentLoop, limit: int, generator: np.random.Generator) -> list[AgentPoint]:
    """The centre of the initial box with vertices of ``W``."""
    box, count = agent_box(loop.agent, loop.law), len(loop.agent.parameters)
    free = sum(k < count for k in box.free)
    rest = [0.5] * (len(box.free) - free)
    cubes = list(np.ndindex(*(2,) * free)) if 2**free <= limit else generator.integers(2, size=(limit, free)).tolist()
    points = [box.point([*map(float, cube), *rest]) for cube in cubes]
    return [agent_point(loop.agent, loop.law, point) for point in points]


def _moved(loop: AgentLoop, point: AgentPoint, values: dict[int, float]) -> AgentPoint:
    z, x = list(point.z), list(point.x)
    for row, value in values.items():
        if row < len(z):
            z[row] = Fraction(value)
        else:
            x[row - len(z)] = Fraction(value)
    measured = loop.agent.order > 1 and loop.agent.initial.observer is None
    observer = (x[0], *(Fraction(0),) * (len(x) - 1)) if measured else point.observer
    return replace(point, z=tuple(z), x=tuple(x), observer=observer)


def _fates(
    loop: AgentLoop, starts: Sequence[AgentPoint], shared: SharedPoint, due: Deadline, compiled: bool
) -> NDArray[np.int8]:
    frame = windows(loop.plant, due.horizon)
    signals = loop.signals([upper_layer(loop.plant, loop.controller, shared, due.horizon)])
    options = BatchOptions(rtol=1e-5, atol=1e-7, max_steps=20_000, compiled=compiled)
    fates = []
    for k in range(0, len(starts), 1024):
        part = starts[k : k + 1024]
        solution = loop.run(signals, [0] * len(part), part, due.horizon, frame.times, options)
        error = solution.samples[:, loop.output_row] - loop.optimum
        told = [judge(row, frame, float(due.tolerance)) for row in error]
        fates += [_mark(int(status), fate) for status, fate in zip(solution.status, told, strict=True)]
    return np.array(fates, dtype=np.int8)


def _mark(status: int, fate: str) -> int:
    if status == ESCAPED:
        return ESCAPES
    if status != COMPLETED:
        return UNKNOWN
    return CONVERGES if fate == "converged" else STAYS if fate in BROKEN else UNKNOWN
