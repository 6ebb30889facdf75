"""The section on the certified region: states, settling, input, observer bandwidth, other gains that passed."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from certify.statement.bandwidth import observer_bandwidth
from certify.statement.bounds import AgentBounds, ProvedBounds
from certify.statement.claim import AgentClaim, CertifiedGains
from certify.statement.numbers import Rounding, rounded
from reports import cells
from reports.designs import design_lines
from reports.figures import svg
from reports.performance_figures import input_figure, loop_figure, tube_figure
from reports.performance_rows import PerformanceRow, performance_rows
from reports.region_figure import DRAWN_UP_TO, settling_figure
from reports.typst_math import number, number_text, symbol_text
from symbolic.plant import Interval, Plant

if TYPE_CHECKING:
    from certify.pipeline import GainsResult
    from sims.closed_loop import Trajectory
    from sims.loop_response import LoopResponse

LEVELS = (Fraction(1), Fraction(1, 10), Fraction(1, 100), Fraction(1, 1000))
DIGITS = 3
ROWS_UP_TO = 40
LONGEST = 60.0

Rows = list[list[cells.Cell]]


def region_section(
    found: ProvedBounds,
    certified: CertifiedGains,
    plant: Plant,
    gains: GainsResult | None,
    runs: Sequence[Trajectory],
    responses: Sequence[LoopResponse] = (),
) -> dict[str, Any]:
    """The data of ``region.typ``; ``runs`` are trajectories with the certified gains, ``responses`` the open loops.

    Proved numbers are rounded to the side on which they still hold.
    """
    agents = found.agents[:ROWS_UP_TO]
    horizon = min(LONGEST, max(float(agent.error.times[-1]) for agent in found.agents) * 1.25)
    completed = [run for run in runs if run.status == "completed"]
    left_out = len(found.agents) - len(agents)
    return {
        "states": [row for agent in agents for row in _states(agent)],
        "settling": [_settling(agent) for agent in agents],
        "levels": [number(level) for level in LEVELS],
        "inputs": [_inputs(agent, completed) for agent in agents],
        "runs": len(completed),
        "closest": cells.text("–") if not completed else estimate(closest(found, completed)),
        "observers": observer_rows(certified.agents[:ROWS_UP_TO]),
        **_picture(settling_figure(found, plant, completed, horizon)),
        "performance": performance_table(performance_rows(found, certified, plant, completed)),
        "required": plant.requirements != (),
        "input": _picture(input_figure(found, plant, completed, horizon)),
        "tube": _picture(tube) if (tube := tube_figure(certified, plant, completed)) is not None else None,
        "loops": _picture(loop_figure(responses)) if responses else None,
        "margins": [_margins(one) for one in responses],
        "drawn": None if len(found.agents) <= DRAWN_UP_TO else f"The first {DRAWN_UP_TO} agents.",
        "left_out": None if left_out == 0 else cells.text(f"{left_out} further agents are in summary.json."),
        "alternatives": alternatives(gains, plant),
    }


def _picture(figure: Figure) -> dict[str, Any]:
    return {"svg": svg(figure), "width": 72 * float(figure.get_figwidth())}


def performance_table(rows: Sequence[PerformanceRow]) -> Rows:
    """Agents, quantity, asked, proved, simulated."""
    return [
        [
            cells.text(cells.agents(row.agents)),
            cells.math(_quantity(row)),
            cells.text("–") if row.asked is None else cells.math(f"<= {number(row.asked)}"),
            cells.text("–") if row.proved is None else cells.math(f"<= {_number(row.proved, 'up')}"),
            estimate(row.seen),
        ]
        for row in rows
    ]


def _quantity(row: PerformanceRow) -> str:
    if row.quantity == "settling" and row.band is not None:
        return f'"time until" abs(y - s^(star.op)) <= {number(row.band)}'
    return {
        "error": "max abs(y - s^(star.op))",
        "input": "max abs(u)",
        "pole": '"fastest observer pole (rad / time)"',
    }[row.quantity]


def _margins(found: LoopResponse) -> list[cells.Cell]:
    one = found.margins
    values = (one.phase, one.gain, one.reduction, 1000 * one.delay, one.distance)
    return [cells.text(found.agent), *map(estimate, values)]


def closest(found: ProvedBounds, runs: Sequence[Trajectory]) -> float:
    """The largest ``|y_i − s*|`` of the runs as a part of its bound at that time: at most 1."""
    ratios = [
        float(np.nanmax(run.error[agent.id - 1] / agent.error.at(run.t))) for run in runs for agent in found.agents
    ]
    return max(ratios)


def _bound(value: Fraction, rounding: Rounding = "up") -> cells.Cell:
    return cells.math(_number(value, rounding))


def _number(value: Fraction, rounding: Rounding) -> str:
    return number_text(rounded(value, DIGITS, rounding))


def _range(side: Interval) -> cells.Cell:
    return cells.math(f"[{_number(side.lo, 'down')}, {_number(side.hi, 'up')}]")


def _states(agent: AgentBounds) -> Rows:
    rows = []
    for place, bound in enumerate(agent.states):
        name = symbol_text(bound.state.name)
        target = {"steady state": f" - {name}^(star.op)", "reference": " - y^r", "origin": ""}[bound.target]
        away = f"abs({name}{target})"
        rows.append(
            [
                cells.text(agent.id if place == 0 else ""),
                cells.math(name),
                _range(bound.whole),
                cells.math(f"{away} <= {_number(bound.distance, 'up')}"),
                _bound(bound.later),
            ]
        )
    return rows


def _settling(agent: AgentBounds) -> list[cells.Cell]:
    error = agent.error
    return [
        cells.text(agent.id),
        _bound(error.peak),
        *(_bound(error.settled(level)) for level in LEVELS),
        _bound(error.decay, "down"),
    ]


def _inputs(agent: AgentBounds, runs: Sequence[Trajectory]) -> list[cells.Cell]:
    bound = agent.input
    internal = cells.text("–") if bound.internal is None else _bound(bound.internal)
    proved = (bound.steady, bound.peak, bound.after, agent.reaching)
    row = [cells.text(agent.id), cells.number(bound.saturation), internal, *map(_bound, proved)]
    if runs:
        row.append(estimate(max(float(np.nanmax(np.abs(run.agents[agent.id - 1].u))) for run in runs)))
    return row


def observer_rows(agents: Sequence[AgentClaim]) -> Rows:
    """Observer poles, the fastest in rad/s and Hz, and the sampling rate; agents of order 1 have no observer."""
    rows = []
    for agent in agents:
        if agent.h is None or not agent.observer:
            continue
        found = observer_bandwidth(agent.observer, agent.h)
        low, high = found.sampling
        rows.append(
            [
                cells.text(agent.id),
                cells.math(", ".join(_pole(pole, count) for pole, count in found.poles)),
                estimate(found.fastest),
                cells.text(_hertz(found.hertz)),
                cells.text(f"{_hertz(low)} – {_hertz(high)}"),
            ]
        )
    return rows


def _pole(pole: complex, count: int) -> str:
    real, imaginary = (_number(Fraction(part), "nearest") for part in (pole.real, abs(pole.imag)))
    sign = "-" if pole.imag < 0 else "+"
    text = real if pole.imag == 0 else f"{real} {sign} {imaginary} upright(i)"
    return text if count == 1 else f'{text} " ({count}×)"'


def _hertz(value: float) -> str:
    for size, unit in ((1e9, "GHz"), (1e6, "MHz"), (1e3, "kHz")):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value:.3g} Hz"


def estimate(value: float) -> cells.Cell:
    """A float, which nothing proves, to three digits."""
    return cells.math(_number(Fraction(value), "nearest")) if np.isfinite(value) else cells.text("–")


def alternatives(gains: GainsResult | None, plant: Plant) -> Rows:
    """All controllers that the search kept, the default first; empty where only the default is known."""
    if gains is None or not any(agent.alternatives for agent in gains.agents):
        return []
    rows = []
    for agent, described in zip(gains.agents, plant.agents, strict=True):
        if not agent.thresholds:
            continue
        default = [agent.thresholds.get(name) for name in ("g", "K", "delta", "h")]
        rows.append(
            [cells.text(agent.id), cells.text("default"), *map(cells.number, default), cells.text(agent.reason)]
        )
        for other in agent.alternatives:
            law = other.controller
            reason = "; ".join((other.reason, *design_lines(described, law)))
            values = map(cells.number, (law.g, law.K, law.delta, law.h))
            rows.append([cells.text(""), cells.text(other.label), *values, cells.text(reason)])
    return rows
