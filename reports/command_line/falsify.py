"""``certify falsify``: search for a trajectory that breaks the claim."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument, SchedulerOption
from reports.command_line.inputs import given_pair
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.outputs import deliver, require_file
from reports.command_line.steps import Steps
from reports.runs import BUDGET

if TYPE_CHECKING:
    from reports.answers import Falsification

    pass


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
    from reports.door import SearchOptions, falsified

    options = SearchOptions(budget, seed, horizon, agents, fast, scheduler)
    with naming(file.name):
        found = falsified(loaded, proof, options, Steps())
    made = None
    if output is not None and found.found is not None and found.found.witness is not None:
        made = deliver(output, found.found.witness.text().encode())
    finish(outcome(found), as_json, made)


def outcome(answer: Falsification) -> Outcome:
    """``refuted`` with the witness; else ``rejected`` where the checker rejects the certificate, whatever survived."""
    found = answer.found
    fields: dict[str, object] = {"reason": answer.reason, "certificate": dict(answer.certificate)}
    if found is not None:
        fields |= {
            "result": found.status,
            "searched": found.reason,
            "margin": found.margin if math.isfinite(found.margin) else None,
            "trajectories": found.trajectories,
            "tried": [{key: _finite(value) for key, value in asdict(agent).items()} for agent in found.tried],
            "seed": answer.seed,
            "witness": None if found.witness is None else found.witness.to_json(),
        }
    return Outcome(answer.status, fields, "\n".join(answer.said()))


def _finite(value: float) -> float | None:
    """JSON has no infinity."""
    return value if math.isfinite(value) else None
