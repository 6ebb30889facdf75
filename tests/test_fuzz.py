"""A slice of ``python -m tests.fuzz``: the readers refuse broken input in one line, and the watch sees what it
should."""

from __future__ import annotations

import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from fuzz.agreement import difference
from fuzz.inputs import Input, make
from fuzz.readers import Tally, feed
from fuzz.share import meaning, plants
from wrong.plants import PLANT

from certify.checker.plant import read_plant
from symbolic.plant_file import parse_plant

ROOT = Path(__file__).parents[1]
CERTIFICATES = [path.read_bytes() for path in sorted((ROOT / "tests" / "checker_corpus").glob("*.json"))]


@pytest.mark.parametrize("count", [600, pytest.param(20_000, marks=pytest.mark.slow)])
def test_no_reader_fails_on_any_input(count: int) -> None:
    tally, seeds = Tally(), plants()
    for number in range(count):
        feed(make(random.Random(f"slice/{number}"), seeds, CERTIFICATES), tally)
    assert [reason for reason, _ in (*tally.faults, *tally.disagreements)] == []
    assert {outcome for _, _, outcome in tally.outcomes} == {"accepted", "refused"}


@pytest.mark.parametrize("count", [300, pytest.param(40_000, marks=pytest.mark.slow)])
def test_both_plant_readers_mean_the_same(count: int) -> None:
    """Whole files whose names are keys, functions, the tool's own symbols: equal field by field, or both refuse."""
    tally = Tally()
    for number in range(count):
        feed(meaning(random.Random(f"slice/{number}"), number), tally)
    assert [reason for reason, _ in (*tally.faults, *tally.disagreements)] == []
    assert tally.outcomes["plant reader", "meaning", "accepted"] > count // 3
    assert tally.outcomes["plant reader", "mutated", "refused"] > count // 3


def many_faults() -> dict[str, str]:
    """Files with a great many faults, each of which could be looked at for long."""
    lines = "\n".join(f"q{k} = 1" for k in range(40_000))
    names = "+".join(f"n{k}" for k in range(990))
    constants = "\n".join(f"c{k} = 1" for k in range(900))
    edges = ", ".join(['"a"'] * 40_000)
    return {
        "unknown keys": lines,
        "unknown keys of an agent": PLANT + lines,
        "unknown names": PLANT.replace("(s - id)^2", names).replace("[constants]", f"[constants]\n{constants}"),
        "bad edges": PLANT.replace('"1 -> 2"', edges),
        "bad constants": PLANT.replace("[constants]", "[constants]\n" + constants.replace("= 1", '= "q"')),
    }


@pytest.mark.parametrize("kind", many_faults())
def test_a_great_many_faults_take_no_reader_long(kind: str) -> None:
    tally = Tally()
    feed(Input("plant", "faults", many_faults()[kind].encode()), tally)
    assert [reason for reason, _ in (*tally.faults, *tally.disagreements)] == []
    assert set(tally.outcomes) == {
        (reader, "faults", "refused") for reader in ("plant reader", "checker's plant reader")
    }


def test_both_plant_readers_accept_every_plant_and_agree_on_it() -> None:
    tally = Tally()
    for data in plants():
        feed(Input("plant", "valid", data), tally)
    assert tally.disagreements == []
    assert (
        tally.outcomes["plant reader", "valid", "accepted"]
        == tally.outcomes["checker's plant reader", "valid", "accepted"]
        == len(plants())
    )


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("p = [-1, 1]", "p = [-1, 2]"),
        ('f = "p*x1"', 'f = "p*x1^3"'),
        ("box = [-1, 1]", "box = [-1, 3]"),
        ("reference = 0", "reference =   1"),
        ('b = "1"', 'b = "1"\nobserver = [3]'),
    ],
)
def test_plants_that_are_read_differently_are_noticed(old: str, new: str) -> None:
    data = (ROOT / "tests" / "tamper" / "plants" / "small_first_order.toml").read_bytes()
    other = replace(parse_plant(data.replace(old.encode(), new.encode()), "x.toml"), sha256=read_plant(data).sha256)
    mine = ("accepted", read_plant(data))
    assert difference(mine, ("accepted", parse_plant(data, "x.toml"))) is None
    assert "read differently" in str(difference(mine, ("accepted", other)))


def test_watch_notices_code_that_is_run_files_that_are_opened_and_readers_that_do_not_end() -> None:
    script = """
from fuzz import readers
from fuzz.inputs import Input
readers.SECONDS = 1
readers.watch()
def runs(data): exec("1")
def opens(data): open("/dev/null")
def hangs(data):
    while True: pass
def hoards(data): return [bytes(1 << 28) for _ in range(64)]
tally = readers.Tally()
for reader in (runs, opens, hangs, hoards):
    readers.read(reader.__name__, reader, ValueError, Input("plant", "x", b""), tally)
print([reason.split()[1].rstrip(":") for reason, _ in tally.faults])
"""
    found = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=ROOT,
        env={"PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}", "PATH": ""},
        check=True,
    )
    assert found.stdout.strip() == "['Touched', 'Touched', 'TooLong', 'MemoryError']"
