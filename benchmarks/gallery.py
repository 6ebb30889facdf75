"""Every plant of ``examples/`` through the tool: verdict, gains, cost of the search, and how close simulated runs come.

    python -m benchmarks.gallery [--page] [--trajectories 200] [NAME …]

prints the table of docs/gallery.md, of all plants or those named; ``--page`` writes their rows into that page. Seconds
are of processor time, those of child processes included, for assumptions, search and check. The worst margin is the
least of ``1 − |signal|/bound`` over simulated runs inside the certificate and of the error's at their end; a negative
one would refute the certificate, and makes the command fail. A plant in ``refused/`` shows the first assumption that
fails, which has to be the one its file is named for.
"""

from __future__ import annotations

import argparse
import math
import re
import resource
import sys
import time
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

from certify.assumptions.check import check_assumptions
from certify.pipeline import GainsResult, design_gains
from certify.statement.bounds import ProvedBounds, proved_bounds
from certify.statement.claim import certified_gains
from certify.statement.controller import certified_controller
from certify.statement.numbers import shown
from certify.statement.recomputed import coordinator_envelope
from sims.certified_bounds import signal_bounds
from sims.cross_check import cross_check
from sims.deadline import certified_deadlines
from symbolic.derivation import derive
from symbolic.plant import COST_VARIABLE, Plant
from symbolic.plant_file import load_plant

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES, PAGE = ROOT / "examples", ROOT / "docs" / "gallery.md"
HEAD = "| plant | agents | orders | verdict | max K | max h | seconds | worst margin |"
LEAST = 8  # trajectories of each agent


def plants() -> dict[str, Path]:
    """All plant files of the examples by name."""
    return {path.stem: path for path in sorted(EXAMPLES.rglob("*.toml"), key=lambda path: path.stem)}


def processor_seconds() -> float:
    """Of this process and the children that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def described(plant: Plant) -> list[str]:
    """Agents and orders, which the file says."""
    return [str(len(plant.agents)), ", ".join(map(str, sorted({agent.order for agent in plant.agents})))]


def verdict(plant: Plant) -> tuple[str, GainsResult | None]:
    """``A3 fails``, or the status of the search by the default route."""
    failed = sorted({finding.id for finding in check_assumptions(plant).findings if finding.verdict == "fails"})
    if failed:
        return f"{failed[0]} fails", None
    result = design_gains(plant, route="direct")
    return result.status, result


def gains(result: GainsResult | None) -> list[str]:
    """The largest ``K`` and ``h`` of the certificate."""
    certified = certified_gains(result.certificate if result else None)
    if certified is None:
        return ["–", "–"]
    h = [agent.h for agent in certified.agents if agent.h is not None]
    return [shown(max(agent.K for agent in certified.agents), 4).text, shown(max(h), 4).text if h else "–"]


def bounds(plant: Plant, result: GainsResult) -> ProvedBounds | None:
    certified = certified_gains(result.certificate)
    envelope = None if certified is None else coordinator_envelope(plant, certified)
    if certified is None or envelope is None or isinstance(envelope, str):
        return None
    found = proved_bounds(plant, derive(plant, COST_VARIABLE), certified, envelope)
    return None if isinstance(found, str) else found


def margin(plant: Plant, result: GainsResult | None, trajectories: int) -> float:
    """Of simulated runs; NaN where no certificate was found."""
    if result is None or result.certificate is None:
        return math.nan
    found = bounds(plant, result)
    if found is None:
        return math.nan
    count = max(LEAST, -(-trajectories // len(plant.agents)))
    controller = certified_controller(result.certificate, plant, plant.name)
    due = certified_deadlines(plant, found)
    searched = cross_check(plant, controller, count=count, deadlines=due, bounds=signal_bounds(found))
    return -math.inf if searched.broken else searched.worst_margin


def row(name: str, path: Path, trajectories: int) -> tuple[str, bool]:
    """A line of the table, and whether nothing speaks against it."""
    plant, begun = load_plant(path), processor_seconds()
    said, result = verdict(plant)
    seconds = processor_seconds() - begun
    closest = margin(plant, result, trajectories)
    expected = path.parent.name != "refused" or said.lower().startswith(f"{name.split('_')[0]} ")
    cells = [f"`{name}`", *described(plant), said, *gains(result), f"{seconds:.0f}"]
    worst = (
        "–" if math.isnan(closest) else shown(Fraction(closest), 2, "down").text if closest > 0 else f"{closest:.1g}"
    )
    return f"| {' | '.join([*cells, worst])} |", expected and not closest < 0


def rows_of(page: str) -> dict[str, str]:
    """The rows of the table in a page by the plant's name."""
    _, _, table = page.partition(HEAD)
    return {match[1]: match[0] for match in re.finditer(r"^\| `(\w+)` \|.*$", table, flags=re.MULTILINE)}


def with_rows(page: str, rows: dict[str, str]) -> str:
    """The page with these rows in its table, which is sorted by name."""
    before, _, _ = page.partition(HEAD)
    kept = {**rows_of(page), **rows}
    rule = "|" + "---|" * (HEAD.count("|") - 1)
    return before + "\n".join([HEAD, rule, *(kept[name] for name in sorted(kept) if name in plants())]) + "\n"


def table(names: list[str], trajectories: int, write: bool) -> Iterator[bool]:
    known = plants()
    print(f"{HEAD}\n|{'---|' * (HEAD.count('|') - 1)}", flush=True)
    for name in names or list(known):
        line, good = row(name, known[name], trajectories)
        print(line, flush=True)
        if write:
            PAGE.write_text(with_rows(PAGE.read_text(encoding="utf-8"), {name: line}), encoding="utf-8")
        yield good


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="plants, without .toml")
    parser.add_argument("--trajectories", type=int, default=200, help="simulated runs per plant, of all agents")
    parser.add_argument("--page", action="store_true", help="write the rows into docs/gallery.md")
    options = parser.parse_args()
    return 0 if all(list(table(options.names, options.trajectories, options.page))) else 1


if __name__ == "__main__":
    sys.exit(main())
