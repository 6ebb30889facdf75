"""The charts of one agent as Plotly's figures: ``{"data": [traces], "layout": {…}}`` of plain JSON.

Solid lines are proved, thin ones simulated, dashed ones required. Colours are readable on light and dark pages.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from certify.statement.bounds import AgentBounds
from certify.statement.tube import Tube
from reports.interactive.samples import Values, bounds, chart_text, plain, thinned
from sims.attraction import CONVERGES, ESCAPES, STAYS, UNKNOWN, RegionSlice
from symbolic.plant import Agent, Requirements

if TYPE_CHECKING:
    from sims.closed_loop import Trajectory

Figure = dict[str, Any]
Trace = dict[str, Any]

PROVED, SIMULATED, REQUIRED = "#3b82c4", "#e07b28", "#c8405a"
FATES = (
    (CONVERGES, "converges", "circle", "#56b4e9"),
    (STAYS, "does not converge", "square", "#e69f00"),
    (ESCAPES, "escapes", "x", "#d55e00"),
    (UNKNOWN, "not decided", "circle-open", "#999999"),
)
BOXES = 60  # of a tube, drawn at times that grow by a ratio
TAIL_POINTS = 40
DECADES = 7
LEAST = 1e-16  # drawn in place of 0 on a logarithmic axis


def error_chart(
    found: AgentBounds, asked: Requirements, runs: Sequence[Trajectory], horizon: float, points: int
) -> Figure:
    """``|y − s*|`` over time: the proved bound, the runs below it, the band that is required."""
    t, bound = _envelope(found, horizon)
    traces = [_line(t, bound, PROVED, "proved bound", width=2.2, shape="hv")]
    for k, run in enumerate(runs):
        values = np.maximum(run.error[found.id - 1], LEAST)
        kept = thinned(np.log(values), points)
        traces.append(_line(plain(run.t[kept]), plain(values[kept]), SIMULATED, "simulated runs", first=k == 0))
    top = 3.0 * float(found.error.peak)
    if asked.settling is not None:
        time, band = float(asked.settling.time), float(asked.settling.band)
        traces.append(
            _line(plain([time, time, max(horizon, time)]), plain([top, band, band]), REQUIRED, "required", dash="dash")
        )
    low = np.log10(top) - DECADES
    return {
        "data": traces,
        "layout": _layout("time t", "|y − s*|")
        | {
            "yaxis": {
                "title": {"text": "|y − s*|"},
                "type": "log",
                "range": [low, np.log10(top)],
                "exponentformat": "power",
            }
        },
    }


def _envelope(found: AgentBounds, horizon: float) -> tuple[Values, Values]:
    """The steps of the bound, and its exponential end."""
    error = found.error
    t: Values = [float(time) for time in error.times]
    bound: Values = list(bounds(error.values))
    end = float(error.times[-1])
    if horizon > end:
        late = np.linspace(end, horizon, TAIL_POINTS)
        # on a stretch of the staircase that falls the value at its left end holds
        t += plain(late[1:])
        bound += plain(error.at(late[1:]) * (1 + 1e-5))
    return t, bound


def input_chart(
    found: AgentBounds, asked: Requirements, runs: Sequence[Trajectory], horizon: float, points: int
) -> Figure:
    """``u`` over time between its proved peaks, and the limit that is required."""
    traces = []
    for k, run in enumerate(runs):
        u = run.agents[found.id - 1].u
        kept = thinned(u, points)
        traces.append(_line(plain(run.t[kept]), plain(u[kept]), SIMULATED, "simulated runs", first=k == 0))
    (peak,) = bounds([found.input.peak])
    levels = [(peak, PROVED, "proved peak", "solid")]
    if asked.input is not None:
        levels.append((float(asked.input), REQUIRED, "required limit", "dash"))
    for level, colour, name, dash in levels:
        for sign in (1.0, -1.0):
            traces.append(_line([0.0, horizon], [sign * level] * 2, colour, name, width=1.8, dash=dash, first=sign > 0))
    return {"data": traces, "layout": _layout("time t", "input u")}


def tube_chart(agent: Agent, tube: Tube, runs: Sequence[Trajectory], points: int) -> Figure | None:
    """The boxes of the tube in ``(x1 − y^r, x2)`` with the runs inside; ``None`` for an agent without ``x2``."""
    if agent.order < 2:
        return None
    zeros = len(agent.zero_states)
    count = len(tube.states)
    chosen = sorted({round(place) - 1 for place in np.geomspace(1, count, min(BOXES, count))})
    x: Values = []
    y: Values = []
    said: list[str] = []
    for place in chosen:
        first, second = bounds(tube.states[place][zeros : zeros + 2])
        x += [-first, first, first, -first, -first, None]
        y += [-second, -second, second, second, -second, None]
        start = f"{float(tube.times[place]):.4g}"
        until = f"to t = {float(tube.times[place + 1]):.4g}" if place + 1 < count else "on, for ever"
        said += [f"from t = {start} {until}"] * 6
    boxes = _line(x, y, PROVED, "proved boxes", width=1.0) | {
        "text": said, "hoverinfo": "text+x+y", "opacity": 0.75,
    }  # fmt: skip
    traces = [boxes]
    for k, run in enumerate(runs):
        own = run.agents[agent.id - 1]
        kept = np.union1d(thinned(own.x[0], points // 2), thinned(own.x[1], points // 2))
        away = own.x[0][kept] - run.reference[agent.id - 1][kept]
        traces.append(_line(plain(away), plain(own.x[1][kept]), SIMULATED, "simulated runs", first=k == 0))
    return {"data": traces, "layout": _layout("x1 − reference", "x2") | {"hovermode": "closest"}}


def region_chart(found: RegionSlice) -> Figure:
    """The simulated fates of a plane of starts, and the certified box in it."""
    one, two = (chart_text(f"{name}(0)") for name in found.names)
    first, second = np.meshgrid(found.first, found.second)
    traces: list[Trace] = []
    for fate, name, mark, colour in FATES:
        here = found.fates == fate
        if here.any():
            traces.append(_marks(plain(first[here]), plain(second[here]), name, {"symbol": mark, "color": colour}))
    (left, right), (low, high) = ((float(side.lo), float(side.hi)) for side in found.certified)
    box = plain([left, right, right, left, left]), plain([low, low, high, high, low])
    traces.append(_line(*box, PROVED, "certified box", width=2.2))
    cross = {"symbol": "cross-thin", "size": 11, "line": {"width": 2, "color": PROVED}}
    traces.append(_marks(plain([(left + right) / 2]), plain([(low + high) / 2]), "its middle", cross))
    return {"data": traces, "layout": _layout(one, two) | {"hovermode": "closest"}}


def _layout(x: str, y: str) -> dict[str, Any]:
    return {
        "xaxis": {"title": {"text": x}},
        "yaxis": {"title": {"text": y}},
        "hovermode": "x",
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "margin": {"l": 64, "r": 12, "t": 8, "b": 44},
    }


def _marks(x: Values, y: Values, name: str, marker: dict[str, Any]) -> Trace:
    return {"type": "scatter", "mode": "markers", "name": name, "x": x, "y": y, "marker": {"size": 7, **marker}}


def _line(
    x: Sequence[float | None],
    y: Sequence[float | None],
    colour: str,
    name: str,
    width: float = 1.0,
    dash: str = "solid",
    shape: str = "linear",
    first: bool = True,
) -> Trace:
    """A line; of several with one name, the first stands in the legend for all."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": list(x),
        "y": list(y),
        "name": name,
        "legendgroup": name,
        "showlegend": first,
        "line": {"color": colour, "width": width, "dash": dash, "shape": shape},
    }
