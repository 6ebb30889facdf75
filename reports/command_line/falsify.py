"""``certify falsify``: search for a trajectory that breaks the claim."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from sims.falsifier import FalsifierResult
    from symbolic.controller import Controller
    from symbolic.plant import Plant

BUDGET = 1000


def command(
    plant: PlantArgument,
    certificate: CertificateArgument,
    budget: Annotated[int, typer.Option(help="Trajectories for each agent, about.", min=1, max=10**7)] = BUDGET,
    seed: Annotated[int, typer.Option(help="The same seed gives the same search.", min=0, max=2**32)] = 0,
    as_json: JsonOption = False,
) -> None:
    """Search for a trajectory that breaks the claim. Finding none proves nothing: the exit code is then 3."""
    from certify.certificate import read_certificate
    from symbolic.plant_file import load_plant

    loaded = load_plant(plant)
    read = read_certificate(certificate)
    from reports.command_line.controllers import certified_controller

    controller = certified_controller(read, loaded, str(certificate))
    with Steps().step("falsify") as report, naming(plant):
        found = searched(loaded, controller, budget, seed, report)
        report(found.reason)
    finish(outcome(found, seed), as_json)


def searched(
    plant: Plant, controller: Controller, budget: int, seed: int, progress: Callable[[str], None]
) -> FalsifierResult:
    """About ``budget`` trajectories for each agent, in floats."""
    from sims.falsifier import falsify

    return falsify(plant, controller, budget=budget, seed=seed, progress=progress)


def outcome(found: FalsifierResult, seed: int) -> Outcome:
    """``refuted`` with the witness, else ``inconclusive``: surviving a search proves nothing."""
    status = "refuted" if found.status == "refuted" else "inconclusive"
    fields = {
        "reason": found.reason,
        "search": found.status,
        "trajectories": found.trajectories,
        "seed": seed,
        "witness": None if found.witness is None else found.witness.to_json(),
    }
    witness = "" if found.witness is None else found.witness.text()
    return Outcome(status, fields, f"{witness}{status}: {found.reason}")
