"""``certify derive``: steady states, internal models, error coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from reports.command_line.arguments import JsonOption, PlantArgument
from reports.command_line.inputs import given_plant
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from symbolic.derivation import Derivation
    from symbolic.plant import Plant


def command(
    plant: PlantArgument,
    latex: Annotated[bool, typer.Option("--latex", help="Print LaTeX (needs amsmath).")] = False,
    as_json: JsonOption = False,
) -> None:
    """Derive z*, u*, the internal models and the error coordinates."""
    from symbolic.derivation import as_dict, as_latex, as_text

    file = given_plant(plant)
    derivation = derived(file.as_plant(), file.name, Steps())
    fields = as_dict(derivation)
    if latex:
        fields["latex"] = as_latex(derivation)
    text = as_latex(derivation) if latex else as_text(derivation)
    finish(Outcome(derivation.verdict, fields, text), as_json)


def derived(plant: Plant, file: str, steps: Steps) -> Derivation:
    """The derivation for the exact optimum, or for the symbol s where the optimum is not rational or not known."""
    from certify.derivation import derivation_at_optimum

    with steps.step("derive") as report, naming(file):
        derivation = derivation_at_optimum(plant)
        report(derivation.verdict)
    return derivation
