"""The communication digraph drawn: an arrow ``j → i`` where agent ``i`` hears agent ``j``."""

from __future__ import annotations

from fractions import Fraction

import networkx
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from numpy.typing import NDArray

from certify.statement.numbers import fraction
from symbolic.network import cuts, left_null_vector
from symbolic.plant import Digraph

Positions = dict[int, NDArray[np.float64]]

CIRCLE_UP_TO = 16
LABELS_UP_TO = 24
COLOURS = ("#1f4e79", "#8c2d04", "#2d6a4f", "#5b3a8c", "#7a6a00", "#8c1c4b")
_NODE = "#e8eef5"
_BEND = 0.14


def draw_network(digraph: Digraph, width: float, height: float) -> Figure:
    """Nodes with their ``r_i`` (``rᵀL = 0``, ``Σ r_i = 1``), arrows with their weight where it is not 1; inches.

    A digraph that is not strongly connected has no positive ``r``: its components that no edge enters are coloured.
    """
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_aspect("equal")
    positions = layout(digraph)
    many = digraph.agents > LABELS_UP_TO
    radius = 6.0 if many else 11.0
    _draw_edges(axes, digraph, positions, radius)
    _draw_nodes(axes, digraph, positions, radius)
    found = cuts(digraph)
    if not found and not many:
        _draw_weights_of_agents(axes, positions, left_null_vector(digraph), radius)
    span = np.array(list(positions.values()))
    margin = 0.42 if not many else 0.12
    beside = 0.9 if digraph.agents == 2 else margin
    axes.set_xlim(span[:, 0].min() - beside, span[:, 0].max() + beside)
    axes.set_ylim(span[:, 1].min() - margin, span[:, 1].max() + margin)
    return figure


def layout(digraph: Digraph) -> Positions:
    """A circle in the order of the ids for few agents; distances of the graph for many."""
    ids = range(1, digraph.agents + 1)
    if digraph.agents <= CIRCLE_UP_TO:
        top = np.pi if digraph.agents == 2 else np.pi / 2
        angles = [top - 2 * np.pi * k / digraph.agents for k in range(digraph.agents)]
        if digraph.agents == 1:
            return {1: np.zeros(2)}
        return {i: np.array([1.45 * np.cos(a), np.sin(a)]) for i, a in zip(ids, angles, strict=True)}
    graph = networkx.Graph()
    graph.add_nodes_from(ids)
    graph.add_edges_from((edge.source, edge.target) for edge in digraph.edges)
    components = list(networkx.connected_components(graph))
    if len(components) > 1:
        return dict(networkx.circular_layout(graph))
    return {i: np.asarray(p) * [1.45, 1.0] for i, p in networkx.kamada_kawai_layout(graph).items()}


def _draw_edges(axes: Axes, digraph: Digraph, positions: Positions, radius: float) -> None:
    for edge in digraph.edges:
        start, end = positions[edge.source], positions[edge.target]
        axes.add_patch(
            FancyArrowPatch(
                tuple(start),
                tuple(end),
                connectionstyle=f"arc3,rad={_BEND}",
                arrowstyle="-|>",
                mutation_scale=0.9 * radius,
                shrinkA=radius,
                shrinkB=radius,
                linewidth=0.9,
                color="#444444",
                zorder=1,
            )
        )
        if edge.weight != 1:
            chord = end - start
            middle = (start + end) / 2 + _BEND / 2 * np.array([chord[1], -chord[0]])
            _label(axes, middle, str(fraction(edge.weight)), "#8c2d04")


def _draw_nodes(axes: Axes, digraph: Digraph, positions: Positions, radius: float) -> None:
    heard_by_nobody_else = {
        agent: k for k, cut in enumerate(c for c in cuts(digraph) if c.hears_nobody) for agent in cut.component
    }
    for agent, place in positions.items():
        number = heard_by_nobody_else.get(agent)
        colour = _NODE if number is None else COLOURS[(1 + number) % len(COLOURS)]
        axes.plot(
            *place,
            "o",
            markersize=2 * radius,
            markerfacecolor=colour,
            markeredgecolor="#1f4e79",
            markeredgewidth=1.0,
            zorder=2,
        )
        axes.text(
            float(place[0]),
            float(place[1]),
            str(agent),
            ha="center",
            va="center",
            zorder=3,
            fontsize=0.95 * radius if digraph.agents <= LABELS_UP_TO else 6.5,
            color="white" if number is not None else "black",
        )


def _draw_weights_of_agents(axes: Axes, positions: Positions, r: tuple[Fraction, ...], radius: float) -> None:
    centre = np.mean(list(positions.values()), axis=0)
    for agent, place in positions.items():
        outward = place - centre
        direction = outward / np.linalg.norm(outward) if np.any(outward) else np.array([0.0, 1.0])
        align = "left" if direction[0] > 0.3 else "right" if direction[0] < -0.3 else "center"
        axes.annotate(
            f"$r_{{{agent}}} = {fraction(r[agent - 1]).text}$",
            (float(place[0]), float(place[1])),
            xytext=tuple(1.75 * radius * direction),
            textcoords="offset points",
            ha=align,
            va="center",
            fontsize=9,
            color="#1f4e79",
        )


def _label(axes: Axes, place: NDArray[np.float64], text: str, colour: str) -> None:
    axes.text(
        float(place[0]),
        float(place[1]),
        text,
        ha="center",
        va="center",
        fontsize=8,
        color=colour,
        zorder=4,
        bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none"},
    )
