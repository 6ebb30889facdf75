"""The tables ``[coordinator]``, ``[gains]``, ``[requirements]`` and ``[implementation]`` of a plant file.

The last three may hold a table per agent, under the agent's number: what it gives holds for that agent, what it leaves
out is as in the table around it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import partial
from typing import Any

import sympy

from symbolic import messages
from symbolic.errors import Where, nearest, quoted, shown
from symbolic.plant import CoordinatorChoice, Implementation, RequestedGains, Requirements, Settling
from symbolic.tables import Table, Value, interval, not_negative, positive

Constants = Mapping[str, sympy.Expr]

WORDS = {"arithmetic": ("double", "single"), "region": ("largest",)}
MAY_BE_ZERO = ("time", "mixing_time", "softening", "noise", "input_resolution")


@dataclass(frozen=True)
class Requested:
    """What the four tables say; the last three are empty or have an entry for every agent, in order."""

    coordinator: CoordinatorChoice
    gains: tuple[RequestedGains, ...]
    requirements: tuple[Requirements, ...]
    implementations: tuple[Implementation, ...]


def keys_of(kind: type) -> tuple[str, ...]:
    """The keys of the table that is read into this dataclass."""
    return tuple(field.name for field in fields(kind))


def read_requested(root: Table, agents: int, constants: Constants) -> Requested:
    """The four tables of a plant file with this many agents. Raises ``InputError``."""
    table = root.table("coordinator", keys_of(CoordinatorChoice))
    entries = _entries(table, constants)
    if "period" in table and "implementation" not in root:
        table.at("period").report(messages.PERIOD_ALONE(), on_key=True)
    gains = _by_agent(root.table("gains"), keys_of(RequestedGains), agents, constants)
    asked = _by_agent(root.table("requirements"), keys_of(Requirements), agents, constants)
    run = _by_agent(root.table("implementation"), keys_of(Implementation), agents, constants)
    if "implementation" in root and not all("period" in entry for entry in run):
        example = 'period = "1/1000" (seconds)'
        raise root.at("implementation").at("period").error(messages.MISSING(example=example))
    return Requested(
        CoordinatorChoice(**entries),
        tuple(RequestedGains(**entry) for entry in gains) if any(gains) else (),
        tuple(Requirements(**entry) for entry in asked) if any(asked) else (),
        tuple(Implementation(**entry) for entry in run) if "implementation" in root else (),
    )


def _by_agent(table: Table, keys: tuple[str, ...], agents: int, constants: Constants) -> list[dict[str, Any]]:
    """What holds for each agent. A key of digits is an agent's number, every other one is a key of the table."""
    own: dict[int, dict[str, Any]] = {}
    shared: dict[str, Value] = {}
    for key, value in table.entries.items():
        if key.isascii() and key.isdigit():
            if len(key) > 9 or not 1 <= int(key) <= agents:
                table.at(key).report(messages.NO_AGENT(number=quoted(key), most=agents), on_key=True)
            elif str(int(key)) != key:
                table.at(key).report(messages.LEADING_ZEROS(number=int(key)), on_key=True)
            else:
                own[int(key)] = _entries(table.table(key, keys), constants)
        else:
            shared[key] = value
    common = _entries(Table(shared, table.where, keys), constants)
    return [{**common, **own.get(number, {})} for number in range(1, agents + 1)]


def _entries(table: Table, constants: Constants) -> dict[str, Any]:
    """What could be read; the rest is noted."""
    read = {
        key: table.at(key).attempt(partial(_entry, value, table.at(key), key, constants), None)
        for key, value in table.entries.items()
    }
    return {key: value for key, value in read.items() if value is not None or key == "period"}


def _entry(value: Value, where: Where, key: str, constants: Constants) -> Any:
    if key == "settling":
        table = Table(value, where, keys_of(Settling))
        parts = keys_of(Settling)
        example = 'settling = { time = 10, band = "1/100" }'
        read = [table.read(part, example, partial(_number, key=part, constants=constants), None) for part in parts]
        known = [number for number in read if number is not None]
        return Settling(*known) if known == read else None
    if key == "delay":
        delay = interval(value, where, constants)
        if delay.lo < 0:
            raise where.error(messages.NOT_NEGATIVE(found=shown(delay.lo)))
        return delay
    if key in WORDS:
        return _word(value, where, WORDS[key])
    return _number(value, where, key, constants)


def _word(value: Value, where: Where, words: tuple[str, ...]) -> str:
    if value in list(words):
        return str(value)
    listed = " or ".join(f'"{word}"' for word in words)
    near = nearest(value, words) if isinstance(value, str) else None
    raise where.error(messages.WORD(words=listed, hint=f"; did you mean {quoted(near)}?" if near else ""))


def _number(value: Value, where: Where, key: str, constants: Constants) -> Fraction:
    return (not_negative if key in MAY_BE_ZERO else positive)(value, where, constants)
