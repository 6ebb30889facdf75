"""``certify report``: the PDF on a plant and a certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument


def command(
    plant: PlantArgument,
    certificate: CertificateArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE.pdf", help="PDF to write.", show_default=False)
    ],
    as_json: JsonOption = False,
) -> None:
    """Write the PDF on a plant and a certificate that exists."""
    raise NotImplementedError
