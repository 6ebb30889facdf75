"""``certify check``: the assumptions A0 … A6."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reports.command_line.arguments import JsonOption, PlantArgument
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from certify.assumptions.findings import CheckReport, Finding


def command(plant: PlantArgument, as_json: JsonOption = False) -> None:
    """Decide the assumptions A0 … A6, with the evidence for each."""
    from symbolic.plant_file import load_plant

    loaded = load_plant(plant)
    from certify.assumptions.check import check_assumptions

    with Steps().step("check") as report, naming(plant):
        checked = check_assumptions(loaded)
        report(checked.status)
    finish(outcome(checked), as_json)


def outcome(checked: CheckReport) -> Outcome:
    """The report as JSON, and as one line per finding."""
    lines = [_line(finding) for finding in checked.findings]
    return Outcome(
        checked.status,
        {"assumptions": [finding.as_json() for finding in checked.findings]},
        "\n".join([*lines, f"assumptions: {checked.status}"]),
    )


def _line(finding: Finding) -> str:
    where = "network" if finding.agent is None else f"agent {finding.agent}"
    return f"{finding.id}  {where:<9} {finding.verdict:<8} {finding.reason}"
