"""The interactive page: one file that fetches nothing, in which names are text, drawn by a real browser."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mixed_orders import Certified, certified_mixed_orders

from reports.interactive.charts import error_chart, region_chart
from reports.interactive.page import build_page, page_figures
from reports.interactive.samples import bounds, plain, thinned
from reports.performance_rows import EACH_UP_TO, performance_rows
from reports.study import Study, conclusion
from sims.attraction import RegionSlice
from sims.closed_loop import Trajectory, simulate
from symbolic.plant import Interval, Requirements, Settling

HOSTILE = [
    "<img src=x onerror=\"window.acted='name'\">",
    "</script><script>window.acted='name'</script>",
    "</title><svg onload=\"window.acted='name'\">",
    "<!-- <script>",
    "&lt;b&gt; %{x} <br> {{name}} ${name}",
    "<a href=\"javascript:window.acted='name'\">here</a>",
]
HORIZON = 3.0


class Outline(HTMLParser):
    """Tags with their attributes, and the text of each kind of element."""

    def __init__(self, page: bytes) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open = ""
        self.feed(page.decode())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.texts.setdefault(tag, []).append("")
        self._open = tag

    def handle_endtag(self, tag: str) -> None:
        self._open = ""

    def handle_data(self, data: str) -> None:
        if self._open:
            self.texts[self._open][-1] += data

    @property
    def figures(self) -> dict[str, Any]:
        return json.loads(self.texts["script"][0])


@pytest.fixture(scope="module")
def certified() -> Certified:
    return certified_mixed_orders()


@pytest.fixture(scope="module")
def study(certified: Certified) -> Study:
    """With two runs, requirements that the claim does not have, and a slice made by hand."""
    runs = [simulate(certified.plant, certified.controller, horizon=HORIZON, samples=601) for _ in range(2)]
    found = RegionSlice(
        2, ("x1", "x2"), np.linspace(-2.0, 2.0, 4), np.linspace(-3.0, 3.0, 3),
        np.array([[0, 1, 2, 3]] * 3, dtype=np.int8), (Interval(Fraction(-1), Fraction(1)),) * 2, 4,
    )  # fmt: skip
    return replace(
        certified.study, trajectory=runs[0], runs=(runs[1],), simulated=certified.controller, slices=(found,)
    )


def named(study: Study, name: str) -> Study:
    return replace(study, plant=replace(study.plant, name=name))


# --- one file ---------------------------------------------------------------------------------------------------------


def test_the_page_is_one_file_and_names_no_other(study: Study) -> None:
    page = build_page(study)
    outline = Outline(page)
    assert page == build_page(study)
    assert page.startswith(b"<!DOCTYPE html>\n<html")
    assert [tag for tag, _ in outline.tags].count("script") == 3
    for tag, attributes in outline.tags:
        assert not {"src", "href", "action", "data", "srcset"} & attributes.keys(), tag
        assert not [key for key in attributes if key.startswith("on")], tag
    (policy,) = [a["content"] for _, a in outline.tags if a.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe-inline" not in policy.split("style-src")[0]
    assert "unsafe-eval" not in policy


@pytest.mark.parametrize("name", HOSTILE)
def test_a_name_is_text(study: Study, name: str) -> None:
    plain_page, page = Outline(build_page(named(study, "plain"))), Outline(build_page(named(study, name)))
    assert [tag for tag, _ in page.tags] == [tag for tag, _ in plain_page.tags]
    assert page.texts["h1"] == [name]
    assert page.texts["title"] == [f"{name}: optimal output consensus"]
    assert page.figures == plain_page.figures


@settings(max_examples=30)
@given(st.text(max_size=60))
def test_any_name_leaves_the_page_as_it_is(name: str) -> None:
    study = certified_mixed_orders().study
    page = Outline(build_page(named(study, name)))
    assert [tag for tag, _ in page.tags].count("script") == 3
    assert page.texts["h1"] == ["".join(c if c.isprintable() else " " for c in name)]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_reason_is_text(study: Study, name: str) -> None:
    rejected = {"status": "rejected", "claim_sha256": "", "reason": name}
    outline = Outline(build_page(replace(study, verification=rejected)))
    assert [tag for tag, _ in outline.tags].count("script") == 3
    assert name not in build_page(replace(study, verification=rejected)).decode() or "<" not in name


# --- what it says -----------------------------------------------------------------------------------------------------


def test_nothing_is_called_proved_without_the_checker(study: Study, certified: Certified) -> None:
    unverified = replace(study, verification=None)
    assert page_figures(unverified, conclusion(unverified))["agents"] == {}
    outline = Outline(build_page(unverified))
    assert "table" not in outline.texts
    assert "but not verified" in build_page(unverified).decode()
    rejected = replace(study, verification={"status": "rejected", "claim_sha256": "", "reason": "no"})
    assert page_figures(rejected, conclusion(rejected))["agents"] == {}
    assert "Nothing is proved" in build_page(rejected).decode()


def test_the_drawn_bound_is_nowhere_below_the_proved_one(certified: Certified, study: Study) -> None:
    for found in certified.bounds.agents:
        chart = error_chart(found, Requirements(), (), HORIZON, 100)
        t, bound = (np.array(chart["data"][0][axis], dtype=float) for axis in ("x", "y"))
        inside = np.linspace(t[0], t[-1], 5000)
        drawn = bound[np.searchsorted(t, inside, side="right") - 1]
        steps = np.abs(inside[:, None] - t).min(axis=1) > 1e-9  # at a border itself the drawing has both values
        assert np.all(drawn[steps] >= found.error.at(inside)[steps] * (1 - 1e-12))


@given(st.fractions(min_value=0, max_value=10**9))
def test_proved_numbers_are_rounded_up(value: Fraction) -> None:
    (shown,) = bounds([value])
    assert shown >= value or shown == float(value)
    assert shown <= float(value) * 1.0002 + 1e-300


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=400), st.integers(6, 120))
def test_thinned_curves_keep_their_extremes(values: list[float], points: int) -> None:
    series = np.array(values)
    kept = thinned(series, points)
    assert kept[0] == 0
    assert kept[-1] == len(series) - 1
    assert np.all(np.diff(kept) > 0)
    assert (series[kept].min(), series[kept].max()) == (series.min(), series.max())
    assert len(kept) <= max(points, 4) + 2


def test_what_is_not_finite_is_a_gap() -> None:
    assert plain([1.0, float("nan"), float("inf"), 123456.789]) == [1.0, None, None, 123460.0]


# --- asked, proved, simulated -----------------------------------------------------------------------------------------


def rows_of(study: Study, requirements: tuple[Requirements, ...], runs: tuple[Trajectory, ...] = ()) -> list[Any]:
    assert study.bounds is not None
    assert study.certified is not None
    return performance_rows(study.bounds, study.certified, replace(study.plant, requirements=requirements), runs)


def test_without_requirements_the_worst_of_all_agents_is_told(study: Study) -> None:
    assert study.bounds is not None
    assert study.trajectory is not None
    rows = {row.quantity: row for row in rows_of(study, (), (study.trajectory,))}
    assert set(rows) == {"error", "settling", "input", "pole"}
    assert rows["error"].agents == (1, 2)
    assert rows["error"].proved == max(agent.error.peak for agent in study.bounds.agents)
    assert rows["input"].seen == np.abs(study.trajectory.u).max() <= rows["input"].proved
    assert rows["settling"].proved == max(a.error.settled(rows["settling"].band) for a in study.bounds.agents)
    assert (rows["pole"].agents, rows["pole"].proved) == ((2,), None)


def test_what_is_asked_of_an_agent_has_its_own_row(study: Study) -> None:
    asked = Requirements(Settling(Fraction(100), Fraction(1, 10)), Fraction(10**6), Fraction(10**7))
    rows = [row for row in rows_of(study, (asked, Requirements())) if row.asked is not None]
    assert [(row.agents, row.quantity) for row in rows] == [((1,), "settling"), ((1,), "input")]
    assert all(row.proved <= row.asked for row in rows)
    rows = [row for row in rows_of(study, (asked, asked)) if row.asked is not None]
    assert [row.agents for row in rows] == [(1,), (1,), (2,), (2,), (2,)]


def test_many_agents_with_one_requirement_share_a_row(study: Study) -> None:
    assert study.bounds is not None
    assert study.certified is not None
    count = EACH_UP_TO + 3
    many = replace(study.bounds, agents=tuple(replace(study.bounds.agents[1], id=k) for k in range(1, count + 1)))
    claims = tuple(replace(study.certified.agents[1], id=k) for k in range(1, count + 1))
    asked = (Requirements(input=Fraction(10**9)),) * (count - 1) + (Requirements(input=Fraction(10**8)),)
    agents = tuple(replace(study.plant.agents[1], id=k) for k in range(1, count + 1))
    plant = replace(study.plant, agents=agents, requirements=asked, gains=())
    rows = performance_rows(many, replace(study.certified, agents=claims), plant, ())
    inputs = [row.agents for row in rows if row.quantity == "input"]
    assert inputs == [tuple(range(1, count)), (count,)]


# --- in a browser -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        pytest.skip("no Chromium on this machine")
    with pytest.importorskip("playwright.sync_api").sync_playwright() as started:
        opened = started.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield opened
        opened.close()


class Opened:
    """A page in the browser, and all that it asked for or complained about."""

    def __init__(self, browser: Any, place: Path, page: bytes, **options: Any) -> None:
        place.write_bytes(page)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.tab = browser.new_context(**options).new_page()
        self.tab.on("console", lambda message: self.complaints.append(message.text))
        self.tab.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.tab.on("dialog", lambda dialog: self.complaints.append("dialog"))
        self.tab.on("request", lambda request: self.requests.append(request.url))
        self.tab.goto(place.as_uri())
        self.tab.wait_for_selector("#network .main-svg")

    def layout(self, chart: str, path: str) -> Any:
        return self.tab.evaluate(f"document.getElementById('{chart}').layout.{path}")


def test_the_browser_draws_zooms_and_tells(browser: Any, study: Study, tmp_path: Path) -> None:
    opened = Opened(browser, tmp_path / "page.html", build_page(study), viewport={"width": 1200, "height": 900})
    tab = opened.tab
    visible = tab.eval_on_selector_all("figure", "all => all.filter(one => !one.hidden).map(one => one.id)")
    assert visible == ["error-figure", "input-figure"]  # agent 1 is of order 1
    tab.select_option("#agent", "2")
    tab.wait_for_selector("#region .main-svg")
    visible = tab.eval_on_selector_all("figure", "all => all.filter(one => !one.hidden).map(one => one.id)")
    assert visible == ["error-figure", "input-figure", "tube-figure", "region-figure"]
    tab.locator("#error").scroll_into_view_if_needed()
    place = tab.locator("#error .nsewdrag").bounding_box()
    before = opened.layout("error", "xaxis.range")
    middle = place["y"] + place["height"] / 2
    tab.mouse.move(place["x"] + 0.25 * place["width"], middle)
    tab.wait_for_selector("#error .hoverlayer .hovertext")
    assert "proved bound" in tab.text_content("#error .hoverlayer")
    tab.mouse.down()
    tab.mouse.move(place["x"] + 0.5 * place["width"], middle, steps=5)
    tab.mouse.up()
    tab.wait_for_function("document.getElementById('error').layout.xaxis.autorange === false")
    after = opened.layout("error", "xaxis.range")
    assert before[0] < after[0] < after[1] < before[1]
    tab.locator("#network").scroll_into_view_if_needed()
    marks = tab.eval_on_selector_all(
        "#network .points path.point",
        "all => all.map(one => one.getBoundingClientRect()).map(r => [r.x + r.width / 2, r.y + r.height / 2])",
    )
    tab.mouse.move(*marks[-1])
    tab.wait_for_selector("#network .hoverlayer .hovertext")
    assert "agent 2, order 2" in tab.text_content("#network .hoverlayer")
    assert opened.complaints == []
    assert set(opened.requests) == {(tmp_path / "page.html").as_uri()}


def test_the_page_fits_a_telephone_in_both_schemes(browser: Any, study: Study, tmp_path: Path) -> None:
    page = build_page(named(study, "w" * 200))
    tab = Opened(browser, tmp_path / "page.html", page, viewport={"width": 360, "height": 740}).tab
    for scheme in ("light", "dark"):
        tab.emulate_media(color_scheme=scheme)
        assert tab.evaluate("document.documentElement.scrollWidth") <= 360
        text, ground = tab.evaluate(
            "[getComputedStyle(document.body).color, getComputedStyle(document.body).backgroundColor].map("
            "one => one.match(/\\d+/g).slice(0, 3).map(Number).reduce((a, b) => a + b))"
        )
        assert (text > ground) == (scheme == "dark")


def test_no_name_acts_in_the_browser(browser: Any, study: Study, tmp_path: Path) -> None:
    """Names of states come from a closed alphabet; here they are hostile all the same."""
    name = " ".join(HOSTILE)
    page = build_page(replace(named(study, name), slices=(replace(study.slices[0], names=(name, name)),)))
    opened = Opened(browser, tmp_path / "page.html", page)
    opened.tab.select_option("#agent", "2")
    opened.tab.wait_for_selector("#region .xtitle")
    assert opened.tab.inner_text("h1").split() == name.split()
    assert opened.tab.text_content("#region .xtitle").split() == f"{name}(0)".split()
    assert opened.tab.evaluate("window.acted") is None
    assert opened.complaints == []
    assert len(opened.requests) == 1


def test_the_policy_stops_a_script_that_the_page_does_not_name(browser: Any, study: Study, tmp_path: Path) -> None:
    page = build_page(study).replace(b"</main>", b"</main><script>window.acted = 'injected'</script>")
    opened = Opened(browser, tmp_path / "page.html", page)
    assert opened.tab.evaluate("window.acted") is None
    assert any("Content Security Policy" in complaint for complaint in opened.complaints)


def test_a_region_names_its_axes_in_plotlys_markup_as_text() -> None:
    found = RegionSlice(
        1, ("<b>x</b>", "a&b"), np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.zeros((2, 2), dtype=np.int8),
        (Interval(Fraction(0), Fraction(1)),) * 2, 1,
    )  # fmt: skip
    layout = region_chart(found)["layout"]
    assert layout["xaxis"]["title"]["text"] == "&lt;b&gt;x&lt;/b&gt;(0)"
    assert layout["yaxis"]["title"]["text"] == "a&amp;b(0)"
