"""Wrong plant files: what is said about them tells what to change, where, and everything at once."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from wrong.catalogue import page, refusal, rows
from wrong.plants import LIMITS, PLANT, WRONG, Wrong

from certify.checker.plant import read_plant
from certify.checker.verdict import Malformed
from certify.verification import verification
from symbolic import messages
from symbolic.errors import InputError
from symbolic.plant_file import parse_plant
from symbolic.toml_places import Places

DOCS = Path(__file__).parents[1] / "docs"
PARTS = re.compile(r"plant\.toml(:[1-9][0-9]*:[1-9][0-9]*)?: ")


@pytest.mark.parametrize("wrong", [*WRONG, *LIMITS], ids=lambda wrong: wrong.title)
def test_a_wrong_file_is_told_what_to_change(wrong: Wrong) -> None:
    error = refusal(wrong)
    assert any(wrong.help in line for line in error.lines), error.lines
    assert all(line.isprintable() and PARTS.match(line) for line in error.lines)


BEYOND_THE_TOOL = {  # it makes sense, and the tool will not compute with it
    "a division by zero",
    "0 to the power 0",
    "a root of a square",
    "a power that nobody expands",
    "a power as exp of log",
    "the root of a long number",
    "a constant in 14 functions",
    "five million characters",
}


@pytest.mark.parametrize(
    "wrong", [wrong for wrong in (*WRONG, *LIMITS) if wrong.title not in BEYOND_THE_TOOL], ids=lambda wrong: wrong.title
)
def test_the_checker_does_not_read_a_wrong_file_either(wrong: Wrong) -> None:
    with pytest.raises(Malformed):
        read_plant(wrong.file)


def test_the_file_that_the_wrong_ones_are_made_of_is_right() -> None:
    assert len(parse_plant(PLANT.encode(), "plant.toml").agents) == 2


def test_every_message_has_a_file_that_triggers_it_and_the_catalogue_is_current() -> None:
    assert {name for name, _, _ in rows()} == set(messages.ALL)
    assert (DOCS / "messages.md").read_text() == page(), "make it again: python -m tests.wrong > docs/messages.md"


def test_all_faults_are_said_at_once_in_the_order_of_the_file() -> None:
    text = PLANT.replace('"2 -> 1"', '"2 - 1"').replace('m = "3/2"', 'm = "1/0"').replace("v1 = 0", "v1 = q")
    text = text.replace("v1 = q", "v1 = [1, 0]").replace("+ v1", "+ v9 + u").replace("order = 2", "order = two")
    text = text.replace("order = two", 'order = "two"') + "[gains]\nK = 0\ng = -1\n"
    with pytest.raises(InputError) as caught:
        parse_plant(text.encode(), "plant.toml")
    keys = [problem.key for problem in caught.value.problems]
    assert keys == [
        "network.edges[2]",
        "constants.m",
        "exosystem.initial.v1",
        "agent[1].order",
        "agent[1].f",
        "agent[1].f",
        "gains.K",
        "gains.g",
    ]
    lines = text.splitlines()
    for problem in caught.value.problems:
        assert problem.position is not None
        line, column = problem.position
        assert lines[line - 1][column - 1 :].startswith(('"', "[", "0", "-1", "v9", "u", "/0", "1/0"))


def test_one_slip_in_a_shared_table_is_said_once() -> None:
    text = PLANT.replace("-k*x1", "-kk*x1")
    with pytest.raises(InputError) as caught:
        parse_plant(text.encode(), "plant.toml")
    assert len(caught.value.lines) == 1


def test_more_than_fifty_faults_are_too_many() -> None:
    edges = ", ".join(['"1 - 2"'] * 60)
    with pytest.raises(InputError) as caught:
        parse_plant(PLANT.replace('"1 -> 2"', edges).encode(), "plant.toml")
    assert len(caught.value.lines) == 51
    assert caught.value.lines[-1] == "plant.toml: and more"


QUIRKS = '''# a comment with [brackets] = and "quotes"
"schema"   =  'literal # no comment'   # comment
a.b . "c d" = 1
[t."x.y"]
s = """
two # lines
"""
many = [ # comment
  [1, 2], { k = "v" , l.m = [3] },
  1979-05-27T07:32:00Z,
]
[[agent]]
f = "p"
[agent.sub]
g = 'x'
[[agent]]
f = """q"""
'''


def test_keys_and_values_are_found_where_they_stand() -> None:
    tomllib.loads(QUIRKS)
    places = Places(QUIRKS)
    assert places.of(("schema",)) == (2, 15)
    assert places.of(("schema",), column=1) == (2, 16)
    assert places.of(("a", "b", "c d"), key=True) == (3, 7)
    assert places.of(("t", "x.y", "s")) == (5, 5)
    assert places.of(("t", "x.y", "s"), column=3) == (5, 5)  # the text has lines of its own
    assert places.of(("t", "x.y", "many", 1, 2)) == (9, 7)
    assert places.of(("t", "x.y", "many", 2, "k"), key=True) == (9, 13)
    assert places.of(("t", "x.y", "many", 2, "l", "m", 1)) == (9, 30)
    assert places.of(("t", "x.y", "many", 3)) == (10, 3)
    assert places.of(("agent", 1, "sub", "g"), column=1) == (15, 6)
    assert places.of(("agent", 2, "f"), column=1) == (17, 8)
    assert places.of(("agent", 2, "b")) == (16, 1)  # what is missing is where its table is
    assert places.of(("nowhere",)) is None


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_lines_are_counted_alike(newline: str) -> None:
    text = PLANT.replace("(s - id)^2", "(s - ids)^2").replace("\n", newline)
    with pytest.raises(InputError, match=r"^plant\.toml:29:14: agent\[1\]\.cost: column 6: unknown name 'ids'"):
        parse_plant(text.encode(), "plant.toml")


def test_verify_says_as_much_of_a_wrong_plant_as_the_other_commands() -> None:
    wrong = PLANT.replace("order = 2", "order = 0").replace("(s - id)^2", "(s - ids)^2").encode()
    with pytest.raises(InputError) as caught:
        verification(wrong, b"{}", plant_name="plant.toml")
    assert [line.partition(": ")[0] for line in caught.value.lines] == ["plant.toml:26:9", "plant.toml:29:14"]
