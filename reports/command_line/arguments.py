"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from certify.routes import ROUTES

PlantArgument = Annotated[
    Path, typer.Argument(metavar="PLANT", help="Plant file (TOML); - for stdin.", show_default=False)
]
CertificateArgument = Annotated[
    Path, typer.Argument(metavar="CERT", help="Certificate file (JSON); - for stdin.", show_default=False)
]
FolderOption = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write to.", show_default=False)
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]


def _route(name: str) -> str:
    if name not in ROUTES:
        raise typer.BadParameter(f"{name!r} is not one of {', '.join(ROUTES)}")
    return name


RouteOption = Annotated[
    str, typer.Option("--route", metavar=f"[{'|'.join(ROUTES)}]", parser=_route, help="How the gains are found.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler", metavar="ADDRESS", help="Dask scheduler to search on (extra cluster).", show_default=False
    ),
]
