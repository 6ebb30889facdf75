"""The steps of a study that a certificate makes possible: its region, a run with its gains, a search against it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec

from certify.coordinator.envelope import Envelope
from certify.statement.bounds import proved_bounds
from certify.statement.claim import CertifiedGains
from certify.statement.controller import certified_controller
from certify.statement.recomputed import coordinator_envelope
from reports.command_line.steps import Steps
from reports.cross_checked import sentence, share_of_each
from reports.study import Study, conclusion
from sims.attraction import region_slices
from sims.certified_bounds import signal_bounds
from sims.closed_loop import simulate
from sims.cross_check import cross_check
from sims.deadline import Deadline, certified_deadlines, nominal_deadlines
from sims.executors import processors
from sims.scenario import random_scenario
from symbolic.controller import Controller

SEED = 0
RUNS = 4
SLICED, SLICED_SLOWLY = 6, 3  # agents, with and without the compiled integrator
POINTS, POINTS_SLOWLY = 19, 13


@dataclass(frozen=True)
class SearchOptions:
    """Trajectories per agent (left out, 10 000 are shared out), a limit in seconds, and a Dask scheduler."""

    trajectories: int | None = None
    time_limit: float | None = None
    scheduler: str | None = None


def with_region(study: Study, steps: Steps) -> Study:
    """The bounds that a verified certificate with tubes proves."""
    certified = study.certified
    if certified is None or not certified.has_tubes or not conclusion(study).verified:
        return study
    with steps.step("region") as report:
        envelope = _envelope(study, certified)
        if isinstance(envelope, str) or study.derivation is None:
            report(f"left out: {envelope}")
            return study
        found = proved_bounds(study.plant, study.derivation, certified, envelope)
        if isinstance(found, str):
            report(f"left out: {found}")
            return study
        worst = max(float(agent.error.peak) for agent in found.agents)
        report(f"|y_i - s*| <= {worst:.3g} for all t >= 0")
    return replace(study, bounds=found)


def with_runs(study: Study, steps: Steps) -> Study:
    """Runs from random starts beside the one from the centre, where that used the certified gains."""
    if study.bounds is None or study.trajectory is None or study.simulated is None:
        return study
    certified = study.certified
    if certified is None or not certified.same_as(study.simulated):
        return study
    controller, plant = study.simulated, study.plant
    with steps.step("runs") as report:
        scenarios = [
            random_scenario(plant, controller, (SEED, k), parameters="vertex", start="vertex") for k in range(RUNS)
        ]
        runs = tuple(
            simulate(
                plant, controller, horizon=float(study.trajectory.t[-1]), scenario=scenario, samples=study.trajectory.t
            )
            for scenario in scenarios
        )
        report(f"{RUNS} starts at vertices of all boxes, seed {SEED}")
    return replace(study, runs=runs, seed=SEED)


def with_slices(study: Study, steps: Steps, scheduler: str | None = None) -> Study:
    """The simulated region of attraction of the first agents, on planes through the middle of their boxes.

    Where it runs is chosen as for :func:`with_search`.
    """
    certified = study.certified
    if certified is None or certified.too_large or not conclusion(study).verified:
        return study
    compiled = _compiled(scheduler)
    agents = [agent.id for agent in study.plant.agents][: SLICED if compiled else SLICED_SLOWLY]
    with steps.step("attraction") as report:
        controller = certified_controller(study.found_certificate or {}, study.plant, "the certificate")
        found = region_slices(
            study.plant,
            controller,
            agents,
            points=POINTS if compiled else POINTS_SLOWLY,
            deadlines=deadlines(study, controller),
            seed=SEED,
            compiled=compiled,
            workers=1 if compiled else processors(),
            scheduler=scheduler,
            share=report.share,
        )
        starts = sum(part.fates.size for part in found)
        report(f"{starts} starts on {len(found)} planes" if found else "no agent has two plant states")
    return replace(study, slices=found)


def with_search(study: Study, steps: Steps, search: SearchOptions = SearchOptions()) -> Study:
    """Random trajectories that might break the claim or leave the region, as many as the options say.

    On the workers of a Dask ``scheduler``; else compiled where the extra ``fast`` is installed, in processes if not.
    """
    certified = study.certified
    if certified is None or not conclusion(study).verified:
        steps.note("falsify", "left out: there is no verified certificate")
        return study
    if certified.too_large:
        steps.note("falsify", "left out: no integrator in floats follows gains this large")
        return study
    bounds = () if study.bounds is None else signal_bounds(study.bounds)
    compiled = _compiled(search.scheduler)
    with steps.step("falsify") as report:
        controller = certified_controller(study.found_certificate or {}, study.plant, "the certificate")
        found = cross_check(
            study.plant,
            controller,
            count=search.trajectories or share_of_each(len(study.plant.agents)),
            time_limit=search.time_limit or math.inf,
            deadlines=deadlines(study, controller),
            seed=SEED,
            bounds=bounds,
            compiled=compiled,
            workers=1 if compiled else processors(),
            scheduler=search.scheduler,
            progress=report.progress,
            share=report.share,
        )
        report(found.reason if found.broken else sentence(found, len(study.plant.agents)))
    return replace(study, search=found, seed=SEED)


def deadlines(study: Study, controller: Controller) -> Mapping[int, Deadline]:
    """How long runs last: as the proved bounds say where there are some, else as a run from the centre of the boxes."""
    if study.bounds is not None:
        return certified_deadlines(study.plant, study.bounds)
    return nominal_deadlines(study.plant, controller)


def _compiled(scheduler: str | None) -> bool:
    return scheduler is None and find_spec("numba") is not None


def _envelope(study: Study, certified: CertifiedGains) -> Envelope | str:
    """That of the search, if this is its certificate, else computed from the witness."""
    if study.gains is not None and study.gains.envelope is not None:
        return study.gains.envelope
    return coordinator_envelope(study.plant, certified)
