"""``certify init``: a plant file to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from reports.command_line.arguments import JsonOption
from reports.command_line.outcome import Outcome, finish
from reports.command_line.outputs import STANDARD_OUTPUT, deliver, require_file
from symbolic.errors import InputError


def command(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="A plant of the gallery.", show_default=False)
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Plant file to write; else stdout.", show_default=False),
    ] = None,
    listing: Annotated[bool, typer.Option("--list", help="Name the plants of the gallery.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Write a plant file to begin with.

    Without NAME a small one that explains every key. A file that exists is never overwritten.
    """
    from symbolic.gallery import gallery, gallery_text, summary

    if listing:
        if name is not None or output is not None:
            raise InputError("--list: names the gallery; leave out NAME and -o, or leave out --list")
        about = {one: summary(one) for one in gallery()}
        width = max(map(len, about), default=0)
        text = "\n".join(f"{one:<{width}}  {what}".rstrip() for one, what in about.items())
        finish(Outcome("holds", {"gallery": about}, text), as_json)
    text = gallery_text(name)
    if output is None or output == STANDARD_OUTPUT:
        finish(Outcome("holds", {"name": name, "file": None, "text": text}, text), as_json)
    if output.exists():
        raise InputError(f"{output}: it exists already, and init overwrites nothing; choose another name")
    require_file(output, as_json)
    deliver(output, (_directive() + text).encode())
    said = f"{output} written; next: certify check {output}"
    finish(Outcome("holds", {"name": name, "file": str(output), "text": text}, said), as_json)


def _directive() -> str:
    """Tells editors that know Taplo's directive where the schema of this installation is."""
    from symbolic.schema import FILE

    return f"#:schema {FILE.resolve().as_uri()}\n"
