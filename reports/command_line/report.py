"""``certify report``: the PDF on a plant and a certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from certify.files import require_writable
from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.drawing import prepare_drawing
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.steps import Steps


def command(
    plant: PlantArgument,
    certificate: CertificateArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE.pdf", help="PDF to write.", show_default=False)
    ],
    as_json: JsonOption = False,
) -> None:
    """Verify a certificate and write the PDF on it and its plant."""
    from certify.certificate import read_certificate
    from symbolic.plant_file import load_plant

    loaded = load_plant(plant)
    read = read_certificate(certificate)
    require_writable(output)
    prepare_drawing()
    from reports.command_line import study_steps as step
    from reports.command_line.certified_steps import with_region, with_runs
    from reports.document import build_report
    from reports.study import conclusion

    steps = Steps()
    study = step.started(loaded, ["report", plant, certificate, "-o", output])
    study = step.with_certificate(study, read, plant, certificate, steps)
    with naming(plant):
        study = step.with_check(study, steps)
        study = step.with_derivation(study, plant, steps)
        study = step.with_simulation(study, steps)
        study = with_runs(with_region(study, steps), steps)
    with steps.step("report"):
        build_report(study, output)
    found = conclusion(study)
    text = f"{found.status}: {found.reason}" if found.reason else found.status
    finish(Outcome(found.status, {"reason": found.reason, "verified": found.verified}, text), as_json)
