"""The simulation section: what was simulated, with which gains, and the plots."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from certify.statement.claim import CertifiedGains
from certify.statement.numbers import scientific
from reports import cells
from reports.coordinator_section import constants
from reports.figures import style, svg
from reports.tables import grouped
from reports.typst_math import number, number_text
from sims.closed_loop import Trajectory
from sims.plots import plot_inputs, plot_outputs, plot_references, plot_tracking_error
from symbolic.controller import AgentController, Controller

WIDTH, HEIGHT = 6.9, 3.9
LEGEND_UP_TO = 12
PANELS = (plot_outputs, plot_references, plot_inputs, plot_tracking_error)


REJECTED = {
    "lead": "The certificate does not stand.",
    "certified": False,
    "exponent": None,
    "remark": cells.text(
        "The plots use the gains that the plant file fixes and demonstration gains for the others. Nothing is proved "
        "about any of them."
    ),
}


def simulation_section(
    trajectory: Trajectory,
    simulated: Controller | None,
    certified: CertifiedGains | None,
    seed: int | None,
    stands: bool = True,
) -> dict[str, Any]:
    """The data of ``simulation.typ``; ``stands`` says that nothing speaks against the certificate."""
    groups = [] if simulated is None else grouped(simulated.agents, _gains)
    remark = _remark(simulated, certified) if stands else REJECTED
    return {
        "svg": svg(trajectory_figure(trajectory)),
        **remark,
        "gains": _shared_gains(simulated, groups),
        "table": [
            [cells.text(cells.agents(law.id for law in group)), *map(_number, _gains(group[0]))] for group in groups
        ]
        if len(groups) > 1 and not remark["certified"]
        else None,
        "coordinator": [] if simulated is None else constants(simulated.coordinator),
        "failure": None
        if trajectory.status == "completed"
        else cells.text(f"The run {trajectory.status}: {trajectory.reason}"),
        "facts": _facts(trajectory, seed),
    }


def trajectory_figure(trajectory: Trajectory) -> Figure:
    """Outputs, references, inputs and tracking error, with one legend for all; sizes in inches."""
    with style():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        for axes, plot in zip(figure.subplots(2, 2).flat, PANELS, strict=True):
            plot(trajectory, axes)
            legend = axes.get_legend()
            if legend is not None:
                legend.remove()
        agents = len(trajectory.agents)
        if agents <= LEGEND_UP_TO:
            lines = figure.axes[0].get_lines()
            labels = [f"agent {agent.id}" for agent in trajectory.agents]
            figure.legend(
                lines[: agents + 1], [*labels, r"$s^\star$"], loc="outside lower center", ncols=min(agents + 1, 7)
            )
    return figure


def _gains(law: AgentController) -> tuple[Any, ...]:
    return (law.g, law.K, law.delta, law.h)


def _number(value: Any) -> cells.Cell:
    return cells.number(value)


def _shared_gains(simulated: Controller | None, groups: Sequence[Sequence[AgentController]]) -> str | None:
    """``(g, K, h) = (5, 100, 500), δ = 1000, α1 = 5, α2 = 5`` if the agents share their gains."""
    if simulated is None or len(groups) != 1:
        return None
    law = groups[0][0]
    named = {"g": law.g, "K": law.K} | ({} if law.h is None else {"h": law.h})
    values = ", ".join(number(value) for value in named.values())
    shared = ", ".join(constants(simulated.coordinator))
    return f"({', '.join(named)}) = ({values}), quad delta = {number(law.delta)}, quad {shared}"


def _remark(simulated: Controller | None, certified: CertifiedGains | None) -> dict[str, Any]:
    """Whether the plots show the certified controller, in plain words."""
    if certified is None:
        return {
            "lead": "No certificate.",
            "certified": False,
            "exponent": None,
            "remark": cells.text(
                "The plots use the gains that the plant file fixes and demonstration gains for the others. "
                "They illustrate; they prove nothing."
            ),
        }
    if simulated is not None and certified.same_as(simulated):
        return {
            "lead": "The certified gains.",
            "certified": True,
            "exponent": None,
            "remark": cells.text("The plots illustrate; the certificate proves."),
        }
    return {
        "lead": "Not the certified gains.",
        "certified": False,
        "exponent": certified.largest_exponent if certified.too_large else None,
        "remark": cells.text(
            "The plots use demonstration gains, not those of the certificate. They show how the closed loop "
            "behaves with gains of ordinary size; they prove nothing, and the certificate does not "
            "speak of these gains."
        ),
    }


def _estimate(value: float) -> cells.Cell:
    """A float of a simulation to two digits."""
    return cells.math(number_text(scientific(Fraction(value), 2))) if np.isfinite(value) else cells.text("–")


def _facts(trajectory: Trajectory, seed: int | None) -> list[list[Any]]:
    finite = np.isfinite(trajectory.error).all(axis=0)
    last = float(trajectory.error[:, finite][:, -1].max()) if finite.any() else float("nan")
    saturated = float(trajectory.saturated_fraction.max())
    facts = [
        ["Horizon", cells.text(f"{trajectory.t[-1]:g} s, {trajectory.status}")],
        [
            f"$max_i abs(y_i - s^star.op)$ at {trajectory.t[finite][-1] if finite.any() else 0:g} s",
            _estimate(last),
        ],
        ["Longest saturated", cells.text(f"{100 * saturated:.3g} % of the time")],
    ]
    return facts if seed is None else [*facts, ["Seed", cells.text(seed)]]
