"""The simulated region of attraction: fates on a plane, the certified part of it, the pictures."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from closed_loops import controller_for

from reports.attraction import attraction_details, attraction_figure, attraction_section
from sims.attraction import (
    CONVERGES,
    ESCAPES,
    STAYS,
    RegionSlice,
    coverage,
    region_slice,
    region_slices,
    region_window,
    slice_names,
    wilson,
)
from sims.attraction_plots import LOOKS, plot_bounds, plot_region
from sims.bounds import ERROR, SignalBound
from sims.deadline import Deadline
from sims.falsifier import TOLERANCE
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Interval, Plant


@pytest.fixture(autouse=True)
def figures() -> Iterator[None]:
    matplotlib.use("Agg")
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def weak(five_agents: Plant) -> Controller:
    return controller_for(five_agents, g=2, K=60, h=200, delta=1000)


def made_up(fates: list[list[int]], side: Fraction = Fraction(1)) -> RegionSlice:
    """Cells of width 2 from −4 to 4, the box ``[−side, side]²``."""
    places = np.array([-3.0, -1.0, 1.0, 3.0])
    box = (Interval(-side, side), Interval(-side, side))
    return RegionSlice(1, ("x1", "x2"), places, places, np.array(fates, dtype=np.int8), box, 4)


def test_a_slice_has_the_fates_of_its_starts(five_agents: Plant, weak: Controller) -> None:
    found = region_slice(five_agents, weak, 1, ("z1", "x2"), ((-100, 100), (-100, 100)), points=5, vertices=2)
    assert found.first.tolist() == [-80, -40, 0, 40, 80] and found.parameters == 2
    assert found.fates.shape == (5, 5) and found.fates[2, 2] == CONVERGES and (found.fates == ESCAPES).any()
    with pytest.raises(InputError, match="agent 1 has no plant state x3; it has z1, x1, x2"):
        region_slice(five_agents, weak, 1, ("z1", "x3"), ((-1, 1), (-1, 1)))
    with pytest.raises(InputError, match="at least 2 points"):
        region_slice(five_agents, weak, 1, ("z1", "x2"), ((-1, 1), (-1, 1)), points=1)


def test_the_window_ends_beyond_the_first_start_that_is_lost(five_agents: Plant, weak: Controller) -> None:
    (low, high), _ = region_window(five_agents, weak, 1, ("z1", "x2"), vertices=1, due=Deadline(25, TOLERANCE))
    edge = high / 1.25
    assert low == -high
    spans = ((-edge, edge), (-1.0, 1.0))
    starts = region_slice(
        five_agents, weak, 1, ("z1", "x2"), spans, points=101, vertices=1, due=Deadline(25, TOLERANCE)
    )
    middle = starts.fates[50]
    assert (middle[[0, -1]] != CONVERGES).any()  # within 1 % of the edge
    inner = np.abs(starts.first) <= edge / 2
    assert (middle[inner] == CONVERGES).all()


def test_the_plane_that_is_drawn(five_agents: Plant) -> None:
    assert slice_names(five_agents.agents[0]) == ("x1", "x2")


def test_slices_are_the_same_in_processes(five_agents: Plant, weak: Controller) -> None:
    due = {1: Deadline(20, TOLERANCE), 3: Deadline(25, TOLERANCE)}
    alone = region_slices(five_agents, weak, [1, 3], points=3, vertices=1, deadlines=due)
    divided = region_slices(five_agents, weak, [1, 3], points=3, vertices=1, deadlines=due, workers=2)
    assert [found.agent for found in alone] == [1, 3]
    for one, two in zip(alone, divided, strict=True):
        assert (one.fates == two.fates).all() and (one.first == two.first).all()


def test_coverage_compares_areas() -> None:
    """A box of 2 × 2 in a window of 8 × 8, a quarter of which converges."""
    quarter = [[CONVERGES] * 4, [ESCAPES] * 4, [STAYS] * 4, [ESCAPES] * 4]
    part = coverage(made_up(quarter))
    assert (part.box, part.converging, part.sampled) == (1 / 16, 4, 16)
    assert part.fraction == pytest.approx(1 / 4)
    low, high = wilson(4, 16)
    assert (part.low, part.high) == (pytest.approx(1 / 16 / high), pytest.approx(1 / 16 / low))
    assert part.low < part.fraction < part.high
    everything = coverage(made_up([[CONVERGES] * 4] * 4, Fraction(10)))
    assert (everything.box, everything.fraction, everything.high) == (1, 1, 1)
    nothing = coverage(made_up([[ESCAPES] * 4] * 4))
    assert np.isnan(nothing.fraction) and nothing.high == 1


def test_wilson_interval() -> None:
    assert wilson(0, 0) == (0.0, 1.0)
    low, high = wilson(5, 10)
    assert (low, high) == (pytest.approx(0.2366, abs=1e-4), pytest.approx(0.7634, abs=1e-4))
    assert wilson(0, 10)[0] == pytest.approx(0, abs=1e-12) and wilson(10, 10)[1] == pytest.approx(1, abs=1e-12)


# --- pictures ---------------------------------------------------------------------------------------------------------


def test_a_slice_is_drawn_on_the_axes_given() -> None:
    found = made_up([[CONVERGES] * 4, [ESCAPES] * 4, [STAYS] * 4, [ESCAPES] * 4])
    _, ax = plt.subplots()
    assert plot_region(found, ax) is ax
    assert ax.get_xlabel() == "$x_{1}(0)$" and ax.get_ylabel() == "$x_{2}(0)$" and ax.get_xlim() == (-4, 4)
    labels = {text.get_text() for text in ax.get_legend().get_texts()}
    assert labels == {"converges", "escapes", "does not converge", "certified box"}
    assert sum(len(marks.get_offsets()) for marks in ax.collections) == 16
    (box,) = ax.patches
    assert (*box.get_xy(), box.get_width(), box.get_height()) == (-1, -1, 2, 2)
    assert len({mark for mark, _, _ in LOOKS.values()}) == len({colour for _, colour, _ in LOOKS.values()}) == 4


def test_a_box_too_small_to_be_seen_is_marked() -> None:
    crosses = [plot_region(made_up([[CONVERGES] * 4] * 4, side)).lines for side in (Fraction(1), Fraction(1, 100))]
    assert [len(lines) for lines in crosses] == [0, 1]
    assert crosses[1][0].get_xydata().tolist() == [[0, 0]]


def test_bounds_are_drawn_above_the_runs() -> None:
    t = np.linspace(0, 4, 9)
    bound = SignalBound(2, ERROR, (Fraction(0), Fraction(2)), (Fraction(8), Fraction(1, 2)))
    _, given = plt.subplots()
    ax = plot_bounds(t, np.array([-np.exp(-t), 0.1 * np.exp(-t)]), bound, given)
    assert ax is given and ax.get_yscale() == "log"
    assert ax.get_xlabel() == "time $t$ [s]" and ax.get_ylabel() == r"$|y - s^\star|$, agent 2"
    *runs, step = ax.lines
    assert [line.get_label() for line in (runs[0], step)] == ["simulated", "certified bound"]
    assert (runs[0].get_ydata() == np.exp(-t)).all() and (runs[1].get_ydata() == 0.1 * np.exp(-t)).all()
    assert step.get_ydata().tolist() == [8, 8, 8, 8, 0.5, 0.5, 0.5, 0.5, 0.5]
    state = plot_bounds(t, np.array([t]), SignalBound(1, "x2", (Fraction(0),), (Fraction(1),)))
    assert state.get_ylabel() == "$|x_{2}|$, agent 1"


def test_the_section_of_the_report() -> None:
    assert attraction_section(()) is None
    found = made_up([[CONVERGES] * 4, [ESCAPES] * 4, [STAYS] * 4, [ESCAPES] * 4])
    lost = made_up([[ESCAPES] * 4] * 4)
    figure = attraction_figure([found, lost, found, found])
    assert [axes.get_title() for axes in figure.axes] == ["agent 1"] * 4
    (legend,) = figure.legends
    assert {text.get_text() for text in legend.get_texts()} >= {"converges", "escapes", "certified box"}
    section = attraction_section([found, lost])
    assert section is not None and section["svg"].startswith("<?xml")
    assert [row[3]["text"] for row in section["rows"]] == ["4 of 16", "0 of 16"]
    assert section["rows"][0][4]["text"] == "25 % (13 % – 61 %)" and section["rows"][1][4]["text"] == "–"
    one, two = attraction_details([found, lost])
    assert (one["window"], one["covered"]) == ([[-4.0, 4.0], [-4.0, 4.0]], pytest.approx(0.25))
    assert one["covered_95"][0] < 0.25 < one["covered_95"][1] and two["covered"] is None
