"""``certify gains``: a certificate, or the reason why there is none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from certify.files import write_together
from certify.routes import DEFAULT
from reports.command_line.arguments import JsonOption, PlantArgument, RouteOption
from reports.command_line.drawing import prepare_drawing
from reports.command_line.inputs import given_plant
from reports.command_line.outcome import Outcome, finish, json_text, naming
from reports.command_line.outputs import deliver, require_file, require_output_folder
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from certify.pipeline import GainsResult
    from symbolic.plant import Plant


def command(
    plant: PlantArgument,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="CERT", help="Certificate to write (- for stdout).", show_default=False),
    ],
    route: RouteOption = DEFAULT,
    trade_off: Annotated[
        Path | None,
        typer.Option(
            "--trade-off",
            metavar="DIR",
            help="Folder for certified designs between settling time, input and bandwidth: picture, table, proofs.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Find gains and write the certificate that proves them.

    What [gains], [coordinator], observer, gamma and internal_model fix in the plant file is kept and decided as it is.
    """
    require_file(output, as_json)
    if trade_off is not None:
        require_output_folder(trade_off)
        prepare_drawing()
    file = given_plant(plant)
    loaded = file.as_plant()
    from certify.certificate import certificate_bytes
    from certify.pipeline import design_gains

    steps = Steps()
    with steps.step("gains") as report, naming(file.name):
        result = design_gains(loaded, route=route, progress=report.progress, share=report.share)
        report(result.status)
    made = None if result.certificate is None else deliver(output, certificate_bytes(result.certificate))
    said = outcome(result, loaded)
    if trade_off is not None and result.certificate is not None:
        said = _with_trade_off(said, result, loaded, trade_off, steps)
    finish(said, as_json, made)


def _with_trade_off(said: Outcome, result: GainsResult, plant: Plant, folder: Path, steps: Steps) -> Outcome:
    """The outcome with the designs around the certificate, which are written to the folder."""
    from certify.certificate import certificate_bytes
    from certify.trade_off import NoTradeOff, trade_off
    from reports.figures import svg
    from reports.trade_off import pasted, trade_off_fields, trade_off_figure, trade_off_lines

    with steps.step("trade-off") as report:
        found = trade_off(plant, result.certificate or {}, report.progress)
        report(found.reason if isinstance(found, NoTradeOff) else f"{len(found.networks)} certified designs")
    if isinstance(found, NoTradeOff):
        return Outcome(said.status, {**said.fields, "trade_off": []}, f"{said.text}\nno trade-off: {found.reason}")
    fields = trade_off_fields(found)
    files: dict[str, bytes | None] = {
        "trade-off.svg": svg(trade_off_figure(found, plant)).encode(),
        "trade-off.json": (json_text(fields) + "\n").encode(),
        "gains.toml": pasted(found).encode(),
    }
    for place, network in enumerate(found.networks, 1):
        files[f"design-{place}.json"] = certificate_bytes(network.certificate)
    write_together(folder, files)
    lines = "\n".join(trade_off_lines(found, plant))
    return Outcome(said.status, {**said.fields, "trade_off": fields}, f"{lines}\n{said.text}")


def outcome(result: GainsResult, plant: Plant) -> Outcome:
    """The summary as JSON, and the gains as a table."""
    from certify.statement.gains_table import gains_table
    from reports.designs import chosen_designs
    from reports.details import search_details

    designs = [] if result.certificate is None else chosen_designs(plant, result.certificate["claim"])
    table = gains_table(result.summary["gains"])
    lines = [*table, *designs, *_others(result, plant), f"{result.status}: {result.reason}"]
    fields = {**result.summary, "reason": result.reason, "details": {"agents": search_details(result)}}
    return Outcome(result.status, fields, "\n".join(lines))


def _others(result: GainsResult, plant: Plant) -> list[str]:
    """One line per other choice that passed."""
    from certify.statement.numbers import with_log10
    from reports.designs import design_lines

    lines = []
    for agent, described in zip(result.agents, plant.agents, strict=False):
        for other in agent.alternatives:
            law = other.controller
            named = {"g": law.g, "K": law.K, "delta": law.delta, "h": law.h}
            values = [f"{key} = {with_log10(value)}" for key, value in named.items() if value is not None]
            values += design_lines(described, law)
            lines.append(f"agent {agent.id}, {other.label}: {', '.join(values)} ({other.reason})")
    return lines
