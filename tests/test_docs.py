"""The code of every page runs: files are written, commands run in order, and what a page shows is what is said."""

from __future__ import annotations

import re
import runpy
import shlex
from pathlib import Path

import pytest

from reports.command_line import main
from symbolic.models.model_file import read_model
from symbolic.plant_file import load_plant

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGES = sorted(DOCS.glob("*.md"))
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
FILE = re.compile(r"# file: (\S+)\n")


def runnable(page: Path) -> list[tuple[str, str]]:
    """Files, console sessions and Python of one page, in order."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [(language, text) for language, text in found if language in ("toml", "console", "python")]


def sessions(text: str) -> list[tuple[list[str], list[str]]]:
    """The commands of a console block, each with the lines that are shown below it."""
    parts = re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]
    return [(shlex.split(lines[0])[1:], lines[1:]) for lines in (part.splitlines() for part in parts)]


def test_there_are_pages_with_code() -> None:
    assert len(PAGES) > 10
    assert sum(len(runnable(page)) for page in PAGES) >= 8


@pytest.mark.parametrize("page", [page for page in PAGES if runnable(page)], ids=lambda page: page.stem)
def test_the_code_of_a_page_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for number, (language, text) in enumerate(runnable(page)):
        named = FILE.match(text)
        if language == "toml":
            assert named, f"{page.name}: a block of TOML that is no file: {text[:40]!r}"
            Path(named[1]).write_text(text, encoding="utf-8")
            if 'schema  = "consensus-model/1"' in text:
                assert read_model(text.encode(), named[1]).plant.agents
            else:
                assert load_plant(Path(named[1])).agents
        elif language == "python":
            script = Path(f"block_{number}.py")
            script.write_text(text, encoding="utf-8")
            runpy.run_path(str(script))
        else:
            for arguments, shown in sessions(text):
                code = main(arguments)
                said = "".join(capsys.readouterr())
                assert code == 0, f"{page.name}: {arguments}: {said}"
                assert all(line in said for line in shown), f"{page.name}: {arguments}: {said}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_between_pages_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#:]+?)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert all((DOCS / link).exists() for link in links), links


def test_every_page_is_in_the_table_of_contents() -> None:
    listed = re.findall(r"^([\w-]+)$", (DOCS / "index.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert sorted(name for name in listed if (DOCS / f"{name}.md").exists()) == sorted(
        page.stem for page in PAGES if page.stem != "index"
    )


def test_the_gallery_lists_every_example() -> None:
    examples = DOCS.parent / "examples"
    described, _, _ = (DOCS / "gallery.md").read_text(encoding="utf-8").partition("## What the tool says")
    listed = re.findall(r"^\| `(\w+)` \|", described, flags=re.MULTILINE)
    assert sorted(listed) == sorted(path.stem for path in examples.rglob("*.toml"))
