"""``certify check``: the assumptions A0 … A6."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reports.command_line.arguments import JsonOption, PlantArgument
from reports.command_line.inputs import given_plant
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from certify.assumptions.findings import CheckReport


def command(plant: PlantArgument, as_json: JsonOption = False) -> None:
    """Decide the assumptions A0 … A6, with the evidence for each."""
    file = given_plant(plant)
    loaded = file.as_plant()
    from certify.assumptions.check import check_assumptions

    with Steps().step("check") as report, naming(file.name):
        checked = check_assumptions(loaded)
        report(checked.status)
    finish(outcome(checked), as_json)


def outcome(checked: CheckReport) -> Outcome:
    """The report as JSON, and as one line per reason with the agents it is true of."""
    return Outcome(checked.status, checked.as_json(), "\n".join(checked.said()))
