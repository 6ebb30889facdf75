"""``certify report``: the PDF on a plant and a certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.drawing import prepare_drawing
from reports.command_line.inputs import given_pair
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.outputs import deliver, require_file
from reports.command_line.steps import Steps


def command(
    plant: PlantArgument,
    certificate: CertificateArgument,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE.pdf", help="PDF to write (- for stdout).", show_default=False),
    ],
    as_json: JsonOption = False,
) -> None:
    """Verify a certificate and write the PDF on it and its plant."""
    require_file(output, as_json, ".pdf")
    file, proof = given_pair(plant, certificate)
    loaded = file.as_plant()
    prepare_drawing()
    from reports.command_line import study_steps as step
    from reports.command_line.certified_steps import with_region, with_runs
    from reports.document import build_report
    from reports.study import conclusion

    steps = Steps()
    study = step.started(loaded, ["report", plant, certificate, "-o", output])
    study = step.with_certificate(study, proof, steps)
    with naming(file.name):
        study = step.with_check(study, steps)
        study = step.with_derivation(study, file.name, steps)
        study = step.with_simulation(study, steps)
        study = with_runs(with_region(study, steps), steps)
    with steps.step("report"):
        made = deliver(output, build_report(study))
    found = conclusion(study)
    text = f"{found.status}: {found.reason}" if found.reason else found.status
    finish(Outcome(found.status, {"reason": found.reason, "verified": found.verified}, text), as_json, made)
