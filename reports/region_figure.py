"""The proved settling envelope drawn with a simulated trajectory below it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from certify.statement.bounds import ProvedBounds
from reports.figures import style
from sims.closed_loop import Trajectory
from symbolic.plant import Plant

DRAWN_UP_TO = 12
COLUMNS = 3
PANEL = (2.3, 1.55)
BOUND, RUN, ASKED = "#1f4e79", "#D55E00", "#9b2226"
DECADES = 7


def settling_figure(region: ProvedBounds, plant: Plant, runs: Sequence[Trajectory], horizon: float) -> Figure:
    """``|y_i − s*|`` over ``[0, horizon]`` seconds, logarithmic: the bound and the runs, which must stay below, and the
    band that is required from some time on."""
    agents = region.agents[:DRAWN_UP_TO]
    columns = min(COLUMNS, len(agents))
    rows = -(-len(agents) // columns)
    with style():
        figure = Figure(figsize=(PANEL[0] * columns, PANEL[1] * rows + 0.45), layout="constrained")
        panels = np.atleast_1d(figure.subplots(rows, columns, sharey=True)).ravel()
        t = np.linspace(0.0, horizon, 2000)
        top = 3.0 * max(float(agent.error.peak) for agent in agents)
        for axes, agent in zip(panels, agents, strict=False):
            axes.fill_between(t, agent.error.at(t), top, color=BOUND, alpha=0.08, linewidth=0.0)
            axes.plot(t, agent.error.at(t), color=BOUND, linewidth=1.2, label=r"proved bound of $|y_i - s^\star|$")
            for k, run in enumerate(runs):
                error = np.maximum(run.error[agent.id - 1], 1e-16)
                axes.plot(run.t, error, color=RUN, linewidth=0.6, alpha=0.8, label="simulated runs" if k == 0 else None)
            asked = plant.requirements_of(agent.id).settling
            if asked is not None:
                time, band = float(asked.time), float(asked.band)
                axes.plot(
                    [time, time, max(horizon, time)], [top, band, band], color=ASKED, linestyle="--", label="required"
                )
            axes.set_yscale("log")
            axes.set_title(f"agent {agent.id}", pad=3.0)
            axes.set_ylim(top / 10**DECADES, top)
            axes.set_xlim(0.0, horizon)
        for axes in panels[len(agents) :]:
            axes.remove()
        figure.supxlabel("time $t$ [s]", fontsize=9)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure
