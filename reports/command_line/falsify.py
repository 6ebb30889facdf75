"""``certify falsify``: search for a trajectory that breaks the claim."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from certify.files import require_writable, write_atomically
from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument, SchedulerOption
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from sims.falsifier import FalsifierResult

BUDGET = 1000
HORIZON = 40.0
STATUS = {"refuted": "refuted", "survived": "holds", "inconclusive": "inconclusive"}


def command(
    plant: PlantArgument,
    certificate: CertificateArgument,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Witness to write.", show_default=False)
    ] = None,
    budget: Annotated[int, typer.Option(help="Trajectories for each agent, about.", min=1, max=10**7)] = BUDGET,
    seed: Annotated[int, typer.Option(help="The same seed gives the same search.", min=0, max=2**32)] = 0,
    fast: Annotated[bool, typer.Option("--fast", help="Compiled integrator (extra fast).")] = False,
    horizon: Annotated[float, typer.Option(metavar="SECONDS", help="Length of a trajectory.")] = HORIZON,
    agents: Annotated[
        list[int] | None,
        typer.Option("--agent", metavar="ID", help="Only this agent; may be repeated.", show_default=False),
    ] = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Search for a trajectory that breaks the claim. Finding none proves nothing."""
    from certify.certificate import read_certificate
    from symbolic.plant_file import load_plant

    loaded = load_plant(plant)
    read = read_certificate(certificate)
    if output is not None:
        require_writable(output)
    from certify.statement.controller import certified_controller
    from sims.falsifier import falsify

    controller = certified_controller(read, loaded, str(certificate))
    with Steps().step("falsify") as report, naming(plant):
        found = falsify(
            loaded,
            controller,
            budget=budget,
            seed=seed,
            horizon=horizon,
            agents=agents,
            compiled=fast,
            progress=report.progress,
            scheduler=scheduler,
        )
        report(found.status)
    if output is not None and found.witness is not None:
        write_atomically(output, found.witness.text().encode())
    finish(outcome(found, seed), as_json)


def outcome(found: FalsifierResult, seed: int) -> Outcome:
    """``refuted`` with the witness; ``holds`` says only that the search has found none."""
    status = STATUS[found.status]
    fields = {
        "result": found.status,
        "reason": found.reason,
        "margin": found.margin if math.isfinite(found.margin) else None,
        "trajectories": found.trajectories,
        "tried": [{key: _finite(value) for key, value in asdict(agent).items()} for agent in found.tried],
        "seed": seed,
        "witness": None if found.witness is None else found.witness.to_json(),
    }
    return Outcome(status, fields, f"{found.status}: {found.reason}")


def _finite(value: float) -> float | None:
    """JSON has no infinity."""
    return value if math.isfinite(value) else None
