"""A batch of seeded runs: random starts in the box, parameters in ``W`` and at its vertices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from sims.closed_loop import simulate
from sims.coordinator import Status
from sims.executors import run_tasks
from sims.scenario import Draw, Scenario, random_scenario
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Plant

_DRAWS: tuple[tuple[Draw, Draw], ...] = (("uniform", "uniform"), ("vertex", "uniform"), ("vertex", "vertex"))


@dataclass(frozen=True)
class Run:
    """One run and how to repeat it: :meth:`scenario` rebuilds its start from the seed.

    ``final_error`` is ``max_i |y_i − s*|`` over the last seconds of the run, infinite if the run did not complete.
    """

    seed: tuple[int, int]
    parameters: Draw
    start: Draw
    status: Status
    reason: str
    end: float
    final_error: float

    def scenario(self, plant: Plant, controller: Controller) -> Scenario:
        return random_scenario(plant, controller, self.seed, parameters=self.parameters, start=self.start)


@dataclass(frozen=True)
class EnsembleResult:
    """All runs, in the order of their seeds."""

    runs: tuple[Run, ...]
    horizon: float

    @property
    def escapes(self) -> tuple[Run, ...]:
        return tuple(run for run in self.runs if run.status == "escaped")

    @property
    def failures(self) -> tuple[Run, ...]:
        return tuple(run for run in self.runs if run.status == "failed")

    @property
    def worst(self) -> Run:
        """The run that ends farthest from ``s*``; an escape before any that completed."""
        return max(self.runs, key=lambda run: (run.final_error, run.status == "escaped"))


def ensemble(
    plant: Plant,
    controller: Controller,
    *,
    count: int,
    seed: int = 0,
    horizon: float = 40.0,
    window: float = 2.0,
    workers: int = 1,
    scheduler: str | None = None,
) -> EnsembleResult:
    """``count`` runs of :func:`sims.closed_loop.simulate`; the same seed gives the same runs for any number of
    ``workers`` and on the cluster of a Dask ``scheduler`` (see :func:`sims.executors.run_tasks`).

    In turn: ``w`` and start uniform, ``w`` at a vertex of ``W``, both at vertices. ``window`` in seconds is the end
    of the run over which the error is taken. This samples; it proves nothing. Raises ``InputError`` for a count or
    window that does not fit, and for a scheduler that cannot be used.
    """
    if count < 1 or seed < 0 or workers < 1:
        raise InputError("an ensemble needs count >= 1, seed >= 0 and workers >= 1")
    if not 0.0 < window <= horizon:
        raise InputError(f"the window must lie in (0, {horizon:g}], not {window!r}")
    run = partial(_run, plant, controller, seed=seed, horizon=horizon, window=window)
    return EnsembleResult(tuple(run_tasks(run, range(count), workers=workers, scheduler=scheduler)), horizon)


def _run(plant: Plant, controller: Controller, number: int, *, seed: int, horizon: float, window: float) -> Run:
    parameters, start = _DRAWS[number % len(_DRAWS)]
    scenario = random_scenario(plant, controller, (seed, number), parameters=parameters, start=start)
    times = np.linspace(horizon - window, horizon, 101)
    trajectory = simulate(plant, controller, horizon=horizon, scenario=scenario, samples=times)
    return Run(
        seed=(seed, number),
        parameters=parameters,
        start=start,
        status=trajectory.status,
        reason=trajectory.reason,
        end=trajectory.end,
        final_error=trajectory.final_error(window),
    )
