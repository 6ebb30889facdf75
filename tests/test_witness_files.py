"""The witness files in ``examples/witnesses``: each is replayed, and the search finds its like again."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest

from sims.witness import read_witness, replay

ROOT = Path(__file__).parent.parent
SHOWN = {
    "f1": ("escaped", 0.2, 0.3),
    "published": ("escaped", 2.5, 3.0),
    "published-centre": ("oscillates", 80.0, 80.0),
    "3-30-100": ("escaped", 3.0, 3.3),
    "2-10-50": ("escaped", 1.5, 2.5),
}


@pytest.fixture(scope="module")
def command() -> Any:
    spec = importlib.util.spec_from_file_location("witnesses", ROOT / "benchmarks" / "witnesses.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_there_is_a_file_for_every_case(command: Any) -> None:
    assert {case.name for case in command.CASES} == set(SHOWN) == {file.stem for file in command.FOLDER.glob("*.json")}


@pytest.mark.parametrize("name", SHOWN)
def test_a_file_shows_what_it_says(command: Any, name: str) -> None:
    (case,) = [case for case in command.CASES if case.name == name]
    witness = read_witness((command.FOLDER / f"{name}.json").read_text(), name)
    again = replay(*case.loaded(), witness)
    fate, earliest, latest = SHOWN[name]
    assert (again.broken, again.fate, witness.fate) == (True, fate, fate)
    assert earliest <= again.end <= latest
    if fate == "oscillates":
        assert 0.04 < again.amplitudes[-1] < 0.08


SEARCHED = [
    pytest.param(name, marks=pytest.mark.slow) if name == "published-centre" else name  # 80 s of a stiff oscillation
    for name in SHOWN
]


@pytest.mark.parametrize("name", SEARCHED)
def test_the_search_finds_it_again(command: Any, name: str) -> None:
    (case,) = [case for case in command.CASES if case.name == name]
    witness = command.found(case)
    assert witness is not None and witness.fate == SHOWN[name][0]
