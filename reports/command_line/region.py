"""``certify region``: the largest boxes of starts that are certified with the gains of a certificate."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from certify.files import write_together
from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.drawing import prepare_drawing
from reports.command_line.inputs import given_pair
from reports.command_line.outcome import Outcome, finish, json_text, naming
from reports.command_line.outputs import require_output_folder
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from certify.region import CertifiedBox, CertifiedRegion
    from sims.attraction import RegionSlice
    from symbolic.plant import Agent, Plant

PICTURE, PLANT, CERTIFICATE, NUMBERS = "region.svg", "region.toml", "certificate.json", "region.json"


def command(
    plant: PlantArgument,
    certificate: CertificateArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="Folder for region.svg, region.json, and a plant file region.toml with its certificate.json.",
            show_default=False,
        ),
    ] = None,
    simulated: Annotated[
        bool | None,
        typer.Option(
            "--simulate/--no-simulate",
            help="Simulate the region beside the box, for its share: minutes; else with -o only.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """The largest box of starts that is certified with these gains: all sides by one factor, and each side alone.

    Every box is proved by a certificate of its own, for a plant file that differs in [initial] alone. The simulated
    region beside it is an estimate.
    """
    if output is not None:
        require_output_folder(output)
    file, proof = given_pair(plant, certificate)
    loaded = file.as_plant()
    prepare_drawing()
    from certify.region import NoRegion, certified_region
    from reports.command_line.study_steps import started, with_certificate

    steps = Steps()
    study = with_certificate(started(loaded, []), proof, steps)
    if study.verified_certificate is None:
        reason = (study.verification or {}).get("reason") or "the certificate does not verify"
        finish(Outcome("rejected", {"reason": reason}, f"rejected: {reason}"), as_json)
    with steps.step("region") as report, naming(file.name):
        found = certified_region(loaded, study.verified_certificate, report.progress)
        report("not decided" if isinstance(found, NoRegion) else _sentence(found))
    if isinstance(found, NoRegion):
        finish(Outcome("inconclusive", {"reason": found.reason}, f"inconclusive: {found.reason}"), as_json)
    beside = output is not None if simulated is None else simulated
    slices = _slices(found.uniform, steps) if beside and found.uniform is not None else ()
    fields = {"reason": _sentence(found), **region_fields(loaded, found, slices)}
    if output is not None:
        write_together(output, _files(loaded, found, slices, fields))
    finish(
        Outcome("certified", fields, "\n".join([*_lines(loaded, found, slices), "certified: each box by itself"])),
        as_json,
    )


def _sentence(found: CertifiedRegion) -> str:
    if found.uniform is None:
        return "no box larger than the plant file's own was certified with one factor for all sides"
    factors = [max(row) for row in found.uniform.factors]
    least, most = float(min(factors)), float(max(factors))
    return f"the plant file's box times {least:.4g}" + (f" to {most:.4g}" if most > least else "")


def region_fields(plant: Plant, found: CertifiedRegion, slices: Sequence[RegionSlice]) -> dict[str, Any]:
    """Proved boxes as exact numbers; ``estimates`` are simulated."""
    from reports.attraction import attraction_details

    axes = [one for one in found.axes if one is not None]
    return {
        "uniform": None if found.uniform is None else _box(found.uniform),
        "axes": [_box(one) for one in axes],
        "stopped": [{"id": agent.id, "reason": why} for agent, why in zip(plant.agents, found.stopped, strict=True)],
        "estimates": {"region_of_attraction": attraction_details(slices)},
    }


def _box(found: CertifiedBox) -> dict[str, Any]:
    from certify.certificate import claim_digest

    return {
        "claim_sha256": claim_digest(found.certificate),
        "agents": [
            {
                "id": agent.id,
                "factors": dict(zip(_names(agent), map(str, row), strict=True)),
                "box": {name: [str(side.lo), str(side.hi)] for name, side in _sides(agent)},
            }
            for agent, row in zip(found.plant.agents, found.factors, strict=True)
        ],
    }


def _names(agent: Agent) -> list[str]:
    return [*map(str, agent.zero_states), *map(str, agent.chain)]


def _sides(agent: Agent) -> list[tuple[str, Any]]:
    return list(zip(_names(agent), (*agent.initial.z, *agent.initial.x), strict=True))


def _lines(plant: Plant, found: CertifiedRegion, slices: Sequence[RegionSlice]) -> list[str]:
    from sims.attraction import coverage

    lines = []
    for index, agent in enumerate(plant.agents):
        grown = agent if found.uniform is None else found.uniform.plant.agents[index]
        box = " × ".join(f"{name} [{float(side.lo):.4g}, {float(side.hi):.4g}]" for name, side in _sides(grown))
        factor = Fraction(1) if found.uniform is None else max(found.uniform.factors[index])
        alone = [
            f"{name} {float(one.factors[index][k]):.3g}"
            for k, (name, one) in enumerate(zip(_names(agent), found.axes, strict=False))
            if one is not None and k < len(one.factors[index]) and one.factors[index][k] > 1
        ]
        lines.append(f"agent {agent.id}: times {float(factor):.4g}: {box}")
        if found.stopped[index]:
            lines.append(f"agent {agent.id}: what stops a larger box: {found.stopped[index]}")
        if alone:
            lines.append(f"agent {agent.id}, one side alone: times {', '.join(alone)}")
    for part in slices:
        share = coverage(part)
        if share.converging:
            plane = ", ".join(part.names)
            lines.append(f"agent {part.agent}: {100 * share.fraction:.2g} % of the simulated region in ({plane})")
    return lines


def _slices(found: CertifiedBox, steps: Steps) -> tuple[RegionSlice, ...]:
    """The simulated region in planes through the larger boxes."""
    from certify.certificate import claim_digest
    from reports.command_line.certified_steps import with_slices
    from reports.study import Study

    answer = {"status": "verified", "claim_sha256": claim_digest(found.certificate), "reason": ""}
    return with_slices(Study(found.plant, certificate=found.certificate, verification=answer), steps).slices


def _files(
    plant: Plant, found: CertifiedRegion, slices: Sequence[RegionSlice], fields: dict[str, Any]
) -> dict[str, bytes | None]:
    """``None`` for what an earlier run may have left and this one lacks."""
    from certify.certificate import certificate_bytes
    from reports.attraction import attraction_figure
    from reports.figures import svg

    own = {agent.id: dict(_sides(agent)) for agent in plant.agents}
    uniform = found.uniform
    return {
        NUMBERS: (json_text({"status": "certified", **fields}) + "\n").encode(),
        PLANT: None if uniform is None else uniform.plant.source,
        CERTIFICATE: None if uniform is None else certificate_bytes(uniform.certificate),
        PICTURE: svg(attraction_figure(slices, own)).encode() if slices else None,
    }
