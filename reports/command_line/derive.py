"""``certify derive``: steady states, internal models, error coordinates."""

from __future__ import annotations

from typing import Annotated

import typer

from reports.command_line.arguments import JsonOption, PlantArgument
from reports.command_line.outcome import Outcome, finish
from reports.command_line.steps import Steps


def command(
    plant: PlantArgument,
    latex: Annotated[bool, typer.Option("--latex", help="Print LaTeX.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Derive z*, u*, the internal models and the error coordinates."""
    from certify.optimum import optimum
    from symbolic.derivation import as_dict, as_latex, as_text, derive
    from symbolic.plant_file import load_plant

    loaded = load_plant(plant)
    with Steps().step("derive"):
        derivation = derive(loaded, optimum(loaded).exact)
        text = as_latex(derivation) if latex else as_text(derivation)
    finish(Outcome("holds", as_dict(derivation), text), as_json)
