"""``certify run``: everything, from the plant file to the PDF."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from certify.files import write_together
from certify.routes import DEFAULT
from reports.command_line.arguments import FolderOption, JsonOption, PlantArgument, RouteOption, SchedulerOption
from reports.command_line.drawing import prepare_drawing
from reports.command_line.inputs import given_plant
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.outputs import require_output_folder
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from reports.command_line.certified_steps import SearchOptions
    from reports.study import Study

CERTIFICATE, REPORT, SUMMARY, WITNESS = "certificate.json", "report.pdf", "summary.json", "witness.json"
PICTURE, PAGE = "region.svg", "report.html"


def command(
    plant: PlantArgument,
    output: FolderOption,
    route: RouteOption = DEFAULT,
    budget: Annotated[
        int | None,
        typer.Option(
            help="Trajectories that the search simulates of each agent; else 10 000 of all together.",
            min=1,
            max=10**7,
            show_default=False,
        ),
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Begin no further part of the search after that, but for the first of each agent.",
            min=0.001,
            show_default=False,
        ),
    ] = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Do everything below and write the report.

    Check, derive, find gains, verify, simulate, search for counterexamples. DIR gets report.pdf, report.html
    (the same to look into), summary.json, certificate.json if there is one, region.svg if an agent has two plant
    states, witness.json if a trajectory breaks the claim.
    """
    require_output_folder(output)
    file = given_plant(plant)
    loaded = file.as_plant()
    prepare_drawing()
    from reports.command_line.certified_steps import SearchOptions
    from reports.command_line.study_steps import started
    from reports.document import build_report
    from reports.interactive.page import build_page

    steps = Steps()
    with naming(file.name):
        begun = started(loaded, ["run", plant, "-o", output, "--route", route])
        study = studied(begun, file.name, route, steps, SearchOptions(budget, time_limit, scheduler))
    with steps.step("report") as report:
        pdf, page = build_report(study), build_page(study)
        report(str(output / REPORT))
    result = outcome(study)
    write_together(output, {**results(study), REPORT: pdf, PAGE: page, SUMMARY: (result.as_json() + "\n").encode()})
    finish(result, as_json)


def studied(study: Study, source: str, route: str, steps: Steps, search: SearchOptions) -> Study:
    """All steps up to the report; what a failed assumption makes pointless is left out."""
    from reports.command_line import study_steps as step
    from reports.command_line.certified_steps import with_region, with_runs, with_search, with_slices

    study = step.with_check(study, steps)
    study = step.with_derivation(study, source, steps)
    study = step.with_gains(study, route, steps)
    study = step.with_verification(study, steps)
    study = step.with_simulation(study, steps)
    study = with_runs(with_region(study, steps), steps)
    study = with_slices(study, steps, search.scheduler)
    return with_search(study, steps, search)


def results(study: Study) -> dict[str, bytes | None]:
    """The files beside report and summary; ``None`` for those that an earlier run may have left and this one lacks."""
    from certify.certificate import certificate_bytes
    from reports.attraction import attraction_figure
    from reports.figures import svg

    certificate = None if study.gains is None else study.gains.certificate
    witness = None if study.search is None else study.search.broken
    return {
        CERTIFICATE: None if certificate is None else certificate_bytes(certificate),
        PICTURE: svg(attraction_figure(study.slices)).encode() if study.slices else None,
        WITNESS: None if witness is None else witness.text().encode(),
    }


def outcome(study: Study) -> Outcome:
    """The conclusion of the report's first page, with the gains and the claim it is about."""
    from certify.statement.gains_table import gains_table
    from reports.cross_checked import search_fields
    from reports.designs import chosen_designs
    from reports.details import details
    from reports.study import conclusion

    found = conclusion(study)
    summary: Mapping[str, object] = study.gains.summary if study.gains else {}
    fields = {
        "reason": found.reason,
        "verified": found.verified,
        **{key: summary.get(key) for key in ("route", "gains", "claim")},
        "falsify": search_fields(study.search, len(study.plant.agents)),
        "details": details(study),
    }
    lines = gains_table(study.gains.summary["gains"] if study.gains else None)
    certificate = study.verified_certificate
    if certificate is not None:
        lines += chosen_designs(study.plant, certificate["claim"])
    said = found.reason or ("every obligation was proved, and the checker agrees" if found.verified else "not verified")
    return Outcome(found.status, fields, "\n".join([*lines, f"{found.status}: {said}"]))
