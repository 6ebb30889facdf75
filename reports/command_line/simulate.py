"""``certify simulate``: closed-loop trajectories and plots."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from certify.files import make_folder, write_atomically
from reports.command_line.arguments import FolderOption, JsonOption, PlantArgument
from reports.command_line.derive import derived
from reports.command_line.drawing import prepare_drawing
from reports.command_line.outcome import Outcome, finish
from reports.command_line.steps import Steps

if TYPE_CHECKING:
    from sims.closed_loop import Trajectory
    from symbolic.derivation import Derivation
    from symbolic.plant import Plant

SETTLED = 1e-2
HORIZON = 20.0


def command(
    plant: PlantArgument,
    output: FolderOption,
    certificate: Annotated[
        Path | None, typer.Argument(metavar="[CERT]", help="Certificate whose gains are simulated.", show_default=False)
    ] = None,
    horizon: Annotated[float, typer.Option(help="Length of the run in seconds.", min=0.001, max=1e6)] = HORIZON,
    as_json: JsonOption = False,
) -> None:
    """Simulate the closed loop in floats, which proves nothing.

    From the centre of the boxes, with the gains of CERT; without CERT with those of the plant file, and moderate ones
    where it fixes none. DIR gets trajectory.csv and four plots.
    """
    from certify.certificate import read_certificate
    from symbolic.plant_file import load_plant

    loaded = load_plant(plant)
    read = None if certificate is None else read_certificate(certificate)
    make_folder(output)
    prepare_drawing()
    from certify.statement.controller import certified_controller
    from reports.command_line.demonstration import demonstration_controller
    from sims.closed_loop import simulate

    steps = Steps()
    if read is None:
        derivation = derived(loaded, plant, steps)
        reason = obstacle(loaded, derivation)
        if reason:
            finish(Outcome("inconclusive", {"reason": reason}, f"inconclusive: {reason}"), as_json)
        controller = demonstration_controller(loaded, derivation)
    else:
        controller = certified_controller(read, loaded, str(certificate))
    with steps.step("simulate") as report:
        trajectory = simulate(loaded, controller, horizon=horizon)
        report(sentence(trajectory))
    with steps.step("plots"):
        write_atomically(output / "trajectory.csv", table(trajectory).encode())
        for name, picture in plots(trajectory).items():
            write_atomically(output / name, picture)
    finish(outcome(trajectory), as_json)


def obstacle(plant: Plant, derivation: Derivation) -> str:
    """Why the closed loop cannot be simulated; empty if it can.

    Without A2 some ``1/ξ_i^i`` grows for ever, and no integrator follows it; without A1 there may be no optimum.
    """
    from certify.assumptions.a1_costs import check_cost
    from certify.assumptions.a2_network import check_network

    for finding in (check_network(plant.digraph), *map(check_cost, plant.agents)):
        if finding.verdict == "fails":
            return f"not simulated, {finding.id} fails: {finding.reason}"
    if derivation.verdict != "holds":
        return "not simulated: no steady state or no internal model was found (see certify derive)"
    return ""


def outcome(trajectory: Trajectory) -> Outcome:
    """``holds`` if all outputs ended near s*, ``refuted`` if a state escaped; neither is a proof."""
    status = {"completed": "inconclusive", "escaped": "refuted", "failed": "inconclusive"}[trajectory.status]
    error = trajectory.final_error(window=1.0)
    reason = sentence(trajectory)
    if error <= SETTLED:
        status = "holds"
    elif trajectory.status == "completed":
        reason += f"; it is settled below {SETTLED:g}, so try a longer --horizon"
    fields = {
        "reason": reason,
        "optimum": trajectory.optimum,
        "final_error": error if error < float("inf") else None,
        "end": trajectory.end,
    }
    return Outcome(status, fields, f"{status}: {reason}")


def sentence(trajectory: Trajectory) -> str:
    """How the run ended, for people."""
    if trajectory.status != "completed":
        return f"{trajectory.status}: {trajectory.reason}"
    error = trajectory.final_error(window=1.0)
    return f"max |y_i - s*| = {error:.2e} over the last second of {trajectory.end:g} s, s* = {trajectory.optimum:.6g}"


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
