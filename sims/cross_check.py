"""Random trajectories against a claim, a stated number: a certificate that one of them breaks is wrong."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from types import MappingProxyType

import numpy as np

from sims.agent_loop import agent_loop, upper_layer
from sims.bounds import SignalBound
from sims.coordinator import UpperLayer
from sims.deadline import Deadline
from sims.executors import run_tasks
from sims.falsifier import HORIZON, TOLERANCE, Candidate, Progress, Search, Share, Tried
from sims.search_space import SharedPoint, shared_points
from sims.witness import Witness
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Plant

_LARGEST = 1024  # lanes of one part: a step costs as much as 300 lanes of it, and their samples take some 50 MB
_FIRST = 256  # with a time limit, which a first part of every agent may overrun


@dataclass(frozen=True)
class CrossCheck:
    """``count`` trajectories were simulated of the ``asked`` per agent, ``failed`` of them not to the end;
    ``worst_margin`` is the least margin (see ``FalsifierResult``), NaN if nothing was simulated; ``broken`` is a
    confirmed counterexample or ``None``; ``reason`` says all this in words.
    """

    count: int
    failed: int
    worst_margin: float
    broken: Witness | None
    tried: tuple[Tried, ...]
    asked: int
    reason: str


@dataclass(frozen=True)
class _Task:
    """Points ``low … high − 1`` of one agent, left out after the instant ``until`` (seconds since the epoch)."""

    agent: int
    low: int
    high: int
    until: float


@dataclass(frozen=True)
class _Setting:
    plant: Plant
    controller: Controller
    shared: tuple[SharedPoint, ...]
    layers: tuple[UpperLayer, ...]
    due: Mapping[int, Deadline]
    bounds: tuple[SignalBound, ...]
    compiled: bool
    seed: int
    count: int


@dataclass(frozen=True)
class _Part:
    tried: Tried
    margin: float
    witness: Witness | None
    reason: str


def cross_check(
    plant: Plant,
    controller: Controller,
    *,
    count: int = 2000,
    time_limit: float = math.inf,
    seed: int = 0,
    horizon: float = HORIZON,
    tolerance: Fraction = TOLERANCE,
    deadlines: Mapping[int, Deadline] = MappingProxyType({}),
    bounds: tuple[SignalBound, ...] = (),
    compiled: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Progress | None = None,
    share: Share | None = None,
) -> CrossCheck:
    """``count`` trajectories per agent, however long they take; the agents take turns.

    With a ``time_limit`` in seconds parts are small at first, and none begins after it but the first of each agent.
    A third of the
    points is uniform in ``W × box``, a third has ``w`` at a vertex, a third is a vertex altogether. The same points for
    the same ``seed``, however many of them a limit leaves. Deadlines, ``horizon`` and ``tolerance``, ``workers`` and
    ``scheduler`` are as for :func:`sims.falsifier.falsify`; ``compiled`` runs on threads of its own. Raises
    ``InputError`` for a count or limit that does not fit.
    """
    if count < 1 or seed < 0 or not time_limit > 0.0:
        raise InputError("a cross-check needs count >= 1, seed >= 0 and a time limit > 0")
    say = progress or (lambda message: None)
    due = {agent.id: deadlines.get(agent.id, Deadline(horizon, tolerance)) for agent in plant.agents}
    longest = max(one.horizon for one in due.values())
    shared = tuple(shared_points(plant, np.random.default_rng(seed), 8, 4))
    layers = tuple(upper_layer(plant, controller, start, longest) for start in shared)
    lost = next((layer for layer in layers if layer.status != "completed"), None)
    if lost is not None:
        return CrossCheck(0, 0, math.nan, None, (), count, f"the coordinator: {lost.reason}")
    setting = _Setting(plant, controller, shared, layers, due, bounds, compiled, seed, count)
    until = time.time() + time_limit
    tasks = [
        _Task(agent.id, low, high, until if low else math.inf)
        for low, high in _parts(count, _LARGEST if time_limit == math.inf else _FIRST)
        for agent in plant.agents
    ]
    parts: dict[int, list[_Part]] = {}
    results = run_tasks(partial(_run, setting), tasks, workers=workers, scheduler=scheduler)
    for done, (task, part) in enumerate(zip(tasks, results, strict=True), start=1):
        if share is not None:
            share(done / len(tasks))
        if part is None:
            continue
        parts.setdefault(task.agent, []).append(part)
        say(f"{sum(one.tried.trajectories for found in parts.values() for one in found)} trajectories")
        if part.witness is not None:
            break
    return _result([_together(found) for found in parts.values()], count)


def _parts(count: int, first: int) -> Iterator[tuple[int, int]]:
    low, size = 0, first
    while low < count:
        yield low, min(low + size, count)
        low, size = low + size, min(2 * size, _LARGEST)


def _run(setting: _Setting, task: _Task) -> _Part | None:
    """``None`` when the time is over."""
    if time.time() >= task.until:
        return None
    search = Search(
        agent_loop(setting.plant, setting.controller, task.agent),
        setting.shared,
        setting.layers,
        setting.due[task.agent],
        setting.bounds,
        lambda message: None,
        setting.compiled,
    )
    search.evaluate(_points(search, setting, task))
    return _Part(search.tried, search.margin, search.witness, search.reason)


def _points(search: Search, setting: _Setting, task: _Task) -> list[Candidate]:
    """Of all the points of the agent, those of the task."""
    generator = np.random.default_rng([setting.seed, task.agent])
    cubes = generator.random((setting.count, len(search.box.free)))
    members = generator.integers(len(setting.shared), size=setting.count)
    parameters = sum(k < len(search.loop.agent.parameters) for k in search.box.free)
    corner = np.round(cubes)
    kind = np.arange(setting.count) % 3
    cubes[kind == 1, :parameters] = corner[kind == 1, :parameters]
    cubes[kind == 2] = corner[kind == 2]
    return [Candidate(tuple(map(float, cubes[k])), int(members[k])) for k in range(task.low, task.high)]


def _together(parts: list[_Part]) -> _Part:
    tried = Tried(
        agent=parts[0].tried.agent,
        trajectories=sum(part.tried.trajectories for part in parts),
        failed=sum(part.tried.failed for part in parts),
        slow=sum(part.tried.slow for part in parts),
        worst=max(part.tried.worst for part in parts),
        peak=max(part.tried.peak for part in parts),
    )
    broken = next((part for part in parts if part.witness is not None), None)
    if broken is not None:
        return _Part(tried, broken.margin, broken.witness, broken.reason)
    return _Part(tried, min(part.margin for part in parts), None, "")


def _result(agents: list[_Part], asked: int) -> CrossCheck:
    tried = tuple(agent.tried for agent in agents)
    count, failed = sum(agent.trajectories for agent in tried), sum(agent.failed for agent in tried)
    said = f"{count} trajectories"
    broken = next((agent for agent in agents if agent.witness is not None), None)
    if broken is not None:
        return CrossCheck(count, failed, broken.margin, broken.witness, tried, asked, f"{said}: {broken.reason}")
    margins = [agent.margin for agent in agents if math.isfinite(agent.margin)]
    worst = min(margins) if margins else math.nan
    if failed:
        said += f", {failed} of which cannot be integrated in floats"
    if failed < count:
        said += f", none breaks the claim, worst margin {worst:.4g}"
    return CrossCheck(count, failed, worst, None, tried, asked, said)
