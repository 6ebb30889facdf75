"""Trajectories drawn with matplotlib: every function takes axes (or makes them) and returns the axes it drew on.

Colours are those of Okabe and Ito, which colour-blind readers tell apart; after eight agents the line style changes
too.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from sims.closed_loop import Trajectory
from sims.signals import Array

OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
_LINE_STYLES = ("-", "--", "-.", ":")
_LEGEND_LIMIT = 12
_ERROR_FLOOR = 1e-16


def plot_outputs(trajectory: Trajectory, ax: Axes | None = None) -> Axes:
    """Outputs ``y_i(t)`` and the optimum ``s*`` (dashed)."""
    ax = _draw(trajectory.t, trajectory.y, "y", ax)
    return _finish(_optimum(trajectory, ax), "output $y_i$", len(trajectory.y))


def plot_references(trajectory: Trajectory, ax: Axes | None = None) -> Axes:
    """The coordinator's references ``y^r_i(t)`` and the optimum ``s*`` (dashed)."""
    ax = _draw(trajectory.t, trajectory.reference, "y^r", ax)
    return _finish(_optimum(trajectory, ax), "reference $y^r_i$", len(trajectory.reference))


def plot_inputs(trajectory: Trajectory, ax: Axes | None = None) -> Axes:
    """Inputs ``u_i(t)``: saturated feedback plus the internal model's output.

    The limits show what follows the first fiftieth of the run; a higher peak at the start is written above the axes.
    """
    ax = _draw(trajectory.t, trajectory.u, "u", ax)
    later = trajectory.u[:, trajectory.t > trajectory.t[-1] / 50]
    later = later[np.isfinite(later)]
    peak = float(np.nanmax(np.abs(trajectory.u)))
    if later.size and peak > 3 * np.abs(later).max():
        margin = 0.1 * np.ptp(later) + 1e-9
        ax.set_ylim(later.min() - margin, later.max() + margin)
        agent, sample = np.unravel_index(np.nanargmax(np.abs(trajectory.u)), trajectory.u.shape)
        where = f"$|u_{{{agent + 1}}}|$ = {peak:.3g} at $t$ = {trajectory.t[sample]:.3g} s"
        ax.annotate(where, (0.0, 1.0), (2, 3), "axes fraction", "offset points", fontsize="small")
    return _finish(ax, "input $u_i$", len(trajectory.agents))


def plot_tracking_error(trajectory: Trajectory, ax: Axes | None = None) -> Axes:
    """``|y_i(t) − s*|`` on a logarithmic axis; the floor is the rounding of floats, 1e-16."""
    ax = _draw(trajectory.t, np.maximum(trajectory.error, _ERROR_FLOOR), "y", ax)
    ax.set_yscale("log")
    return _finish(ax, r"tracking error $|y_i - s^\star|$", len(trajectory.y))


def _draw(t: Array, signals: Array, name: str, ax: Axes | None) -> Axes:
    if ax is None:
        _, ax = plt.subplots(layout="constrained")
    for i, signal in enumerate(signals):
        style = _LINE_STYLES[i // len(OKABE_ITO) % len(_LINE_STYLES)]
        base, _, exponent = name.partition("^")
        label = f"${base}_{{{i + 1}}}^{{{exponent}}}$" if exponent else f"${base}_{{{i + 1}}}$"
        ax.plot(t, signal, color=OKABE_ITO[i % len(OKABE_ITO)], linestyle=style, linewidth=1.2, label=label)
    return ax


def _optimum(trajectory: Trajectory, ax: Axes) -> Axes:
    ax.axhline(trajectory.optimum, color="black", linestyle="--", linewidth=0.9, label=r"$s^\star$")
    return ax


def _finish(ax: Axes, ylabel: str, agents: int) -> Axes:
    ax.set_xlabel("time $t$ [s]")
    ax.set_ylabel(ylabel)
    ax.grid(True, linewidth=0.4, alpha=0.5)
    ax.margins(x=0.0)
    if agents <= _LEGEND_LIMIT:
        ax.legend(ncols=2, fontsize="small", frameon=False)
    return ax
