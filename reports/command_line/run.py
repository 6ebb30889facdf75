"""``certify run``: everything, from the plant file to the PDF."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from certify.files import make_folder, write_atomically
from certify.routes import DEFAULT
from reports.command_line.arguments import FolderOption, JsonOption, PlantArgument, RouteOption, SchedulerOption
from reports.command_line.drawing import prepare_drawing
from reports.command_line.gains import gains_table
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from reports.study import Study

CERTIFICATE, REPORT, SUMMARY, WITNESS = "certificate.json", "report.pdf", "summary.json", "witness.json"
PICTURE = "region.svg"


def command(
    plant: PlantArgument,
    output: FolderOption,
    route: RouteOption = DEFAULT,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Do everything below and write the report.

    Check, derive, find gains, verify, simulate, search for counterexamples. DIR gets report.pdf, summary.json,
    certificate.json if there is one, region.svg if an agent has two plant states, witness.json if a trajectory breaks
    the claim.
    """
    from symbolic.plant_file import load_plant

    loaded = load_plant(plant)
    make_folder(output)
    prepare_drawing()
    from reports.command_line.study_steps import started
    from reports.document import build_report

    steps = Steps()
    with naming(plant):
        begun = started(loaded, ["run", plant, "-o", output, "--route", route])
        study = studied(begun, plant, output, route, steps, scheduler)
    with steps.step("report") as report:
        build_report(study, output / REPORT)
        report(str(output / REPORT))
    result = outcome(study)
    write_atomically(output / SUMMARY, (result.as_json() + "\n").encode())
    finish(result, as_json)


def studied(study: Study, plant: Path, folder: Path, route: str, steps: Steps, scheduler: str | None = None) -> Study:
    """All steps up to the report; what a failed assumption makes pointless is left out."""
    from certify.certificate import write_certificate
    from reports.attraction import attraction_figure
    from reports.command_line import study_steps as step
    from reports.command_line.certified_steps import with_region, with_runs, with_search, with_slices
    from reports.figures import svg

    file = folder / CERTIFICATE
    study = step.with_check(study, steps)
    study = step.with_derivation(study, plant, steps)
    study = step.with_gains(study, route, steps)
    certificate = study.gains.certificate if study.gains else None
    if certificate is None:
        file.unlink(missing_ok=True)  # that of an earlier run would not belong to this report
    else:
        write_certificate(certificate, file)
        study = step.with_certificate(study, certificate, plant, file, steps)
    study = step.with_simulation(study, steps)
    study = with_runs(with_region(study, steps), steps)
    study = with_slices(study, steps, scheduler)
    if study.slices:
        write_atomically(folder / PICTURE, svg(attraction_figure(study.slices)).encode())
    else:
        (folder / PICTURE).unlink(missing_ok=True)
    study = with_search(study, steps, scheduler)
    witness = None if study.search is None else study.search.broken
    if witness is None:
        (folder / WITNESS).unlink(missing_ok=True)
    else:
        write_atomically(folder / WITNESS, witness.text().encode())
    return study


def outcome(study: Study) -> Outcome:
    """The conclusion of the report's first page, with the gains and the claim it is about."""
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
