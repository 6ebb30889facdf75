"""The trade-off of a network, drawn and as a table: settling time against peak of the input, bandwidth as colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from certify.certificate import claim_digest
from certify.trade_off import Design, TradeOff
from reports.figures import style
from symbolic.plant import Plant

COLUMNS = 3
PANEL = (2.5, 1.9)
DRAWN_UP_TO = 12
PLAIN = "#1f4e79"


def trade_off_figure(found: TradeOff, plant: Plant) -> Figure:
    """One panel per agent, both axes logarithmic; agents without an observer in one colour."""
    agents = plant.agents[:DRAWN_UP_TO]
    columns = min(COLUMNS, len(agents))
    rows = -(-len(agents) // columns)
    poles = [float(design.pole) for network in found.networks for design in network.designs if design.pole > 0]
    norm = LogNorm(min(poles), max(max(poles), 1.001 * min(poles))) if poles else None
    with style():
        figure = Figure(figsize=(PANEL[0] * columns, PANEL[1] * rows + 0.3), layout="constrained")
        panels = np.atleast_1d(figure.subplots(rows, columns)).ravel()
        marks = None
        for index, (axes, agent) in enumerate(zip(panels, agents, strict=False)):
            designs = found.of(index)
            x, y = ([float(getattr(design, key)) for design in designs] for key in ("settled", "peak"))
            axes.plot(x, y, color="#bbbbbb", linewidth=0.7, zorder=1)
            if agent.order > 1 and norm is not None:
                colours = [float(design.pole) for design in designs]
                marks = axes.scatter(x, y, c=colours, norm=norm, cmap="viridis", s=18, zorder=2)
            else:
                axes.scatter(x, y, color=PLAIN, s=18, zorder=2)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_title(f"agent {agent.id}", pad=3.0)
        for axes in panels[len(agents) :]:
            axes.remove()
        figure.supxlabel("proved settling time to 1 % of the error at the start [s]", fontsize=9)
        figure.supylabel("proved peak of $|u|$", fontsize=9)
        if marks is not None:
            figure.colorbar(marks, ax=list(panels[: len(agents)]), label="fastest observer pole [rad/s]")
    return figure


def trade_off_fields(found: TradeOff) -> list[dict[str, Any]]:
    """One entry per certified design of the network; numbers are proved and exact."""
    return [
        {
            "design": place,
            "claim_sha256": claim_digest(network.certificate),
            "agents": [_fields(design) for design in network.designs],
        }
        for place, network in enumerate(found.networks, 1)
    ]


def _fields(design: Design) -> dict[str, Any]:
    law = design.controller
    gains = {"g": law.g, "K": law.K, "delta": law.delta, "h": law.h}
    return {
        "id": law.id,
        **{key: None if value is None else str(value) for key, value in gains.items()},
        "settling": {"time": str(design.settled), "band": str(design.band)},
        "input": str(design.peak),
        "bandwidth": str(design.pole) if design.pole > 0 else None,
    }


def trade_off_lines(found: TradeOff, plant: Plant) -> list[str]:
    """A table by agent, and below it the lines to paste."""
    lines = []
    for index, agent in enumerate(plant.agents):
        lines.append(f"agent {agent.id}: settled (s), peak of |u|, fastest observer pole (rad/s), design")
        for place, network in enumerate(found.networks, 1):
            design = network.designs[index]
            if place > 1 and design == found.networks[place - 2].designs[index]:
                continue
            pole = f"{float(design.pole):.4g}" if design.pole > 0 else "-"
            lines.append(f"  {float(design.settled):9.4g}  {float(design.peak):9.4g}  {pole:>9}  {place}")
    return lines


def pasted(found: TradeOff) -> str:
    """``[gains.i]`` of every design, for a plant file."""
    blocks = []
    for place, network in enumerate(found.networks, 1):
        lines = [f"# design {place}"]
        for design in network.designs:
            law = design.controller
            lines.append(f"[gains.{law.id}]")
            values = {"g": law.g if law.h is not None else None, "K": law.K, "delta": law.delta, "h": law.h}
            lines += [f"{key} = {_number(value)}" for key, value in values.items() if value is not None]
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks) + "\n"


def _number(value: Any) -> str:
    return str(value) if value.denominator == 1 else f'"{value}"'
