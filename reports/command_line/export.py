"""``certify export``: the controller of a verified certificate as code."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from certify.files import write_together
from reports.command_line.arguments import CertificateArgument, FolderOption, JsonOption, PlantArgument
from reports.command_line.inputs import given_pair
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.outputs import require_output_folder
from reports.command_line.steps import Steps
from symbolic.errors import InputError

if TYPE_CHECKING:
    from reports.answers import Export

TARGETS = ("c", "python", "fmi")


def command(
    plant: PlantArgument,
    certificate: CertificateArgument,
    to: Annotated[str, typer.Option("--to", metavar="[c|python|fmi]", help="Kind of code.", show_default=False)],
    output: FolderOption,
    period: Annotated[
        str | None, typer.Option(metavar="T", help="Sampling period, exact: 1/1000 or 0.001.", show_default=False)
    ] = None,
    coordinator_period: Annotated[
        str | None, typer.Option(metavar="T", help="Period of the messages, a multiple of it.", show_default=False)
    ] = None,
    arithmetic: Annotated[
        str | None, typer.Option(metavar="[double|single]", help="Of the agents' steps.", show_default=False)
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Write the controller of a certificate as code, with the digest of the claim.

    A certificate that the checker does not accept is not exported. Periods that neither the plant file nor an option
    names are chosen by a rule of thumb; nothing is proved about sampling unless the certificate's theorem says so.
    """
    if to not in TARGETS:
        raise InputError(f"--to: {to[:40]!r} is not one of {', '.join(TARGETS)}")
    periods = _positive("--period", period), _positive("--coordinator-period", coordinator_period)
    kind = _arithmetic(arithmetic)
    require_output_folder(output)
    file, proof = given_pair(plant, certificate)
    loaded = file.as_plant()
    from certify.export.package import Options
    from reports.exporting import exported

    with naming(file.name):
        made = exported(loaded, proof, to, Options(*periods, kind), Steps())
    if made.package is not None:
        write_together(output, dict(made.files))
    finish(outcome(made), as_json)


def outcome(made: Export) -> Outcome:
    """What was written and what is proved about it."""
    names, text = sorted(made.files), "\n".join(made.said())
    if made.package is None:
        return Outcome(made.status, {"reason": made.reason, "files": names}, text)
    programs = made.package.programs
    fields = {
        "reason": made.reason,
        "claim_sha256": made.package.digest,
        "theorem": made.package.theorem,
        "periods": {str(program.id): str(program.period) for program in programs},
        "coordinator_period": str(programs[0].period * programs[0].substeps),
        "notice": list(made.package.notice),
        "files": names,
    }
    return Outcome(made.status, fields, "\n".join([*names, text]))


_PERIOD = re.compile(r"[0-9]{1,30}/[0-9]{1,30}|[0-9]{1,30}(\.[0-9]{1,30})?([eE][+-]?[0-9]{1,3})?")


def _positive(option: str, text: str | None) -> Fraction | None:
    """An exact positive number, ``1/1000`` or ``0.001``."""
    if text is None:
        return None
    try:
        value = Fraction(text) if _PERIOD.fullmatch(text) else Fraction(0)
    except ZeroDivisionError:
        value = Fraction(0)
    if value <= 0:
        raise InputError(f"{option}: a positive number such as 1/1000 or 0.001 is needed, not {text[:40]!r}")
    return value


def _arithmetic(text: str | None) -> Literal["double", "single"] | None:
    match text:
        case None | "double" | "single":
            return text
    raise InputError(f"--arithmetic: {text[:40]!r} is not one of double, single")
