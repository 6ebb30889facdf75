"""The JSON Schema of plant files: current, shipped, and never stricter than the readers."""

from __future__ import annotations

import json
import random
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from fuzz.valid_plants import valid_plant
from wrong.plants import PLANT, WRONG

from symbolic.errors import InputError
from symbolic.plant_file import parse_plant
from symbolic.schema import FILE, plant_schema

ROOT = Path(__file__).parents[1]
SCHEMA = plant_schema()
TYPES = {"object": dict, "array": list, "string": str, "integer": int, "number": (int, float)}


def fits(value: Any, schema: dict[str, Any]) -> bool:
    """Whether the value is valid, for the words of draft 7 that the schema uses; another word is an error."""
    rules = {
        "$ref": lambda ref: fits(value, SCHEMA["definitions"][ref.rpartition("/")[2]]),
        "type": lambda kinds: any(
            isinstance(value, TYPES[kind]) and not isinstance(value, bool)
            for kind in (kinds if isinstance(kinds, list) else [kinds])
        ),
        "anyOf": lambda options: any(fits(value, option) for option in options),
        "const": lambda other: value == other,
        "enum": lambda others: value in others,
        "pattern": lambda pattern: not isinstance(value, str) or re.search(pattern, value) is not None,
        "minLength": lambda least: not isinstance(value, str) or len(value) >= least,
        "maxLength": lambda most: not isinstance(value, str) or len(value) <= most,
        "minimum": lambda least: isinstance(value, str) or value >= least,
        "maximum": lambda most: isinstance(value, str) or value <= most,
        "exclusiveMinimum": lambda least: isinstance(value, str) or value > least,
        "minItems": lambda least: not isinstance(value, list) or len(value) >= least,
        "maxItems": lambda most: not isinstance(value, list) or len(value) <= most,
        "items": lambda inner: not isinstance(value, list) or all(map(fits, value, _each(inner, len(value)))),
        "required": lambda keys: not isinstance(value, dict) or all(key in value for key in keys),
        "propertyNames": lambda inner: not isinstance(value, dict) or all(fits(key, inner) for key in value),
    }
    passed = all(rules[word](rule) for word, rule in schema.items() if word in rules)
    known = {*rules, "properties", "patternProperties", "additionalProperties", "description", "title", "$schema"}
    assert set(schema) <= known | {"definitions"}, set(schema) - known
    return passed and (not isinstance(value, dict) or all(_entry_fits(key, value[key], schema) for key in value))


def _each(items: Any, count: int) -> list[Any]:
    """The schema of each entry: one for all, or one for each."""
    return items if isinstance(items, list) else [items] * count


def _entry_fits(key: str, value: Any, schema: dict[str, Any]) -> bool:
    if key in schema.get("properties", {}):
        return fits(value, schema["properties"][key])
    for pattern, inner in schema.get("patternProperties", {}).items():
        if re.search(pattern, key):
            return fits(value, inner)
    rest = schema.get("additionalProperties", True)
    return rest if isinstance(rest, bool) else fits(value, rest)


def test_the_file_is_made_from_the_code() -> None:
    made = json.dumps(plant_schema(), indent=1, ensure_ascii=False) + "\n"
    assert FILE.read_text() == made, "make it again: python -m symbolic.schema > symbolic/plant.schema.json"


def test_it_is_part_of_the_wheel() -> None:
    data = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    assert FILE.name in data["symbolic"]


@pytest.mark.parametrize(
    "path",
    sorted([*ROOT.glob("examples/**/*.toml"), *ROOT.glob("tests/tamper/plants/*.toml")]),
    ids=lambda path: path.stem,
)
def test_every_example_fits(path: Path) -> None:
    assert fits(tomllib.loads(path.read_text()), SCHEMA)


def test_what_the_reader_accepts_fits() -> None:
    accepted = 0
    for number in range(60):
        data = valid_plant(random.Random(f"schema/{number}"))
        try:
            parse_plant(data, "p.toml")
        except InputError:
            continue
        accepted += 1
        assert fits(tomllib.loads(data.decode()), SCHEMA), data.decode()
    assert accepted > 40


SEEN = [
    "a key misspelt",
    "a table misspelt",
    "one bracket",
    "ids misspelt",
    "no order",
    "no cost",
    "schema of another version",
    "edges as pairs",
    "edges as one text",
    "the number of agents as a text",
    "no agents",
    "an empty list of ids",
    "order 0",
    "an interval of three numbers",
    "a zero state with a prime",
    "M without N",
    "a gain of 0",
    "a gain in lower case",
    "gains of agent 01",
    "settling as a number",
    "settling without a band",
    "the largest region misspelt",
    "an unknown arithmetic",
]


@pytest.mark.parametrize("title", SEEN)
def test_an_editor_sees_what_needs_no_reader(title: str) -> None:
    assert fits(tomllib.loads(PLANT), SCHEMA)
    wrong = next(wrong for wrong in WRONG if wrong.title == title)
    assert not fits(tomllib.loads(wrong.file.decode()), SCHEMA)


def test_every_key_says_what_it_means() -> None:
    def tables(schema: Any) -> list[dict[str, Any]]:
        if not isinstance(schema, dict):
            return []
        return [schema.get("properties", {}), *(table for value in schema.values() for table in tables(value))]

    for properties in tables(SCHEMA):
        for key, value in properties.items():
            assert value.get("description"), key
