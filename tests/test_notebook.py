"""The notebook runs from top to bottom, as a kernel would run it, and ends with a PDF."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest

import certify

NOTEBOOK = Path(__file__).resolve().parent.parent / "examples" / "from_graph_to_report.ipynb"


def run(cells: list[str]) -> list[object]:
    """The value of every cell's last line, if that is an expression."""
    names: dict[str, object] = {"__name__": "__main__"}
    values = []
    for number, source in enumerate(cells):
        tree = ast.parse(source, f"cell {number}")
        last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, f"cell {number}", "exec"), names)  # noqa: S102 - the project's own notebook
        value = ast.Expression(last.value) if isinstance(last, ast.Expr) else None
        values.append(eval(compile(value, f"cell {number}", "eval"), names) if value else None)  # noqa: S307 - as above
    return values


@pytest.mark.slow
def test_from_a_graph_to_a_pdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    cells = [c for c in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"] if c["cell_type"] == "code"]
    assert all(not cell["outputs"] for cell in cells)
    values = run(["".join(cell["source"]) for cell in cells])
    statuses = [value.status for value in values if hasattr(value, "status")]
    assert statuses == ["holds", "holds", "certified", "verified", "certified"]
    assert (tmp_path / "three_tanks.pdf").read_bytes().startswith(b"%PDF")
    assert certify.verify(tmp_path / "three_tanks.toml", tmp_path / "three_tanks.json").status == "verified"
