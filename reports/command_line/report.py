"""``certify report``: the PDF on a plant and a certificate."""

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
        typer.Option("-o", "--output", metavar="FILE.pdf", help="PDF to write (- for stdout).", show_default=False),
    ],
    as_json: JsonOption = False,
) -> None:
    """Verify a certificate and write the PDF on it and its plant."""
    require_file(output, as_json, ".pdf")
    file, proof = given_pair(plant, certificate)
    loaded = file.as_plant()
    from reports.door import reported

    with naming(file.name):
        made = reported(loaded, proof, ["report", plant, certificate, "-o", output], Steps())
    document = deliver(output, made.pdf)
    finish(Outcome(made.status, {"reason": made.reason, "verified": made.verified}, made.said()[0]), as_json, document)
