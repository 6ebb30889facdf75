"""The region of attraction as simulated, beside the box of starts that the certificate is about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from reports import cells
from reports.figures import style, svg
from reports.typst_math import symbol_text
from sims.attraction import RegionSlice, coverage
from sims.attraction_plots import plot_box, plot_region
from symbolic.plant import Interval

COLUMNS = 3
PANEL, WIDE = (2.2, 1.65), 3.0
MARK = 6.0


def attraction_section(slices: Sequence[RegionSlice]) -> dict[str, Any] | None:
    """The data of ``attraction.typ``; ``None`` without slices."""
    if not slices:
        return None
    figure = attraction_figure(slices)
    return {
        "svg": svg(figure),
        "width": 72 * float(figure.get_figwidth()),
        "starts": cells.text(slices[0].fates.size),
        "vertices": cells.text(max(found.parameters for found in slices)),
        "rows": [_row(found) for found in slices],
    }


def attraction_figure(
    slices: Sequence[RegionSlice], inner: Mapping[int, Mapping[str, Interval]] = MappingProxyType({})
) -> Figure:
    """One panel per slice under one legend; ``inner`` has the sides of a smaller box, drawn dashed."""
    columns = min(COLUMNS, len(slices))
    rows = -(-len(slices) // columns)
    with style():
        width = PANEL[0] if columns == COLUMNS else WIDE
        figure = Figure(figsize=(width * columns, PANEL[1] * rows + 0.35), layout="constrained")
        panels = np.atleast_1d(figure.subplots(rows, columns)).ravel()
        looks: dict[str, Any] = {}
        for axes, found in zip(panels, slices, strict=False):
            plot_region(found, axes, size=MARK, legend=False)
            if found.agent in inner:
                sides = inner[found.agent]
                plot_box(axes, sides[found.names[0]], sides[found.names[1]])
            axes.grid(False)
            axes.tick_params(length=2.0)
            handles, labels = axes.get_legend_handles_labels()
            looks |= dict(zip(labels, handles, strict=True))
        for axes in panels[len(slices) :]:
            axes.remove()
        figure.legend(list(looks.values()), list(looks), loc="outside upper center", ncols=len(looks))
    return figure


def attraction_details(slices: Sequence[RegionSlice]) -> list[dict[str, Any]]:
    """What ``summary.json`` says of the slices: estimates, nothing proved."""
    return [_details(found) for found in slices]


def _details(found: RegionSlice) -> dict[str, Any]:
    share = coverage(found)
    known = share.converging > 0
    return {
        "id": found.agent,
        "states": list(found.names),
        "window": [[_end(places, low) for low in (True, False)] for places in (found.first, found.second)],
        "starts": share.sampled,
        "converging": share.converging,
        "covered": share.fraction if known else None,
        "covered_95": [share.low, share.high] if known else None,
    }


def _row(found: RegionSlice) -> list[cells.Cell]:
    share = coverage(found)
    window = " × ".join(
        f"[{_end(places, True):.4g}, {_end(places, False):.4g}]" for places in (found.first, found.second)
    )
    covered = f"{_percent(share.fraction)} ({_percent(share.low)} – {_percent(share.high)})"
    return [
        cells.text(found.agent),
        cells.math(", ".join(map(symbol_text, found.names))),
        cells.text(window),
        cells.text(f"{share.converging} of {share.sampled}"),
        cells.text(covered if share.converging else "–"),
    ]


def _end(places: Any, low: bool) -> float:
    """Where the window ends, half a cell beyond the outermost start."""
    half = float(places[1] - places[0]) / 2
    return float(places[0]) - half if low else float(places[-1]) + half


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"
