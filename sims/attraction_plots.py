"""Slices of the region of attraction and bounds over time, drawn: axes in, or made, and axes out.

The colours are those of Okabe and Ito, and every fate has a mark of its own.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from sims.attraction import CONVERGES, ESCAPES, STAYS, UNKNOWN, RegionSlice
from sims.bounds import ERROR, SignalBound
from sims.signals import Array
from symbolic.plant import Interval

LOOKS = {
    CONVERGES: ("o", "#56B4E9", "converges"),
    STAYS: ("s", "#E69F00", "does not converge"),
    ESCAPES: ("x", "#D55E00", "escapes"),
    UNKNOWN: (".", "#999999", "not decided"),
}
_VISIBLE = 0.05


def plot_region(found: RegionSlice, ax: Axes | None = None, *, size: float = 14.0, legend: bool = True) -> Axes:
    """Simulated fates as marks (shape and colour) and the certified box as a frame, in the user's coordinates.

    ``size`` is the area of a mark in points². A box too small to be seen is pointed at.
    """
    if ax is None:
        _, ax = plt.subplots(layout="constrained")
    a, b = np.meshgrid(found.first, found.second)
    for fate, (mark, colour, label) in LOOKS.items():
        here = found.fates == fate
        if here.any():
            ax.scatter(a[here], b[here], s=size, marker=mark, color=colour, linewidths=0.06 * size, label=label)
    one, two = found.certified
    corner, width, height = (float(one.lo), float(two.lo)), float(one.hi - one.lo), float(two.hi - two.lo)
    ax.add_patch(Rectangle(corner, width, height, fill=False, edgecolor="black", linewidth=1.4, label="certified box"))
    places = zip((found.first, found.second), (width, height), strict=True)
    if min(side / np.ptp(values) for values, side in places) < _VISIBLE:
        middle = (corner[0] + width / 2, corner[1] + height / 2)
        ax.plot(*middle, marker="+", color="black", markersize=7, markeredgewidth=1.4)
    ax.set_xlabel(_label(found.names[0]))
    ax.set_ylabel(_label(found.names[1]))
    ax.set_xlim(*_limits(found.first))
    ax.set_ylim(*_limits(found.second))
    ax.set_title(
        f"agent {found.agent}, {found.parameters} vertices of $W$" if legend else f"agent {found.agent}", pad=3.0
    )
    if legend:
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4, fontsize="small", frameon=False)
    return ax


def plot_box(ax: Axes, first: Interval, second: Interval, label: str = "box of the plant file") -> None:
    """A dashed frame, beside the certified one of :func:`plot_region`."""
    corner, width, height = (
        (float(first.lo), float(second.lo)),
        float(first.hi - first.lo),
        float(second.hi - second.lo),
    )
    ax.add_patch(
        Rectangle(corner, width, height, fill=False, edgecolor="black", linewidth=0.9, linestyle="--", label=label)
    )


def plot_bounds(t: Array, runs: Array, bound: SignalBound, ax: Axes | None = None) -> Axes:
    """``|signal|`` of several runs, shape ``(runs, times)``, under a bound that is a step function of time."""
    if ax is None:
        _, ax = plt.subplots(layout="constrained")
    for k, run in enumerate(runs):
        ax.plot(t, np.abs(run), color="#0072B2", linewidth=0.6, alpha=0.6, label="simulated" if k == 0 else None)
    ax.step(t, bound.at(t), where="post", color="#D55E00", linewidth=1.6, label="certified bound")
    name = r"y - s^\star" if bound.signal == ERROR else f"{bound.signal[0]}_{{{bound.signal[1:]}}}"
    ax.set_xlabel("time $t$ [s]")
    ax.set_ylabel(f"$|{name}|$, agent {bound.agent}")
    ax.set_yscale("log")
    ax.grid(True, linewidth=0.4, alpha=0.5)
    ax.legend(fontsize="small", frameon=False)
    return ax


def _limits(places: Array) -> tuple[float, float]:
    half = (places[1] - places[0]) / 2
    return float(places[0] - half), float(places[-1] + half)


def _label(name: str) -> str:
    return f"${name[0]}_{{{name[1:]}}}(0)$"
