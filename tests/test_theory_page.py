"""docs/theory.md: every row with a ● names tests, and they exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")


def functions(path: Path) -> set[str]:
    return {node.name for node in ast.parse(path.read_text(encoding="utf-8")).body if isinstance(node, ast.FunctionDef)}


def test_every_marked_row_is_tested_by_tests_that_exist() -> None:
    marked = re.findall(r"^\| (F\d+ ●) \|", PAGE, flags=re.MULTILINE)
    assert marked == [f"F{k} ●" for k in (1, 2, 4, 5, 7, 8, 13, 18, 19, 20, 23)]
    for row in marked:
        (line,) = re.findall(rf"^\* {row}: (.*)$", PAGE, flags=re.MULTILINE)
        named = re.findall(r"`(tests/\w+\.py)::(\w+)`", line)
        assert named, row
        for file, test in named:
            assert test in functions(ROOT / file), f"{row}: {file}::{test}"


def test_links_of_the_page_lead_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", PAGE):
        assert (ROOT / "docs" / target).is_file(), target
