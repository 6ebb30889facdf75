"""The certified set against what simulations show: a grid of starts on a plane, coverage, bounds over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from sims.agent_loop import AgentLoop, agent_loop, upper_layer
from sims.batch import COMPLETED, ESCAPED, BatchOptions
from sims.bounds import ERROR, SignalBound
from sims.fate import BROKEN, judge, windows
from sims.search_space import AgentPoint, SharedPoint, agent_box, agent_point, shared_points
from sims.signals import Array
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Interval, Plant

CONVERGES, STAYS, ESCAPES, UNKNOWN = 0, 1, 2, 3
_LOOKS = {
    CONVERGES: ("o", "#0072B2", "converges"),
    STAYS: ("s", "#E69F00", "does not converge"),
    ESCAPES: ("x", "#D55E00", "escapes"),
    UNKNOWN: (".", "#999999", "not decided"),
}
_PROBABILITY = 1.959963984540054  # of the normal distribution: 95 % within


@dataclass(frozen=True)
class RegionSlice:
    """Fates of a grid of starts of agent ``agent`` in the plane of two plant states, the rest at the box's centre.

    ``fates`` has shape ``(len(second), len(first))`` of 0 converges, 1 stays away, 2 escapes, 3 not decided: the worst
    over the vertices of ``W`` that were tried, ``parameters`` in number. ``certified`` are the claim's sides.
    """

    agent: int
    names: tuple[str, str]
    first: Array
    second: Array
    fates: NDArray[np.int8]
    certified: tuple[Interval, Interval]
    parameters: int


@dataclass(frozen=True)
class Coverage:
    """The part of the simulated region that the certified box covers: ``inside`` of ``converging`` sampled starts, with
    a Wilson interval ``[low, high]`` of 95 %.
    """

    inside: int
    converging: int
    low: float
    high: float

    @property
    def fraction(self) -> float:
        return self.inside / self.converging if self.converging else math.nan


def region_slice(
    plant: Plant,
    controller: Controller,
    agent: int,
    names: tuple[str, str],
    spans: tuple[tuple[float, float], tuple[float, float]],
    *,
    points: int = 31,
    vertices: int = 8,
    seed: int = 0,
    horizon: float = 40.0,
    compiled: bool = False,
) -> RegionSlice:
    """``points × points`` starts over ``spans``, each for up to ``vertices`` vertices of ``W``.

    ``names`` are plant states (``z1``, ``x2``). Raises ``InputError`` for a state that the agent does not have.
    """
    loop = agent_loop(plant, controller, agent)
    rows = [_row(loop, name) for name in names]
    first, second = (np.linspace(low, high, points) for low, high in spans)
    grid = [(float(a), float(b)) for b in second for a in first]
    generator = np.random.default_rng(seed)
    corners = _parameter_corners(loop, vertices, generator)
    starts = [_moved(loop, corner, dict(zip(rows, place, strict=True))) for corner in corners for place in grid]
    fates = _fates(loop, starts, shared_points(plant, generator, 2, 0)[0], horizon, compiled)
    sides = (*loop.agent.initial.z, *loop.agent.initial.x)
    return RegionSlice(
        agent=agent,
        names=names,
        first=first,
        second=second,
        fates=fates.reshape(len(corners), points, points).max(axis=0),
        certified=(sides[rows[0]], sides[rows[1]]),
        parameters=len(corners),
    )


def coverage(found: RegionSlice) -> Coverage:
    """How much of the slice's converging starts lies in the certified box.

    The grid's points are taken as independent samples of the slice for the interval.
    """
    a, b = np.meshgrid(found.first, found.second)
    one, two = found.certified
    inside = (a >= float(one.lo)) & (a <= float(one.hi)) & (b >= float(two.lo)) & (b <= float(two.hi))
    good = found.fates == CONVERGES
    hits, total = int((inside & good).sum()), int(good.sum())
    return Coverage(hits, total, *wilson(hits, total))


def wilson(hits: int, total: int) -> tuple[float, float]:
    """The Wilson interval of 95 % for ``hits`` of ``total``; all of ``[0, 1]`` without samples."""
    if total == 0:
        return 0.0, 1.0
    z2 = _PROBABILITY**2
    share = hits / total
    middle = (share + z2 / (2 * total)) / (1 + z2 / total)
    half = _PROBABILITY * math.sqrt(share * (1 - share) / total + z2 / (4 * total**2)) / (1 + z2 / total)
    return max(0.0, middle - half), min(1.0, middle + half)


def plot_region(found: RegionSlice, ax: Axes | None = None) -> Axes:
    """Simulated fates as marks (shape and colour) and the certified box as a frame."""
    if ax is None:
        _, ax = plt.subplots(layout="constrained")
    a, b = np.meshgrid(found.first, found.second)
    for fate, (mark, colour, label) in _LOOKS.items():
        here = found.fates == fate
        if here.any():
            ax.scatter(a[here], b[here], s=14, marker=mark, color=colour, linewidths=0.9, label=label)
    one, two = found.certified
    corner, width, height = (float(one.lo), float(two.lo)), float(one.hi - one.lo), float(two.hi - two.lo)
    ax.add_patch(Rectangle(corner, width, height, fill=False, edgecolor="black", linewidth=1.8, label="certified box"))
    ax.set_xlabel(_label(found.names[0]))
    ax.set_ylabel(_label(found.names[1]))
    ax.set_title(f"agent {found.agent}, {found.parameters} vertices of $W$", fontsize="medium")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4, fontsize="small", frameon=False)
    return ax


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


def _label(name: str) -> str:
    return f"${name[0]}_{{{name[1:]}}}(0)$"


def _row(loop: AgentLoop, name: str) -> int:
    names = [str(symbol) for symbol in (*loop.agent.zero_states, *loop.agent.chain)]
    if name not in names:
        raise InputError(f"agent {loop.agent.id} has no plant state {name}; it has {', '.join(names)}")
    return names.index(name)


def _parameter_corners(loop: AgentLoop, limit: int, generator: np.random.Generator) -> list[AgentPoint]:
    """The centre of the initial box with vertices of ``W``."""
    box, count = agent_box(loop.agent, loop.law), len(loop.agent.parameters)
    free = sum(k < count for k in box.free)
    rest = [0.5] * (len(box.free) - free)
    cubes = list(np.ndindex(*(2,) * free)) if 2**free <= limit else generator.integers(2, size=(limit, free)).tolist()
    points = [box.point([*map(float, cube), *rest]) for cube in cubes]
    return [agent_point(loop.agent, loop.law, point) for point in points]


def _moved(loop: AgentLoop, point: AgentPoint, values: dict[int, float]) -> AgentPoint:
    z, x = list(point.z), list(point.x)
    for row, value in values.items():
        if row < len(z):
            z[row] = Fraction(value)
        else:
            x[row - len(z)] = Fraction(value)
    measured = loop.agent.order > 1 and loop.agent.initial.observer is None
    observer = (x[0], *(Fraction(0),) * (len(x) - 1)) if measured else point.observer
    return replace(point, z=tuple(z), x=tuple(x), observer=observer)


def _fates(
    loop: AgentLoop, starts: Sequence[AgentPoint], shared: SharedPoint, horizon: float, compiled: bool
) -> NDArray[np.int8]:
    frame = windows(loop.plant, horizon)
    signals = loop.signals([upper_layer(loop.plant, loop.controller, shared, horizon)])
    options = BatchOptions(max_steps=20_000, compiled=compiled)
    fates = []
    for k in range(0, len(starts), 1024):
        part = starts[k : k + 1024]
        solution = loop.run(signals, [0] * len(part), part, horizon, frame.times, options)
        error = solution.samples[:, loop.output_row] - loop.optimum
        told = [judge(row, frame, 1e-4) for row in error]
        fates += [_mark(int(status), fate) for status, fate in zip(solution.status, told, strict=True)]
    return np.array(fates, dtype=np.int8)


def _mark(status: int, fate: str) -> int:
    if status == ESCAPED:
        return ESCAPES
    if status != COMPLETED:
        return UNKNOWN
    return CONVERGES if fate == "converged" else STAYS if fate in BROKEN else UNKNOWN
