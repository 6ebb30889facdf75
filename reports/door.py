"""The steps that need the simulator or the typesetter, as functions: loaded by ``import certify`` when they are used.

The commands of the same names do what these do; each adds where its results go.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from certify.door import CertificateLike, PlantLike, given_certificate, given_plant
from certify.files import require_writable
from reports.answers import Export, Falsification, Region, Report, Simulation, is_page
from reports.command_line.inputs import Given
from reports.command_line.outcome import naming
from reports.command_line.steps import Steps
from reports.runs import BUDGET, obstacle, sentence
from symbolic.errors import InputError
from symbolic.plant import Plant
from symbolic.toml_value import exact_number

if TYPE_CHECKING:
    from reports.study import Study
    from sims.closed_loop import Trajectory
    from symbolic.controller import Controller

Listener = Callable[[str], None]


def simulate(
    plant: PlantLike,
    certificate: CertificateLike | None = None,
    *,
    horizon: float | None = None,
    progress: Listener | None = None,
) -> Simulation:
    """Run the closed loop from the centre of the boxes for ``horizon`` seconds, else until the outputs have settled.

    With the gains of the certificate, after the word of the checker on it; without one with those of the plant, and
    moderate ones where it fixes none. Raises ``InputError``.
    """
    proof = None if certificate is None else Given("the certificate", given_certificate(certificate))
    return simulated(given_plant(plant), proof, horizon, Steps(progress or _unheard))


def falsify(
    plant: PlantLike,
    certificate: CertificateLike,
    *,
    budget: int = BUDGET,
    seed: int = 0,
    horizon: float | None = None,
    agents: Sequence[int] | None = None,
    compiled: bool = False,
    scheduler: str | None = None,
    progress: Listener | None = None,
) -> Falsification:
    """Search for a trajectory that breaks the claim, with about ``budget`` trajectories for each of the ``agents``.

    ``horizon`` is the length of a trajectory, else as long as the certificate takes to settle. ``compiled`` takes the
    integrator of the extra ``fast``, ``scheduler`` names a Dask scheduler (extra ``cluster``). The same seed gives the
    same search. Raises ``InputError``.
    """
    options = SearchOptions(budget, seed, horizon, agents, compiled, scheduler)
    proof = Given("the certificate", given_certificate(certificate))
    return falsified(given_plant(plant), proof, options, Steps(progress or _unheard))


def region(plant: PlantLike, certificate: CertificateLike, *, progress: Listener | None = None) -> Region:
    """The largest boxes of starts that are certified with the gains of a verified certificate.

    Every box is proved by a certificate of its own, for a plant that differs in ``initial`` alone. Raises
    ``InputError``.
    """
    from certify.region import NoRegion, certified_region
    from reports.command_line.study_steps import started, with_certificate

    given, steps = given_plant(plant), Steps(progress or _unheard)
    study = with_certificate(started(given, []), Given("the certificate", given_certificate(certificate)), steps)
    if study.verified_certificate is None:
        return Region("rejected", _rejection(study.verification or {"reason": "it does not verify"}), given)
    with steps.step("region") as said:
        found = certified_region(given, study.verified_certificate, said.progress)
    if isinstance(found, NoRegion):
        return Region("inconclusive", found.reason, given)
    return Region("certified", "each box by a certificate of its own", given, found)


def report(
    plant: PlantLike,
    certificate: CertificateLike,
    path: str | Path | None = None,
    *,
    progress: Listener | None = None,
) -> Report:
    """Verify a certificate and report on it and its plant; written to ``path`` if one is given, as the interactive page
    where that ends in ``.html``, else as PDF.

    Raises ``InputError``.
    """
    if path is not None:
        require_writable(Path(path))
    proof = Given("the certificate", given_certificate(certificate))
    made = reported(given_plant(plant), proof, (), Steps(progress or _unheard), page=is_page(path or ""))
    if path is not None:
        made.save(path)
    return made


def export(
    plant: PlantLike,
    certificate: CertificateLike,
    folder: str | Path | None = None,
    *,
    to: Literal["c", "python", "fmi"] = "c",
    period: Fraction | float | None = None,
    coordinator_period: Fraction | float | None = None,
    arithmetic: Literal["double", "single"] | None = None,
    progress: Listener | None = None,
) -> Export:
    """The controller of a verified certificate as code; written to ``folder`` if one is given (docs/export.md).

    Periods, in the plant's unit of time, are those of the plant, or chosen; a float is the decimal that Python prints.
    Nothing is proved about sampling. Raises ``InputError``.
    """
    from certify.export.package import Options
    from reports.exporting import exported

    if to not in ("c", "python", "fmi") or arithmetic not in (None, "double", "single"):
        raise InputError("export: to is one of c, python, fmi, and arithmetic one of double, single")
    given_periods = (period, coordinator_period)
    seconds = [None if value is None else exact_number(value, "export: period") for value in given_periods]
    if any(value is not None and not value > 0 for value in seconds):
        raise InputError("export: periods are positive")
    given = Given("the certificate", given_certificate(certificate))
    options = Options(seconds[0], seconds[1], arithmetic)
    made = exported(given_plant(plant), given, to, options, Steps(progress or _unheard))
    if folder is not None and made.package is not None:
        made.save(folder)
    return made


@dataclass(frozen=True)
class SearchOptions:
    """The options of :func:`falsify`."""

    budget: int = BUDGET
    seed: int = 0
    horizon: float | None = None
    agents: Sequence[int] | None = None
    compiled: bool = False
    scheduler: str | None = None


def simulated(plant: Plant, proof: Given | None, horizon: float | None, steps: Steps) -> Simulation:
    """:func:`simulate` with its steps told one by one."""
    from certify.derivation import derivation_at_optimum
    from reports.command_line.demonstration import demonstration_controller
    from reports.command_line.study_steps import started, with_certificate
    from sims.closed_loop import simulate as run
    from sims.deadline import settled_run

    answer = None
    if proof is None:
        with steps.step("derive") as said, naming(plant.name):
            derivation = derivation_at_optimum(plant)
            said(derivation.verdict)
        reason = obstacle(plant, derivation)
        if reason:
            return Simulation("inconclusive", reason)
        controller = demonstration_controller(plant, derivation)
    else:
        study = with_certificate(started(plant, []), proof, steps)
        answer = study.verification or {}
        claimed = _claimed(study, proof)
        if claimed is None:
            return Simulation("rejected", _rejection(answer), None, answer)
        controller = claimed
    with steps.step("simulate") as said:
        trajectory = settled_run(plant, controller) if horizon is None else run(plant, controller, horizon=horizon)
        said(sentence(trajectory))
    return _judged(trajectory, sentence(trajectory), answer)


def falsified(plant: Plant, proof: Given, options: SearchOptions, steps: Steps) -> Falsification:
    """:func:`falsify` with its steps told one by one."""
    from reports.command_line import study_steps as step
    from reports.command_line.certified_steps import deadlines, with_region
    from sims.certified_bounds import signal_bounds
    from sims.executors import processors
    from sims.falsifier import falsify as search
    from sims.falsifier import require_agents

    require_agents(plant, options.agents)
    study = step.with_certificate(step.started(plant, []), proof, steps)
    answer = study.verification or {}
    controller = _claimed(study, proof)
    if controller is None:
        return Falsification("rejected", _rejection(answer), None, answer, options.seed)
    if study.verified_certificate is not None:
        study = with_region(step.with_derivation(study, plant.name, steps), steps)
    with steps.step("falsify") as said:
        found = search(
            plant,
            controller,
            budget=options.budget,
            seed=options.seed,
            horizon=options.horizon,
            deadlines=deadlines(study, controller) if options.horizon is None else {},
            bounds=() if study.bounds is None else signal_bounds(study.bounds),
            agents=options.agents,
            compiled=options.compiled,
            progress=said.progress,
            share=said.share,
            workers=1 if options.compiled else processors(),
            scheduler=options.scheduler,
        )
        said(found.status)
    if answer["status"] == "rejected" and found.witness is None:
        return Falsification("rejected", _rejection(answer), found, answer, options.seed)
    return Falsification(found.status, found.reason, found, answer, options.seed)


def reported(plant: Plant, proof: Given, command: Sequence[str | Path], steps: Steps, *, page: bool = False) -> Report:
    """:func:`report` with its steps told one by one; ``command`` is the one that the report names.

    A ``page`` also shows the simulated region of attraction.
    """
    from reports.command_line import study_steps as step
    from reports.command_line.certified_steps import with_region, with_runs, with_slices
    from reports.command_line.drawing import prepare_drawing
    from reports.study import conclusion

    prepare_drawing()
    study = step.with_certificate(step.started(plant, command), proof, steps)
    study = step.with_check(study, steps)
    study = step.with_derivation(study, plant.name, steps)
    study = step.with_simulation(study, steps)
    study = with_runs(with_region(study, steps), steps)
    if page:
        study = with_slices(study, steps)
    found = conclusion(study)
    return Report(found.status, found.reason, found.verified, study)


def _judged(trajectory: Trajectory, said: str, answer: Mapping[str, str] | None) -> Simulation:
    """``simulated``, whatever was seen, unless that contradicts a claim."""
    if answer is not None and trajectory.status == "escaped":
        return Simulation("refuted", said, trajectory, answer)
    if answer is not None and answer["status"] == "rejected":
        return Simulation("rejected", f"{_rejection(answer)}; simulated: {said}", trajectory, answer)
    return Simulation("inconclusive" if trajectory.status == "failed" else "simulated", said, trajectory, answer)


def _claimed(study: Study, proof: Given) -> Controller | None:
    """The controller whose certificate was checked; ``None`` where a rejected one holds none for this plant."""
    from certify.statement.controller import certified_controller

    try:
        return certified_controller(study.found_certificate or {}, study.plant, proof.name)
    except InputError:
        if (study.verification or {})["status"] != "rejected":
            raise
        return None


def _rejection(answer: Mapping[str, str]) -> str:
    return f"the checker rejects the certificate: {answer['reason']}"


def _unheard(message: str) -> None:
    """Where nobody listens."""
