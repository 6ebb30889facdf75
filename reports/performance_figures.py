"""Pictures an engineer looks for: the input with its limit, the tube in the plane, the open loop with its margins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from certify.statement.bounds import ProvedBounds
from certify.statement.claim import CertifiedGains
from certify.statement.tube import Tube
from reports.figures import style
from sims.closed_loop import Trajectory
from sims.loop_response import LoopResponse
from symbolic.plant import Plant

DRAWN_UP_TO = 6
COLUMNS = 3
PANEL = (2.3, 1.6)
BOUND, RUN, LIMIT = "#1f4e79", "#D55E00", "#9b2226"
BOXES = 24  # of a tube, drawn at times that grow by a ratio
LOOPS_UP_TO = 4


def input_figure(found: ProvedBounds, plant: Plant, runs: Sequence[Trajectory], horizon: float) -> Figure:
    """``u_i`` of the runs between its proved peaks, and the limit that was asked for, over time on a square-root scale
    that shows the start."""
    agents = found.agents[:DRAWN_UP_TO]
    with style():
        figure, panels = _panels(len(agents))
        for axes, agent in zip(panels, agents, strict=False):
            peak, limit = float(agent.input.peak), plant.requirements_of(agent.id).input
            for k, run in enumerate(runs):
                u = run.agents[agent.id - 1].u
                axes.plot(run.t, u, color=RUN, linewidth=0.6, alpha=0.8, label="simulated runs" if k == 0 else None)
            for sign in (1.0, -1.0):
                label = "proved peak" if sign > 0 else None
                axes.axhline(sign * peak, color=BOUND, linewidth=1.0, label=label)
                if limit is not None:
                    label = "limit" if sign > 0 else None
                    axes.axhline(sign * float(limit), color=LIMIT, linestyle="--", linewidth=1.0, label=label)
            axes.set_xscale("function", functions=(np.sqrt, np.square))
            axes.set_xlim(0.0, horizon)
            axes.set_title(f"agent {agent.id}", pad=3.0)
        figure.supxlabel("time $t$ [s]", fontsize=9)
        figure.supylabel("input $u$", fontsize=9)
        _legend(figure, panels[0])
    return figure


def tube_figure(certified: CertifiedGains, plant: Plant, runs: Sequence[Trajectory]) -> Figure | None:
    """The boxes of the tube in ``(x1 − y^r, x2)``, and the runs inside; ``None`` if no agent has both states."""
    chosen = [index for index, agent in enumerate(plant.agents) if agent.order > 1][:DRAWN_UP_TO]
    if not chosen:
        return None
    with style():
        figure, panels = _panels(len(chosen))
        for axes, index in zip(panels, chosen, strict=False):
            agent, tube = plant.agents[index], certified.agents[index].tube
            if tube is not None:
                _boxes(axes, tube, len(agent.zero_states))
            for k, run in enumerate(runs):
                x = run.agents[index].x
                label = "simulated runs" if k == 0 else None
                axes.plot(x[0] - run.reference[index], x[1], color=RUN, linewidth=0.7, alpha=0.9, label=label)
            axes.set_title(f"agent {agent.id}", pad=3.0)
        figure.supxlabel("$x_1 - y^r$", fontsize=9)
        figure.supylabel("$x_2$", fontsize=9)
        _legend(figure, panels[0])
    return figure


def _boxes(axes: Axes, tube: Tube, zeros: int) -> None:
    count = len(tube.states)
    places = sorted({round(place) for place in np.geomspace(1, count, BOXES)})
    for k, place in enumerate(places):
        first, second = (float(size) for size in tube.states[place - 1][zeros : zeros + 2])
        shade = 0.15 + 0.85 * k / max(len(places) - 1, 1)
        axes.add_patch(
            Rectangle(
                (-first, -second),
                2 * first,
                2 * second,
                fill=False,
                edgecolor=BOUND,
                alpha=shade,
                linewidth=0.6,
                label="boxes of the tube, later ones darker" if k == len(places) - 1 else None,
            )
        )
    axes.autoscale_view()


def loop_figure(responses: Sequence[LoopResponse]) -> Figure:
    """Bode and Nyquist diagrams, one row per agent, one line per corner of ``W``."""
    shown = responses[:LOOPS_UP_TO]
    with style():
        figure = Figure(figsize=(6.9, 1.75 * len(shown) + 0.2), layout="constrained")
        rows = np.atleast_2d(figure.subplots(len(shown), 3))
        for (size, phase, nyquist), found in zip(rows, shown, strict=True):
            for values in found.values:
                size.loglog(found.frequencies, np.abs(values), color=BOUND, linewidth=0.6, alpha=0.7)
                angle = np.degrees(np.unwrap(np.angle(values)))
                phase.semilogx(found.frequencies, angle, color=BOUND, linewidth=0.6, alpha=0.7)
                nyquist.plot(values.real, values.imag, color=BOUND, linewidth=0.6, alpha=0.7)
            size.axhline(1.0, color=RUN, linewidth=0.6)
            size.set_ylabel(f"agent {found.agent}: $|L|$")
            phase.axhline(-180.0, color=RUN, linewidth=0.6)
            phase.set_ylabel("phase [°]")
            nyquist.plot(-1.0, 0.0, marker="+", color=RUN)
            nyquist.set_xlim(-3.0, 1.5)
            nyquist.set_ylim(-2.25, 2.25)
            nyquist.set_ylabel(r"Im $L$")
        rows[-1][0].set_xlabel(r"$\omega$ [rad/s]")
        rows[-1][1].set_xlabel(r"$\omega$ [rad/s]")
        rows[-1][2].set_xlabel(r"Re $L$")
    return figure


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(PANEL[0] * columns, PANEL[1] * rows + 0.45), layout="constrained")
    panels = list(np.atleast_1d(figure.subplots(rows, columns)).ravel())
    for axes in panels[count:]:
        axes.remove()
    return figure, panels


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
