"""The search for a counterexample: a start, parameters and a disturbance for which the claim does not hold.

Behind the coordinator the agents do not see each other, so each is searched by itself. For every agent in turn:
corners of ``W × box`` (with corners and inner points of ``V0``, ``y^r(0)``), points inside and on faces, then SciPy's
differential evolution from the worst of them. What looks like a counterexample is run again by LSODA at tight
tolerances (``sims.witness``) and only counts if that run agrees. Surviving proves nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from scipy.optimize import differential_evolution

from sims.agent_loop import AgentLoop, agent_loop, upper_layer
from sims.batch import COMPLETED, ESCAPED, FAILED, BatchOptions, BatchSolution
from sims.bounds import SignalBound, margin
from sims.coordinator import UpperLayer
from sims.deadline import Deadline
from sims.executors import run_tasks
from sims.fate import BROKEN, amplitudes, judge, windows
from sims.scores import broken_margin, seen
from sims.scores import scores as scores_of
from sims.search_space import AgentPoint, SharedPoint, agent_box, agent_point, shared_points
from sims.signal_pool import SignalPool
from sims.signals import Array
from sims.witness import Witness, gains_of, run_reference
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Plant

Progress = Callable[[str], None]
Status = Literal["refuted", "survived", "inconclusive"]

Share = Callable[[float], None]

HORIZON = 40.0  # seconds, and below the error at their end: where no deadlines are given, for plants scaled to one
TOLERANCE = Fraction(1, 10_000)
_CHUNK = 512
_EXTENSION = 2
_EXTENDED = 8
_SHARED_CORNERS, _SHARED_INNER = 8, 4
_OPTIONS = BatchOptions(rtol=1e-5, atol=1e-7, max_steps=20_000, stop_at_escape=True)  # what counts is run again


@dataclass(frozen=True)
class Tried:
    """How much was simulated for one agent: trajectories in all, and those that could not be integrated or that still
    converged when the time was over. ``worst`` is the largest ``|y − s*|`` at the end of those that completed,
    ``peak`` their largest ``|plant state|``.
    """

    agent: int
    trajectories: int
    failed: int
    slow: int
    worst: float
    peak: float


@dataclass(frozen=True)
class FalsifierResult:
    """``refuted`` with a witness, ``survived``, or ``inconclusive`` when next to nothing could be simulated.

    ``margin`` is the least of ``1 − |y − s*|/tolerance`` at the end of the runs and ``1 − |signal|/bound`` along them:
    1 is best, 0 says that some were still converging, below 0 something is broken, −inf for an escape; NaN if nothing
    was simulated. ``reason`` says it in words.
    """

    status: Status
    witness: Witness | None
    margin: float
    tried: tuple[Tried, ...]
    reason: str

    @property
    def trajectories(self) -> int:
        return sum(agent.trajectories for agent in self.tried)


def falsify(
    plant: Plant,
    controller: Controller,
    *,
    budget: int = 1000,
    seed: int = 0,
    horizon: float | None = None,
    tolerance: Fraction = TOLERANCE,
    deadlines: Mapping[int, Deadline] = MappingProxyType({}),
    bounds: Sequence[SignalBound] | None = None,
    agents: Sequence[int] | None = None,
    compiled: bool = False,
    progress: Progress | None = None,
    share: Share | None = None,
    workers: int = 1,
    scheduler: str | None = None,
) -> FalsifierResult:
    """Search with about ``budget`` trajectories per agent; ``agents`` are all if left out.

    A trajectory of an agent lasts as long as its deadline says, else ``horizon`` (default 40) seconds. It breaks the
    claim when it escapes, when its error at the end is above the deadline's tolerance (else ``tolerance``) and has
    stopped to fall, or when it leaves one of the ``bounds``. ``share`` is told what part of the search is done.
    ``compiled`` takes the integrator of the extra ``fast``. ``workers`` and a Dask ``scheduler`` are as for
    :func:`sims.executors.run_tasks`. The same ``seed`` gives the same search wherever it runs. Raises ``InputError``
    for options that do not fit.
    """
    numbers = require_agents(plant, agents)
    default = Deadline(HORIZON if horizon is None else horizon, tolerance)
    due = {number: deadlines.get(number, default) for number in numbers}
    longest = max(one.horizon for one in due.values())
    valid = all(0.0 < one.horizon < math.inf and one.tolerance > 0 for one in due.values())
    if budget < 1 or seed < 0 or not valid:
        raise InputError("the search needs budget >= 1, seed >= 0, a horizon > 0 and a tolerance > 0")
    say = progress or (lambda message: None)
    generator = np.random.default_rng(seed)
    shared = shared_points(plant, generator, _SHARED_CORNERS, _SHARED_INNER)
    layers = [upper_layer(plant, controller, start, longest) for start in shared]
    broken = next((layer for layer in layers if layer.status != "completed"), None)
    if broken is not None:
        return FalsifierResult("inconclusive", None, math.nan, (), f"the coordinator {broken.status}: {broken.reason}")
    prepared = (shared, layers, due, tuple(bounds or ()), compiled)
    hunt = partial(_hunt, plant, controller, prepared, budget, seed)
    tried = []
    least = math.inf
    for count, margin_found, witness, reason in run_tasks(
        hunt, numbers, workers=workers, scheduler=scheduler, listen=say
    ):
        tried.append(count)
        say(f"agent {count.agent}: done, {count.trajectories} trajectories")
        if share is not None:
            share(len(tried) / len(numbers))
        least = min(least, margin_found)
        if witness is not None:
            return FalsifierResult("refuted", witness, margin_found, tuple(tried), reason)
    return _survival(tuple(tried), least, controller)


def _hunt(
    plant: Plant,
    controller: Controller,
    prepared: tuple[Any, ...],
    budget: int,
    seed: int,
    number: int,
    say: Progress = lambda message: None,
) -> tuple[Tried, float, Witness | None, str]:
    """One agent: what was tried, margin, witness, reason. ``prepared`` goes to :class:`Search` after the loop."""
    shared, layers, due, bounds, compiled = prepared
    search = Search(agent_loop(plant, controller, number), shared, layers, due[number], bounds, say, compiled)
    witness = search.hunt(budget, np.random.default_rng([seed, number]))
    return search.tried, search.margin, witness, search.reason


def require_agents(plant: Plant, agents: Sequence[int] | None) -> list[int]:
    """The agents to search, all if left out. Raises ``InputError`` for one that the plant does not have."""
    known = [agent.id for agent in plant.agents]
    missing = [number for number in agents or () if number not in known]
    if missing or (agents is not None and not agents):
        raise InputError(f"there is no agent {missing[0]}" if missing else "the search needs an agent")
    return known if agents is None else sorted(set(agents))


def _survival(
    tried: tuple[Tried, ...],
    least: float,
    controller: Controller,
) -> FalsifierResult:
    total = sum(agent.trajectories for agent in tried)
    failed = [agent for agent in tried if 2 * agent.failed >= agent.trajectories]
    if failed:
        number, lost, count = failed[0].agent, failed[0].failed, failed[0].trajectories
        reason = f"agent {number}: {lost} of {count} trajectories cannot be integrated in floats"
        h = controller.agents[number - 1].h
        if h is not None and h > 10**9:
            reason += f" (the observer gain is 1e{len(str(int(h))) - 1})"
        return FalsifierResult("inconclusive", None, math.nan, tried, reason)
    slow = sum(agent.slow for agent in tried)
    worst = max(agent.worst for agent in tried)
    reason = f"{total} trajectories, none breaks the claim; the worst ends with |y - s*| = {worst:.2g}"
    if slow:
        reason += f"; {slow} were still converging"
    return FalsifierResult("survived", None, least, tried, reason)


@dataclass(frozen=True)
class Candidate:
    """A point of the agent's cube, and which of the shared starts it goes with."""

    cube: tuple[float, ...]
    member: int


