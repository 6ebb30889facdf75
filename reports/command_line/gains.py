"""``certify gains``: a certificate, or the reason why there is none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from certify.files import require_writable
from reports.command_line.arguments import JsonOption, PlantArgument, Route, RouteOption
from reports.command_line.outcome import Outcome, finish
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from certify.pipeline import GainsResult


def command(
    plant: PlantArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="CERT", help="Certificate to write.", show_default=False)
    ],
    route: RouteOption = Route.RECIPE,
    as_json: JsonOption = False,
) -> None:
    """Find gains and write the certificate that proves them; or decide the gains of the plant file."""
    from certify.certificate import write_certificate
    from certify.pipeline import design_gains
    from symbolic.plant_file import load_plant

    loaded = load_plant(plant)
    require_writable(output)
    with Steps().step("gains") as report:
        result = design_gains(loaded, route=route.value, progress=report)
        report(result.status)
    if result.certificate is not None:
        write_certificate(result.certificate, output)
    finish(outcome(result), as_json)


def outcome(result: GainsResult) -> Outcome:
    """The summary as JSON, and the gains as a table."""
    fields = {key: value for key, value in result.summary.items() if key != "status"}
    return Outcome(result.status, {**fields, "reason": result.reason}, f"{result.status}: {result.reason}")
