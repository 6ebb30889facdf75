"""The page itself: elements made as a tree, so that text is text, and scripts that the page's own policy names.

The policy in the head allows these two scripts by their digests, inline styles and pictures made by the page, and
nothing else: no other script runs, and nothing is fetched or sent.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as Tree

from certify.statement.numbers import rounded, shown
from reports import cells
from reports.interactive.charts import Figure, error_chart, input_chart, region_chart, tube_chart
from reports.interactive.network_chart import network_chart
from reports.interactive.samples import points_per_curve
from reports.performance_rows import PerformanceRow, performance_rows
from reports.study import Conclusion, Study, conclusion

if TYPE_CHECKING:
    from sims.closed_loop import Trajectory

Element = Tree.Element

HEADLINES = {
    "certified": "Certified",
    "refuted": "Refuted",
    "rejected": "Certificate rejected",
    "inconclusive": "Inconclusive",
}
CLAIM = (
    "For every parameter w in W, every exosystem state v(0) in V0 and every initial state in the boxes of the plant "
    "file, with ζ(0) = 0 and ξ_i(0) = e_i, the closed loop with the certified gains exists for all t ≥ 0, stays "
    "bounded, and every output converges exponentially to the minimiser s* of the sum of the costs."
)
NO_CLAIM = "Nothing is proved about this network. What is drawn below was simulated or asked for."
CHARTS = (
    ("error", "Output error |y − s*|", "No trajectory is above the proved bound."),
    ("input", "Input", "No trajectory is beyond the proved peak."),
    ("tube", "Tube in (x1 − reference, x2)", "Each box holds every trajectory during its stretch of time."),
    ("region", "Region of attraction, simulated", "A plane of starts; all other states start in the middle."),
)
SHOWN_DIGITS = 4
LONGEST = 1.25  # times the grid of the bounds: how far the charts go


def build_page(study: Study) -> bytes:
    """The page in UTF-8. It depends on the study alone."""
    ended = conclusion(study)
    figures = page_figures(study, ended)
    root = Tree.Element("html", {"lang": "en"})
    scripts = {"plotly": _library(), "page": _own("page.js")}
    _head(root, cells.printable(study.plant.name), scripts)
    body = Tree.SubElement(root, "body")
    main = Tree.SubElement(body, "main")
    _first(main, study, ended)
    _performance(main, study, ended)
    _charts(main, study, figures)
    _add(body, "footer", _footer(study))
    data = json.dumps(figures, ensure_ascii=False, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    _add(body, "script", data, {"type": "application/json", "id": "figures"})
    for script in scripts.values():
        _add(body, "script", script)
    return b"<!DOCTYPE html>\n" + Tree.tostring(root, encoding="utf-8", method="html")


def page_figures(study: Study, ended: Conclusion) -> dict[str, Any]:
    """``{"network": figure, "agents": {id: {chart: figure}}}``; of agents nothing without verified bounds."""
    agents: dict[str, dict[str, Figure]] = {}
    slices = {found.agent: found for found in study.slices} if ended.verified else {}
    certified = study.certified
    if study.bounds is not None and certified is not None and ended.verified:
        runs = certified_runs(study)
        horizon = max(float(agent.error.times[-1]) for agent in study.bounds.agents) * LONGEST
        horizon = max([horizon, *(float(run.t[-1]) for run in runs)])
        points = points_per_curve(3 * len(runs) * len(study.plant.agents))
        for agent, found, claim in zip(study.plant.agents, study.bounds.agents, certified.agents, strict=True):
            asked = study.plant.requirements_of(agent.id)
            charts: dict[str, Figure | None] = {
                "error": error_chart(found, asked, runs, horizon, points),
                "input": input_chart(found, asked, runs, horizon, points),
                "tube": None if claim.tube is None else tube_chart(agent, claim.tube, runs, points),
                "region": region_chart(slices[agent.id]) if agent.id in slices else None,
            }
            agents[str(agent.id)] = {name: chart for name, chart in charts.items() if chart is not None}
    return {"network": network_chart(study.plant), "agents": agents}


def certified_runs(study: Study) -> tuple[Trajectory, ...]:
    """The completed runs with the certified gains."""
    certified = study.certified
    if certified is None or study.trajectory is None or study.simulated is None:
        return ()
    if not certified.same_as(study.simulated):
        return ()
    return tuple(run for run in (study.trajectory, *study.runs) if run.status == "completed")


def _head(root: Element, name: str, scripts: Mapping[str, str]) -> None:
    head = Tree.SubElement(root, "head")
    _add(head, "meta", "", {"charset": "utf-8"})
    allowed = " ".join(f"'sha256-{_digest(text)}'" for text in scripts.values())
    policy = (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; "
        "form-action 'none'"
    )
    _add(head, "meta", "", {"http-equiv": "Content-Security-Policy", "content": policy})
    _add(head, "meta", "", {"name": "viewport", "content": "width=device-width, initial-scale=1"})
    _add(head, "meta", "", {"name": "color-scheme", "content": "light dark"})
    _add(head, "title", f"{name}: optimal output consensus")
    _add(head, "style", _own("page.css"))


def _first(main: Element, study: Study, ended: Conclusion) -> None:
    _add(main, "h1", cells.printable(study.plant.name))
    verdict = _add(main, "p", "", {"class": f"verdict {ended.status}"})
    _add(verdict, "strong", HEADLINES[ended.status])
    if ended.status == "certified":
        said = "and verified by the independent checker" if ended.verified else "but not verified by the checker"
        verdict[-1].tail = f" {said}"
    elif ended.reason:
        verdict[-1].tail = f" {cells.printable(ended.reason)[:1500]}"
    _add(main, "p", CLAIM if ended.status == "certified" else NO_CLAIM)
    optimum = _optimum(study)
    if optimum:
        _add(main, "p", f"s* {optimum}")


def _optimum(study: Study) -> str:
    if study.optimum is not None:
        value = shown(study.optimum, 8)
        return f"{'=' if value.exact else '≈'} {value.text}"
    if study.optimum_enclosure is not None:
        side = study.optimum_enclosure
        return f"in [{rounded(side.lo, 8, 'down')}, {rounded(side.hi, 8, 'up')}]"
    return ""


def _performance(main: Element, study: Study, ended: Conclusion) -> None:
    """The table asked, proved, simulated; only where the checker has verified what it says."""
    certified = study.certified
    if study.bounds is None or certified is None or not ended.verified:
        return
    section = _add(main, "section")
    _add(section, "h2", "Asked, proved, simulated")
    frame = _add(section, "div", "", {"class": "wide"})
    table = _add(frame, "table")
    head = _add(_add(table, "thead"), "tr")
    for title in ("agents", "quantity", "asked", "proved", "simulated"):
        _add(head, "th", title, {"scope": "col"})
    body = _add(table, "tbody")
    for row in performance_rows(study.bounds, certified, study.plant, certified_runs(study)):
        line = _add(body, "tr")
        for text in row_texts(row):
            _add(line, "td", text)
    _add(
        section, "p",
        "Proved values hold for every start, parameter and disturbance of the plant file, rounded up; the simulated "
        "ones are the largest of a few runs and prove nothing. Times are in the plant's unit of time. Poles are "
        "computed.",
        {"class": "note"},
    )  # fmt: skip


def row_texts(row: PerformanceRow) -> list[str]:
    """The cells of a row as plain text."""
    names = {
        "error": "max |y − s*|",
        "settling": f"time until |y − s*| ≤ {'' if row.band is None else shown(row.band).text}",
        "input": "max |u|",
        "pole": "fastest observer pole (rad / time)",
    }
    asked = "–" if row.asked is None else f"≤ {shown(row.asked).text}"
    proved = "–" if row.proved is None else f"≤ {rounded(row.proved, SHOWN_DIGITS, 'up')}"
    seen = f"{row.seen:.4g}" if row.seen == row.seen else "–"
    return [cells.agents(row.agents), names[row.quantity], asked, proved, seen]


def _charts(main: Element, study: Study, figures: Mapping[str, Any]) -> None:
    agents: Mapping[str, Mapping[str, Figure]] = figures["agents"]
    section = _add(main, "section")
    _add(section, "h2", "Network")
    count = len(study.plant.agents)
    said = f"Directed graph of {count} agents with {len(study.plant.digraph.edges)} edges"
    _add(section, "div", "", {"class": "chart network", "id": "network", "role": "img", "aria-label": said})
    _add(section, "p", "An arrow from j to i: agent i hears agent j.", {"class": "note"})
    if not agents:
        return
    section = _add(main, "section")
    _add(section, "h2", "One agent")
    label = _add(section, "label", "agent ")
    select = _add(label, "select", "", {"id": "agent"})
    for agent in agents:
        _add(select, "option", agent, {"value": agent})
    for name, title, note in CHARTS:
        if not any(name in charts for charts in agents.values()):
            continue
        if name == "error":
            note = f"{note} {grid_end_note(study)}".rstrip()
        figure = _add(section, "figure", "", {"id": f"{name}-figure"})
        _add(figure, "figcaption", title)
        _add(figure, "div", "", {"class": "chart", "id": name, "role": "img", "aria-label": f"{title}. {note}"})
        _add(figure, "p", f"{note} Drag to zoom, double click to see all again.", {"class": "note"})
    _add(
        section, "noscript",
        "The charts need JavaScript, which is inside this file: nothing is loaded from anywhere.",
    )  # fmt: skip


def grid_end_note(study: Study) -> str:
    """Why a bound of ``|y − s*|`` steps up where the coordinator's grid ends; empty where none does."""
    found, certified = study.bounds, study.certified
    if found is None or certified is None:
        return ""
    end = certified.norm["end"]
    if not any(agent.error.rises_at(end) for agent in found.agents):
        return ""
    return (
        f"The bound steps up at t = {shown(end).text}: there the coordinator's grid ends, and one "
        "exponential bound, which is wider at first, holds for all time after it."
    )


def _footer(study: Study) -> str:
    certified = study.certified
    claim = "" if certified is None else f" · claim sha256 {certified.sha256}"
    day = "" if study.date is None else f"{study.date.isoformat()} · "
    return f"{day}plant file sha256 {study.plant.sha256}{claim}"


def _add(parent: Element, tag: str, text: str = "", attributes: Mapping[str, str] | None = None) -> Element:
    child = Tree.SubElement(parent, tag, dict(attributes or {}))
    if text:
        child.text = text
    return child


@cache
def _digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


@cache
def _library() -> str:
    """Plotly's own script. An end of the element inside it would end it early."""
    text = (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    if "</script" in text.lower() or "<!--" in text:
        raise RuntimeError("this version of Plotly cannot be embedded in a page")
    return text


def _own(name: str) -> str:
    return (files("reports") / "templates" / name).read_text(encoding="utf-8")
