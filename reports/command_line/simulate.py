"""``certify simulate``: closed-loop trajectories and plots."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from certify.files import write_together
from reports.command_line.arguments import FolderOption, JsonOption, PlantArgument
from reports.command_line.derive import derived
from reports.command_line.drawing import prepare_drawing
from reports.command_line.inputs import given_pair, given_plant
from reports.command_line.outcome import Outcome, finish, naming
from reports.command_line.outputs import require_output_folder
from reports.command_line.steps import Steps
from reports.command_line.verify import controller_of

if TYPE_CHECKING:
    from sims.closed_loop import Trajectory
    from symbolic.derivation import Derivation
    from symbolic.plant import Plant

LAST = 0.05  # of the run, over which the error at its end is taken: a single instant may be a zero of an oscillation


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
    from reports.command_line.demonstration import demonstration_controller
    from reports.command_line.study_steps import started, with_certificate
    from sims.closed_loop import simulate
    from sims.deadline import settled_run

    steps = Steps()
    answer = None
    if proof is None:
        derivation = derived(loaded, file.name, steps)
        reason = obstacle(loaded, derivation)
        if reason:
            finish(Outcome("inconclusive", {"reason": reason}, f"inconclusive: {reason}"), as_json)
        controller = demonstration_controller(loaded, derivation)
    else:
        study = with_certificate(started(loaded, []), proof, steps)
        answer, controller = study.verification, controller_of(study, proof, as_json)
    with steps.step("simulate") as report, naming(file.name):
        trajectory = (
            settled_run(loaded, controller) if horizon is None else simulate(loaded, controller, horizon=horizon)
        )
        report(sentence(trajectory))
    with steps.step("plots"):
        write_together(output, {"trajectory.csv": table(trajectory).encode(), **plots(trajectory)})
    finish(outcome(trajectory, answer), as_json)


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


def outcome(trajectory: Trajectory, answer: Mapping[str, str] | None) -> Outcome:
    """``simulated``, whatever was seen, unless that contradicts a claim; ``rejected`` where the checker rejects it.

    ``answer`` is the checker's on the certificate whose gains these are, ``None`` where nothing is claimed.
    """
    status, reason = "simulated", sentence(trajectory)
    if trajectory.status == "failed":
        status = "inconclusive"
    elif answer is not None and trajectory.status == "escaped":
        status = "refuted"
    if answer is not None and answer["status"] == "rejected" and status != "refuted":
        status, reason = "rejected", f"the checker rejects the certificate: {answer['reason']}; simulated: {reason}"
    error = trajectory.final_error(LAST * trajectory.end)
    fields = {
        "reason": reason,
        "certificate": None if answer is None else dict(answer),
        "run": trajectory.status,
        "optimum": trajectory.optimum,
        "final_error": error if error < float("inf") else None,
        "end": trajectory.end,
    }
    return Outcome(status, fields, f"{status}: {reason}")


def sentence(trajectory: Trajectory) -> str:
    """How the run ended, for people."""
    if trajectory.status != "completed":
        return f"{trajectory.status}: {trajectory.reason}"
    error = trajectory.final_error(LAST * trajectory.end)
    return (
        f"max |y_i - s*| = {error:.2e} over the last twentieth of {trajectory.end:.4g} s, s* = {trajectory.optimum:.6g}"
    )


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
