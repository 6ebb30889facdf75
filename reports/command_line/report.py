"""``certify report``: the PDF, or the interactive page, on a plant and a certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.inputs import given_pair
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.outputs import deliver, require_file
from reports.command_line.steps import Steps


def command(
    plant: PlantArgument,
    certificate: CertificateArgument,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="FILE.pdf (- for stdout), or FILE.html for the interactive page.",
            show_default=False,
        ),
    ],
    as_json: JsonOption = False,
) -> None:
    """Verify a certificate and write the report on it and its plant, as PDF or as a page to look into."""
    require_file(output, as_json, ".pdf", ".html")
    file, proof = given_pair(plant, certificate)
    loaded = file.as_plant()
    from reports.answers import is_page
    from reports.door import reported

    with naming(file.name):
        steps = Steps()
        made = reported(loaded, proof, ["report", plant, certificate, "-o", output], steps, page=is_page(output))
        with steps.step("report"):
            written = made.as_file(output)
    document = deliver(output, written)
    finish(Outcome(made.status, {"reason": made.reason, "verified": made.verified}, made.said()[0]), as_json, document)
