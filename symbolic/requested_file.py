"""The tables ``[coordinator]``, ``[gains]``, ``[requirements]`` and ``[implementation]`` of a plant file.

The last three may hold a table per agent, under the agent's number: what it gives holds for that agent, what it leaves
out is as in the table around it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any

import sympy

from symbolic.errors import Where, nearest, quoted, shown
from symbolic.plant import CoordinatorChoice, Implementation, RequestedGains, Requirements, Settling
from symbolic.tables import Table, Value, interval, number, positive

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
    entries = {key: _number(value, table.at(key), key, constants) for key, value in table.entries.items()}
    if "period" in table and "implementation" not in root:
        raise table.at("period").error(
            "only a sampled controller has one; add [implementation] with its period, or leave this out"
        )
    gains = _by_agent(root.table("gains"), keys_of(RequestedGains), agents, constants)
    asked = _by_agent(root.table("requirements"), keys_of(Requirements), agents, constants)
    run = _by_agent(root.table("implementation"), keys_of(Implementation), agents, constants)
    if "implementation" in root and not all("period" in entry for entry in run):
        raise root.at("implementation").at("period").error('missing; for example period = "1/1000" (seconds)')
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
                raise table.at(key).error(f"there is no agent {quoted(key)}; agents are 1 to {agents}")
            if str(int(key)) != key:
                raise table.at(key).error(f"write {int(key)} without leading zeros")
            own[int(key)] = _entries(Table(value, table.at(key), keys), constants)
        else:
            shared[key] = value
    common = _entries(Table(shared, table.where, keys), constants)
    return [{**common, **own.get(number, {})} for number in range(1, agents + 1)]


def _entries(table: Table, constants: Constants) -> dict[str, Any]:
    return {key: _entry(value, table.at(key), key, constants) for key, value in table.entries.items()}


def _entry(value: Value, where: Where, key: str, constants: Constants) -> Any:
    if key == "settling":
        table = Table(value, where, keys_of(Settling))
        time, band = (
            _number(table.need(part, 'settling = { time = 10, band = "1/100" }'), table.at(part), part, constants)
            for part in keys_of(Settling)
        )
        return Settling(time, band)
    if key == "delay":
        delay = interval(value, where, constants)
        if delay.lo < 0:
            raise where.error(f"a delay is not negative, found {shown(delay.lo)}")
        return delay
    if key in WORDS:
        return _word(value, where, WORDS[key])
    return _number(value, where, key, constants)


def _word(value: Value, where: Where, words: tuple[str, ...]) -> str:
    if value in list(words):
        return str(value)
    listed = " or ".join(f'"{word}"' for word in words)
    near = nearest(value, words) if isinstance(value, str) else None
    raise where.error(f"{listed} is needed" + (f"; did you mean {quoted(near)}?" if near else ""))


def _number(value: Value, where: Where, key: str, constants: Constants) -> Fraction:
    if key not in MAY_BE_ZERO:
        return positive(value, where, constants)
    exact = number(value, where, constants)
    if exact < 0:
        raise where.error(f"a number that is not negative is needed, found {shown(exact)}")
    return exact
