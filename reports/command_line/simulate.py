"""``certify simulate``: closed-loop trajectories and plots."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from certify.files import write_together
from reports.command_line.arguments import FolderOption, JsonOption, PlantArgument
from reports.command_line.drawing import prepare_drawing
from reports.command_line.inputs import given_pair, given_plant
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.outputs import require_output_folder
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from reports.answers import Simulation
    from sims.closed_loop import Trajectory


def command(
    plant: PlantArgument,
    output: FolderOption,
    certificate: Annotated[
        Path | None,
        typer.Argument(
            metavar="[CERT]", help="Certificate whose gains are simulated; - for stdin.", show_default=False
        ),
    ] = None,
    horizon: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Length of the run; else until the outputs have settled.",
            min=1e-9,
            max=1e12,
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Simulate the closed loop in floats, which proves nothing.

    From the centre of the boxes, with the gains of CERT, after the word of the checker on it; without CERT with those
    of the plant file, and moderate ones where it fixes none. DIR gets trajectory.csv and four plots.
    """
    require_output_folder(output)
    file, proof = (given_plant(plant), None) if certificate is None else given_pair(plant, certificate)
    loaded = file.as_plant()
    prepare_drawing()
    from reports.door import simulated

    steps = Steps()
    with naming(file.name):
        found = simulated(loaded, proof, horizon, steps)
    if found.trajectory is not None:
        with steps.step("plots"):
            files = {"trajectory.csv": table(found.trajectory).encode(), **plots(found.trajectory)}
            write_together(output, files)
    finish(outcome(found), as_json)


def outcome(found: Simulation) -> Outcome:
    """What was seen, and what the checker says where something is claimed."""
    fields: dict[str, object] = {"reason": found.reason}
    if found.certificate is not None or found.trajectory is not None:
        fields["certificate"] = None if found.certificate is None else dict(found.certificate)
    if found.trajectory is not None:
        fields |= {
            "run": found.trajectory.status,
            "optimum": found.trajectory.optimum,
            "final_error": found.final_error,
            "end": found.trajectory.end,
        }
    return Outcome(found.status, fields, f"{found.status}: {found.reason}")


def table(trajectory: Trajectory) -> str:
    """The outputs, references and inputs over time as CSV."""
    numbers = [agent.id for agent in trajectory.agents]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["t", *(f"{name}{i}" for name in ("y", "yr", "u") for i in numbers)])
    writer.writerows(zip(trajectory.t, *trajectory.y, *trajectory.reference, *trajectory.u, strict=True))
    return text.getvalue()


def plots(trajectory: Trajectory) -> dict[str, bytes]:
    """The plots as PNG, by file name."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    from sims.plots import plot_inputs, plot_outputs, plot_references, plot_tracking_error

    drawings = {
        "outputs.png": plot_outputs,
        "references.png": plot_references,
        "inputs.png": plot_inputs,
        "tracking_error.png": plot_tracking_error,
    }
    pictures = {}
    for name, draw in drawings.items():
        figure, axes = plt.subplots(figsize=(6.4, 4.0), dpi=150, layout="constrained")
        draw(trajectory, axes)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png")
        plt.close(figure)
        pictures[name] = buffer.getvalue()
    return pictures
