"""The digraph to hover over: an arrow ``j → i`` where agent ``i`` hears agent ``j``."""

from __future__ import annotations

from typing import Any

import numpy as np

from certify.statement.numbers import fraction
from reports.interactive.samples import Values, chart_text, plain
from reports.network_figure import layout
from symbolic.network import cuts, left_null_vector
from symbolic.plant import Plant

NODE, EDGE = "#3b82c4", "#8a8a8a"
BEND = 0.12  # of the chord: an arrow there and one back stay apart
GAP = 0.16  # of the chord at most, left free at both ends for the nodes
LABELS_UP_TO = 60
LONGEST = 160  # characters of a cost that are shown


def network_chart(plant: Plant) -> dict[str, Any]:
    """Nodes with cost, order and ``r_i``; the curve of an edge ends in an arrow."""
    positions = layout(plant.digraph)
    x: Values = []
    y: Values = []
    sizes: list[int] = []
    spread = float(np.ptp(np.array(list(positions.values())), axis=0).max()) or 1.0
    for edge in plant.digraph.edges:
        start, end = positions[edge.source], positions[edge.target]
        chord = end - start
        gap = min(0.045 * spread / (float(np.linalg.norm(chord)) or 1.0), GAP)
        top = (start + end) / 2 + BEND * np.array([chord[1], -chord[0]])
        share = np.linspace(gap, 1 - gap, 8)[:, None]
        curve = (1 - share) ** 2 * start + 2 * share * (1 - share) * top + share**2 * end
        x += [*plain(curve[:, 0]), None]
        y += [*plain(curve[:, 1]), None]
        sizes += [0] * (len(curve) - 1) + [11, 0]
    edges = {
        "type": "scatter", "mode": "lines+markers", "x": x, "y": y, "hoverinfo": "skip", "showlegend": False,
        "line": {"color": EDGE, "width": 1.2},
        "marker": {"symbol": "arrow", "angleref": "previous", "size": sizes, "color": EDGE, "opacity": 1},
    }  # fmt: skip
    few = plant.digraph.agents <= LABELS_UP_TO
    nodes = {
        "type": "scatter", "mode": "markers+text" if few else "markers", "showlegend": False,
        "x": plain(float(positions[agent.id][0]) for agent in plant.agents),
        "y": plain(float(positions[agent.id][1]) for agent in plant.agents),
        "text": [str(agent.id) for agent in plant.agents], "textfont": {"color": "#ffffff", "size": 12},
        "hovertext": _said(plant), "hoverinfo": "text",
        "marker": {"size": 26 if few else 10, "color": NODE, "line": {"width": 1, "color": "#ffffff"}},
    }  # fmt: skip
    hidden = {"visible": False, "fixedrange": False}
    return {
        "data": [edges, nodes],
        "layout": {
            "xaxis": hidden, "yaxis": hidden | {"scaleanchor": "x"}, "hovermode": "closest", "showlegend": False,
            "margin": {"l": 8, "r": 8, "t": 8, "b": 8},
        },
    }  # fmt: skip


def _said(plant: Plant) -> list[str]:
    """What a node tells, in Plotly's markup, of which only the line breaks are meant."""
    r = None if cuts(plant.digraph) else left_null_vector(plant.digraph)
    said = []
    for agent in plant.agents:
        hears = [str(edge.source) for edge in plant.digraph.edges if edge.target == agent.id]
        cost = str(agent.cost).replace("**", "^")
        lines = [
            f"agent {agent.id}, order {agent.order}",
            f"cost {cost if len(cost) <= LONGEST else cost[:LONGEST] + '…'}",
            f"hears {', '.join(hears[:12])}{' …' if len(hears) > 12 else ''}" if hears else "hears nobody",
        ]
        lines += [] if r is None else [f"r = {fraction(r[agent.id - 1]).text}"]
        said.append("<br>".join(map(chart_text, lines)))
    return said
