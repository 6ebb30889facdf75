"""``certify export``: the controller of a verified certificate as code."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from certify.files import temporary_folder, write_together
from reports.command_line.arguments import CertificateArgument, FolderOption, JsonOption, PlantArgument
from reports.command_line.inputs import given_pair
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.outputs import require_output_folder
from reports.command_line.steps import Steps
from symbolic.errors import InputError

if TYPE_CHECKING:
    from certify.export.package import Package
    from symbolic.plant import Plant

TARGETS = ("c", "python", "fmi")
RECORDED = 10_000  # samples of all agents in samples.txt, about
MOST_RECORDED = 50_000  # where it takes that many until the references move


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
        raise InputError(f"--to: {to!r} is not one of {', '.join(TARGETS)}")
    periods = _positive("--period", period), _positive("--coordinator-period", coordinator_period)
    kind = _arithmetic(arithmetic)
    require_output_folder(output)
    file, proof = given_pair(plant, certificate)
    loaded, read = file.as_plant(), proof.as_certificate()
    from reports.command_line.verify import announced

    steps = Steps()
    answer = announced(file, proof, steps)
    if answer["status"] != "verified":
        reason = f"not exported: the checker does not accept the certificate: {answer['reason']}"
        finish(Outcome("rejected", {"reason": reason, "files": []}, reason), as_json)
    from certify.export.package import Options, package
    from certify.statement.controller import certified_controller

    with steps.step("export") as report, naming(file.name):
        controller = certified_controller(read, loaded, proof.name)
        made = package(
            loaded, read["claim"], answer["claim_sha256"], str(read["theorem"]), controller, Options(*periods, kind)
        )
        files = _files(loaded, made, to)
        names = sorted(files)
        write_together(output, dict(files))
        report(f"{len(names)} files")
    fields = {
        "claim_sha256": made.digest,
        "theorem": read["theorem"],
        "periods": {str(p.id): str(p.period) for p in made.programs},
        "coordinator_period": str(made.programs[0].period * made.programs[0].substeps),
        "notice": list(made.notice),
        "files": names,
    }
    text = "\n".join([*names, *made.notice, f"claim {made.digest}"])
    finish(Outcome("verified", fields, text), as_json)


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


def _files(plant: Plant, made: Package, to: str) -> dict[str, bytes]:
    """The contents by name."""
    from certify.export.c_text import c_files
    from certify.export.package import json_text
    from certify.export.python_text import python_files

    texts = {"controller.json": json_text(made)}
    python = python_files(made.programs, made.digest, made.notice)
    if to == "fmi":
        from certify.export.fmi import fmi_files

        units = fmi_files(made.programs, made.digest, made.notice)
        return {**{name: text.encode() for name, text in texts.items()}, **units}
    if to == "python":
        texts |= python
    else:
        texts |= c_files(made.programs, made.digest, made.notice)
        texts["samples.txt"] = _samples(plant, made, python)
    return {name: text.encode() for name, text in texts.items()}


def _samples(plant: Plant, made: Package, python: dict[str, str]) -> str:
    """A run from the middle of the boxes, with what the exported Python writes, for the replay."""
    from sims.sampled_loop import centre, run_network

    per_round = sum(program.substeps for program in made.programs)
    moving = min(made.programs[0].coordinator.hold + 20, MOST_RECORDED // per_round)
    rounds = max(1, RECORDED // per_round, moving)
    with temporary_folder() as folder:
        make = {p.id: _agent(folder, f"agent{p.id}", python) for p in made.programs}
        periods = {p.id: p.period for p in made.programs}
        period = made.programs[0].period * made.programs[0].substeps
        run = run_network(plant, make, periods, period, centre(plant), rounds)
    return "\n".join(run.lines) + "\n"


def _agent(folder: Path, name: str, python: dict[str, str]) -> Callable[[float], Any]:
    (folder / f"{name}.py").write_text(python[f"{name}.py"], encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    assert spec is not None and spec.loader is not None  # a file that was just written
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    kind: Callable[[float], Any] = _kind(module)
    return kind


def _kind(module: ModuleType) -> Any:
    return module.Agent
