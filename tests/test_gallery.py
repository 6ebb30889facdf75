"""The table of docs/gallery.md is what the tool says: all of it in ``-m slow``, a slice with the usual tests."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from benchmarks.gallery import HEAD, PAGE, described, plants, row, rows_of, verdict, with_rows
from reports.command_line import main
from symbolic.plant_file import load_plant

ROWS = rows_of(PAGE.read_text(encoding="utf-8"))
REFUSED = [name for name, path in plants().items() if path.parent.name == "refused"]
QUICK = ("wind_turbine", "first_order")
TRAJECTORIES = 24
SAME = 2  # gains of the search may differ by a few steps of its ladders where floats differ


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def number(cell: str) -> float:
    """``2.4e9 (log10 9.38)`` without what stands beside it."""
    return float(cell.partition(" ")[0])


def test_every_plant_has_a_row_and_every_row_a_plant() -> None:
    assert list(ROWS) == list(plants())
    for name, path in plants().items():
        assert cells(ROWS[name])[1:3] == described(load_plant(path)), name
        assert len(cells(ROWS[name])) == len(cells(HEAD))


def test_every_assumption_has_a_plant_that_it_refuses() -> None:
    assert {name[:2].upper() for name in REFUSED} == {f"A{k}" for k in range(7)}


@pytest.mark.parametrize("name", REFUSED)
def test_plants_are_refused_for_the_assumption_they_are_named_for(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = plants()[name]
    said, result = verdict(load_plant(path))
    assert said == cells(ROWS[name])[3] == f"{name[:2].upper()} fails" and result is None
    assert re.match(rf"# {said}: ", path.read_text(encoding="utf-8"))
    assert main(["gains", str(path), "-o", str(tmp_path / "c.json")]) == 1
    assert re.search(rf"^refuted: {said[:2]}\b", capsys.readouterr().out, flags=re.MULTILINE)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in plants() if name not in REFUSED],
)
def test_the_tool_says_of_a_plant_what_its_row_says(name: str) -> None:
    line, good = row(name, plants()[name], TRAJECTORIES)
    mine, theirs = cells(line), cells(ROWS[name])
    assert good and mine[:4] == theirs[:4]
    for found, known in zip(mine[4:6], theirs[4:6], strict=True):
        assert (found == "–") == (known == "–")
        assert found == "–" or 1 / SAME <= number(found) / number(known) <= SAME, (line, ROWS[name])
    assert (mine[7] == "–") == (mine[3] != "certified")


def test_rows_are_put_where_they_belong() -> None:
    page = f"# Page\n\n{HEAD}\n|---|\n| `rooms` | old |\n| `no_such_plant` | old |\n"
    changed = with_rows(page, {"rooms": "| `rooms` | new |", "chua": "| `chua` | new |"})
    assert list(rows_of(changed)) == ["chua", "rooms"] and "old" not in changed
    assert with_rows(changed, {}) == changed and changed.startswith("# Page\n")
