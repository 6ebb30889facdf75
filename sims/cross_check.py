"""Random trajectories against a claim, within a time: a certificate that one of them breaks is wrong."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from sims.agent_loop import agent_loop, upper_layer
from sims.bounds import SignalBound
from sims.falsifier import HORIZON, TOLERANCE, Candidate, Progress, Search, Tried
from sims.search_space import shared_points
from sims.witness import Witness
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Plant

_CHUNK = 250


@dataclass(frozen=True)
class CrossCheck:
    """``count`` trajectories were simulated, ``failed`` of them not to the end; ``worst_margin`` is the least margin
    (see ``FalsifierResult``), NaN if nothing was simulated; ``broken`` is a confirmed counterexample or ``None``.

    ``seconds`` is the time it took; ``reason`` says all this in words.
    """

    count: int
    failed: int
    worst_margin: float
    broken: Witness | None
    tried: tuple[Tried, ...]
    seconds: float
    reason: str


def cross_check(
    plant: Plant,
    controller: Controller,
    *,
    count: int = 2000,
    budget_seconds: float = 30.0,
    seed: int = 0,
    horizon: float = HORIZON,
    tolerance: Fraction = TOLERANCE,
    bounds: tuple[SignalBound, ...] = (),
    compiled: bool = False,
    progress: Progress | None = None,
) -> CrossCheck:
    """``count`` trajectories per agent, or as many as end within ``budget_seconds``; the agents take turns.

    A third of the points is uniform in ``W × box``, a third has ``w`` at a vertex, a third is a vertex altogether. The
    same points for the same ``seed``, however many of them the time allows. Raises ``InputError`` for a count or budget
    that does not fit.
    """
    if count < 1 or seed < 0 or not 0.0 < budget_seconds < math.inf:
        raise InputError("a cross-check needs count >= 1, seed >= 0 and a time budget > 0")
    begun = time.monotonic()
    say = progress or (lambda message: None)
    shared = shared_points(plant, np.random.default_rng(seed), 8, 4)
    layers = [upper_layer(plant, controller, start, horizon) for start in shared]
    lost = next((layer for layer in layers if layer.status != "completed"), None)
    if lost is not None:
        return CrossCheck(0, 0, math.nan, None, (), time.monotonic() - begun, f"the coordinator: {lost.reason}")
    searches = [
        Search(agent_loop(plant, controller, agent.id), shared, layers, horizon, tolerance, bounds, say, compiled)
        for agent in plant.agents
    ]
    witness: Witness | None = None
    longest = 0.0
    for turn in range(-(-count // _CHUNK)):
        for search in searches:
            left = budget_seconds - (time.monotonic() - begun)
            if witness is not None or left < longest or (turn and _hopeless(search)):
                continue
            started = time.monotonic()
            size = min(_CHUNK, count - turn * _CHUNK)
            search.evaluate(_points(search, len(shared), size, [seed, search.loop.agent.id, turn]))
            longest = max(longest, time.monotonic() - started)
            witness = search.witness
            say(f"{sum(s.tried.trajectories for s in searches)} trajectories")
    return _result(searches, witness, time.monotonic() - begun)


def _points(search: Search, members: int, size: int, seed: list[int]) -> list[Candidate]:
    generator = np.random.default_rng(seed)
    cubes = generator.random((size, len(search.box.free)))
    parameters = sum(k < len(search.loop.agent.parameters) for k in search.box.free)
    corner = np.round(cubes)
    kind = np.arange(size) % 3
    cubes[kind == 1, :parameters] = corner[kind == 1, :parameters]
    cubes[kind == 2] = corner[kind == 2]
    return [Candidate(tuple(map(float, row)), int(generator.integers(members))) for row in cubes]


def _hopeless(search: Search) -> bool:
    return search.tried.failed == search.tried.trajectories


def _result(searches: list[Search], witness: Witness | None, seconds: float) -> CrossCheck:
    tried = tuple(search.tried for search in searches if search.tried.trajectories)
    count, failed = sum(agent.trajectories for agent in tried), sum(agent.failed for agent in tried)
    margins = [search.margin for search in searches if math.isfinite(search.margin)]
    worst = min(margins) if margins else math.nan
    said = f"{count} trajectories in {seconds:.0f} s"
    if witness is not None:
        broken = next(search for search in searches if search.witness is not None)
        return CrossCheck(count, failed, broken.margin, witness, tried, seconds, f"{said}: {broken.reason}")
    if failed:
        said += f", {failed} of which cannot be integrated in floats"
    if failed < count:
        said += f", none breaks the claim, worst margin {worst:.4g}"
    return CrossCheck(count, failed, worst, None, tried, seconds, said)
