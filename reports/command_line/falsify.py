"""``certify falsify``: search for a trajectory that breaks the claim."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument, SchedulerOption
from reports.command_line.inputs import given_pair
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.outputs import deliver, require_file
from reports.command_line.steps import Steps
from reports.command_line.verify import controller_of

if TYPE_CHECKING:
    from sims.falsifier import FalsifierResult

BUDGET = 1000


def command(
    plant: PlantArgument,
    certificate: CertificateArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Witness to write (- for stdout).", show_default=False),
    ] = None,
    budget: Annotated[int, typer.Option(help="Trajectories for each agent, about.", min=1, max=10**7)] = BUDGET,
    seed: Annotated[int, typer.Option(help="The same seed gives the same search.", min=0, max=2**32)] = 0,
    fast: Annotated[bool, typer.Option("--fast", help="Compiled integrator (extra fast).")] = False,
    horizon: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Length of a trajectory; else as long as the certificate takes to settle.",
            min=1e-9,
            show_default=False,
        ),
    ] = None,
    agents: Annotated[
        list[int] | None,
        typer.Option("--agent", metavar="ID", help="Only this agent; may be repeated.", show_default=False),
    ] = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Search for a trajectory that breaks the claim. Finding none proves nothing.

    Says first whether the certificate verifies; where it does not, there is no claim to survive, and the search only
    shows whether its gains fail.
    """
    if output is not None:
        require_file(output, as_json)
    file, proof = given_pair(plant, certificate)
    loaded = file.as_plant()
    from reports.command_line import study_steps as step
    from reports.command_line.certified_steps import deadlines, with_region
    from sims.certified_bounds import signal_bounds
    from sims.executors import processors
    from sims.falsifier import falsify, require_agents

    require_agents(loaded, agents)
    steps = Steps()
    study = step.with_certificate(step.started(loaded, []), proof, steps)
    controller = controller_of(study, proof, as_json)
    if study.verified_certificate is not None:
        study = with_region(step.with_derivation(study, file.name, steps), steps)
    with steps.step("falsify") as report, naming(file.name):
        found = falsify(
            loaded,
            controller,
            budget=budget,
            seed=seed,
            horizon=horizon,
            deadlines=deadlines(study, controller) if horizon is None else {},
            bounds=() if study.bounds is None else signal_bounds(study.bounds),
            agents=agents,
            compiled=fast,
            progress=report.progress,
            share=report.share,
            workers=1 if fast else processors(),
            scheduler=scheduler,
        )
        report(found.status)
    made = None
    if output is not None and found.witness is not None:
        made = deliver(output, found.witness.text().encode())
    finish(outcome(found, seed, study.verification or {}), as_json, made)


def outcome(found: FalsifierResult, seed: int, answer: Mapping[str, str]) -> Outcome:
    """``refuted`` with the witness; else ``rejected`` where the checker rejects the certificate, whatever survived."""
    rejected = answer["status"] == "rejected"
    status = "rejected" if rejected and found.witness is None else found.status
    reason = f"the checker rejects the certificate: {answer['reason']}" if status == "rejected" else found.reason
    fields = {
        "reason": reason,
        "certificate": dict(answer),
        "result": found.status,
        "searched": found.reason,
        "margin": found.margin if math.isfinite(found.margin) else None,
        "trajectories": found.trajectories,
        "tried": [{key: _finite(value) for key, value in asdict(agent).items()} for agent in found.tried],
        "seed": seed,
        "witness": None if found.witness is None else found.witness.to_json(),
    }
    said = f"{status}: {reason}"
    return Outcome(status, fields, f"{said}\nsearched: {found.reason}" if status == "rejected" else said)


def _finite(value: float) -> float | None:
    """JSON has no infinity."""
    return value if math.isfinite(value) else None