class Search:
    """The hunt for one agent: evaluates candidates, keeps count and least margin, confirms what looks broken."""

    def __init__(
        self,
        loop: AgentLoop,
        shared: Sequence[SharedPoint],
        layers: Sequence[UpperLayer],
        due: Deadline,
        bounds: tuple[SignalBound, ...],
        say: Progress,
        compiled: bool = False,
    ) -> None:
        self.loop, self.shared, self.say = loop, shared, say
        self.signals = loop.signals(layers)
        self.longer: SignalPool | None = None
        self.box = agent_box(loop.agent, loop.law)
        self.horizon, self.tolerance = due.horizon, due.tolerance
        self.options = replace(_OPTIONS, compiled=compiled)
        self.bounds = tuple(bound for bound in bounds if bound.agent == loop.agent.id)
        self.frame = windows(loop.plant, due.horizon)
        early = np.linspace(0.0, self.frame.times[0], 201) if self.bounds else np.zeros(0)
        self.times = np.union1d(early, self.frame.times)
        self.tried = Tried(loop.agent.id, 0, 0, 0, 0.0, 0.0)
        self.margin = math.inf
        self.reason = ""
        self.witness: Witness | None = None

    def hunt(self, budget: int, generator: np.random.Generator) -> Witness | None:
        """Corners, inner points and faces, evolution; stops at the first counterexample that LSODA confirms."""
        scored: list[tuple[float, Candidate]] = []
        for name, candidates in self._stages(budget, generator):
            for k in range(0, len(candidates), _CHUNK):
                part = candidates[k : k + _CHUNK]
                scored += zip(self.evaluate(part), part, strict=True)
                self._tell(name)
                if self.witness is not None:
                    return self.witness
        if self.box.free and budget - self.tried.trajectories >= 10:
            self._evolve(scored, budget, generator)
        return self.witness

    def _stages(self, budget: int, generator: np.random.Generator) -> Iterator[tuple[str, list[Candidate]]]:
        members = range(len(self.shared))
        corners = self.box.corners(max(2, budget // 2), generator)
        spread = [Candidate(corner, k % len(members)) for k, corner in enumerate(corners)]
        if len(corners) * len(members) <= budget // 2:
            spread += [Candidate(corner, m) for m in members for corner in corners]
        yield "corners", list(dict.fromkeys(spread))[: max(2, budget // 2)]
        n = len(self.box.free)
        inner = generator.random((max(1, budget // 6), n))
        faces = generator.random((max(1, budget // 6), n))
        if n:
            side = generator.integers(n, size=len(faces))
            faces[np.arange(len(faces)), side] = generator.integers(2, size=len(faces))
        points = [tuple(map(float, row)) for row in (*inner, *faces)] if n else []
        yield "inside and faces", [Candidate(point, int(generator.integers(len(members)))) for point in points]

    def _evolve(self, scored: list[tuple[float, Candidate]], budget: int, generator: np.random.Generator) -> None:
        n = len(self.box.free)
        members = len(self.shared)
        left = budget - self.tried.trajectories
        size = max(6, min(24, left // 3))
        best = [candidate for _, candidate in sorted(scored, key=lambda pair: -pair[0])[: size // 2]]
        population = generator.random((size, n + 1))
        population[:, n] = generator.integers(members, size=size)
        for row, candidate in zip(population, best, strict=False):
            row[:] = [*candidate.cube, candidate.member]

        def cost(x: Array) -> Array:
            if self.witness is not None:
                return np.zeros(x.shape[1])
            found = [Candidate(tuple(map(float, row[:n])), round(row[n])) for row in x.T]
            return -np.array(self.evaluate(found))

        def stop(*_: object, **__: object) -> bool:
            self._tell("evolution")
            return self.witness is not None or self.tried.trajectories + size > budget

        differential_evolution(
            cost,
            [(0.0, 1.0)] * n + [(0.0, float(max(members - 1, 1e-9)))],
            init=np.clip(population, 0.0, [1.0] * n + [max(members - 1, 1e-9)]),
            integrality=[False] * n + [members > 1],
            maxiter=max(1, left // size),
            rng=generator,
            polish=False,
            vectorized=True,
            updating="deferred",
            tol=0.0,
            callback=stop,
        )

    def _point(self, candidate: Candidate) -> AgentPoint:
        return agent_point(self.loop.agent, self.loop.law, self.box.point(candidate.cube))

    def evaluate(self, candidates: Sequence[Candidate]) -> list[float]:
        """Run them and score each by how close it is to breaking the claim; a confirmed break ends the hunt."""
        points = [self._point(candidate) for candidate in candidates]
        members = [candidate.member for candidate in candidates]
        solution = self.loop.run(self.signals, members, points, self.horizon, self.times, self.options)
        closeness = margin(self.bounds, self.loop.agent, solution.samples, self.times, self.loop.optimum)
        columns = np.searchsorted(self.times, self.frame.times)
        error = solution.samples[:, self.loop.output_row][:, columns] - self.loop.optimum
        last = amplitudes(error, self.frame)[:, -1]
        scores = scores_of(solution, last, closeness, self.horizon)
        suspects = []
        slow = []
        for k in range(len(points)):
            fate = self._fate(solution, error, closeness, k)
            if fate in BROKEN or fate == "bound":
                suspects.append(k)
            elif fate == "slow":
                slow.append(k)
        self._count(solution, last, closeness)
        if slow and not suspects:
            suspects += self._given_time(sorted(slow, key=lambda k: -last[k]), members, points)
        doubtful = np.flatnonzero(solution.status == FAILED)[:1]  # LSODA may get further
        for k in [*sorted(suspects, key=lambda k: -scores[k])[:3], *doubtful]:
            if self._confirm(self.shared[members[k]], points[k]):
                break
        return [float(score) for score in scores]

    def _fate(self, solution: BatchSolution, error: Array, closeness: Array, k: int) -> str:
        if solution.status[k] == ESCAPED:
            return "escaped"
        if closeness[k] < 0:
            return "bound"
        if solution.status[k] != COMPLETED:
            return "failed"
        return judge(error[k], self.frame, float(self.tolerance))

    def _given_time(self, slow: Sequence[int], members: Sequence[int], points: Sequence[AgentPoint]) -> list[int]:
        """Those of the worst slow ones that do not converge in more time; the rest of them counts as undecided."""
        horizon = _EXTENSION * self.horizon
        if self.longer is None:
            loop = self.loop
            layers = [upper_layer(loop.plant, loop.controller, start, horizon) for start in self.shared]
            self.longer = loop.signals(layers)
        chosen = list(slow[:_EXTENDED])
        frame = windows(self.loop.plant, horizon)
        solution = self.loop.run(
            self.longer, [members[k] for k in chosen], [points[k] for k in chosen], horizon, frame.times, self.options
        )
        error = solution.samples[:, self.loop.output_row] - self.loop.optimum
        fates = [judge(row, frame, float(self.tolerance)) for row in error]
        fates = ["escaped" if s == ESCAPED else fate for s, fate in zip(solution.status, fates, strict=True)]
        undecided = sum(fate in ("slow", "failed") for fate in fates) + len(slow) - len(chosen)
        if undecided:
            self.tried = replace(self.tried, slow=self.tried.slow + undecided)
            self.margin = min(self.margin, 0.0)
        return [k for k, fate in zip(chosen, fates, strict=True) if fate in BROKEN]

    def _count(self, solution: BatchSolution, last: Array, closeness: Array) -> None:
        done = solution.status == COMPLETED
        old = self.tried
        self.tried = replace(
            old,
            trajectories=old.trajectories + len(last),
            failed=old.failed + int((solution.status == FAILED).sum()),
            worst=float(max([old.worst, *last[done]])),
            peak=float(max([old.peak, *solution.peak[done]])),
        )
        settled = done & (last <= float(self.tolerance))
        if settled.any():
            tail = 1.0 - float(last[settled].max()) / float(self.tolerance)
            self.margin = min(self.margin, tail, float(closeness[settled].min()))

    def _confirm(self, shared: SharedPoint, point: AgentPoint) -> bool:
        """Run it by LSODA, longer if it completes: an oscillation has to last, a slow approach gets its time."""
        blank = Witness(
            plant_sha256=self.loop.plant.sha256,
            gains=gains_of(self.loop.controller, self.loop.agent.id),
            agent=self.loop.agent.id,
            fate="",
            horizon=Fraction(self.horizon).limit_denominator(10**6),
            tolerance=self.tolerance,
            shared=shared,
            point=point,
            seen=(),
            bounds=self.bounds,
        )
        found = run_reference(self.loop, shared, point, blank)
        if found.fate not in ("escaped", "bound", "failed"):
            blank = replace(blank, horizon=_EXTENSION * blank.horizon)
            found = run_reference(self.loop, shared, point, blank)
        if not found.broken:
            return False
        self.witness = replace(blank, fate=found.fate, seen=seen(found))
        self.reason = found.reason
        self.margin = broken_margin(found, self.tolerance)
        return True

    def _tell(self, stage: str) -> None:
        tried = self.tried
        self.say(f"agent {tried.agent}: {stage}, {tried.trajectories} trajectories, worst |y - s*| {tried.worst:.2g}")
