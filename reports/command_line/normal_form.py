"""``certify normal-form``: a model as people have it, as a plant file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from reports.command_line.arguments import JsonOption
from reports.command_line.inputs import given_plant
from reports.command_line.outcome import Outcome, finish
from reports.command_line.outputs import deliver, require_file
from reports.command_line.steps import Steps
from symbolic.errors import one_line

ModelArgument = Annotated[
    Path, typer.Argument(metavar="MODEL", help="Model file (TOML); - for stdin.", show_default=False)
]


def command(
    model: ModelArgument,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="PLANT", help="Plant file to write (- for stdout).", show_default=False),
    ],
    as_json: JsonOption = False,
) -> None:
    """Bring models ẋ = f + g u, y = h into the normal form of plant files.

    By Lie derivatives, where the change of coordinates is global and its inverse is found; refused with the reason
    otherwise. The initial box is carried over by enclosure.
    """
    from symbolic.models.model_file import read_model

    require_file(output, as_json)
    file = given_plant(model)
    with Steps().step("normal form") as report:
        found = read_model(file.data, file.name)
        report("found")
    coordinates = {
        str(number): {str(new): str(expr) for new, expr in form.coordinates.items()}
        for number, form in sorted(found.forms.items())
    }
    lines = [f"agent {number}: {new} = {expr}" for number, row in coordinates.items() for new, expr in row.items()]
    header = "".join(f"# {line}\n" for line in [f"in normal form from {one_line(file.name)}, with", *lines])
    made = deliver(output, header.encode() + b"\n" + found.plant.source)
    finish(Outcome("holds", {"coordinates": coordinates}, "\n".join(lines)), as_json, made)
