"""What a plant file asks of the coordinator, the gains, the requirements and the implementation.

A table may hold one table per agent, under the agent's number: what that one gives holds for the agent, what it leaves
out is as in the table around it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any

from certify.checker.expressions import Node
from certify.checker.tables import Box, box, rational, table_of
from certify.checker.verdict import Malformed

ARITHMETICS = ("double", "single")
LARGEST = "largest"


@dataclass(frozen=True)
class Coordinator:
    """What the file fixes of the coordinator; None where the claim chooses. The times are in seconds."""

    alpha1: Fraction | None = None
    alpha2: Fraction | None = None
    gradient_gain: Fraction | None = None
    mixing_gain: Fraction | None = None
    mixing_time: Fraction | None = None
    softening: Fraction | None = None
    period: Fraction | None = None


@dataclass(frozen=True)
class Gains:
    """What the file fixes of one agent's gains; None where the claim chooses."""

    g: Fraction | None = None
    K: Fraction | None = None
    delta: Fraction | None = None
    h: Fraction | None = None


@dataclass(frozen=True)
class Settling:
    """``|y − s*| ≤ band`` for all ``t ≥ time``."""

    time: Fraction
    band: Fraction


@dataclass(frozen=True)
class Requirements:
    """What is asked of one agent; None where nothing is. ``region`` is ``"largest"`` or None."""

    settling: Settling | None = None
    input: Fraction | None = None
    bandwidth: Fraction | None = None
    region: str | None = None


@dataclass(frozen=True)
class Implementation:
    """How one agent's controller is run; None where the file is silent."""

    period: Fraction
    delay: Box | None = None
    noise: Fraction | None = None
    input_resolution: Fraction | None = None
    arithmetic: str | None = None


@dataclass(frozen=True)
class Requested:
    """All of it; the last three have an entry for every agent, in order."""

    coordinator: Coordinator
    gains: tuple[Gains, ...]
    requirements: tuple[Requirements, ...]
    implementations: tuple[Implementation | None, ...]


def read_requested(root: Mapping[str, Any], size: int, constants: Mapping[str, Node]) -> Requested:
    """The four tables of a plant file with ``size`` agents. Raises ``Malformed``."""
    choice = table_of(root.get("coordinator", {}), "", " ".join(field.name for field in fields(Coordinator)))
    coordinator = Coordinator(**{key: _number(value, key, constants) for key, value in choice.items()})
    if coordinator.period is not None and "implementation" not in root:
        raise Malformed("coordinator.period is only for a sampled controller, with [implementation]")
    names = {kind: [field.name for field in fields(kind)] for kind in (Gains, Requirements, Implementation)}
    gains = _by_agent(root.get("gains", {}), names[Gains], size, constants)
    asked = _by_agent(root.get("requirements", {}), names[Requirements], size, constants)
    run = _by_agent(root.get("implementation", {}), names[Implementation], size, constants)
    sampled = "implementation" in root
    if sampled and not all("period" in entry for entry in run):
        raise Malformed("implementation.period is missing")
    return Requested(
        coordinator,
        tuple(Gains(**entry) for entry in gains),
        tuple(Requirements(**entry) for entry in asked),
        tuple(Implementation(**entry) if sampled else None for entry in run),
    )


def _by_agent(value: Any, keys: list[str], size: int, constants: Mapping[str, Node]) -> list[dict[str, Any]]:
    """What holds for each agent. A key of digits is an agent's number, every other one is a key of the table."""
    if not isinstance(value, dict):
        raise Malformed("a table is needed")
    own: dict[int, dict[str, Any]] = {}
    shared: dict[str, Any] = {}
    for key, entry in value.items():
        if key.isascii() and key.isdigit():
            number = int(key) if len(key) <= 9 else 0
            if not 1 <= number <= size or str(number) != key:
                raise Malformed(f"there is no agent {key[:40]}")
            own[number] = _entries(entry, keys, constants)
        else:
            shared[key] = entry
    shared = _entries(shared, keys, constants)
    return [{**shared, **own.get(number, {})} for number in range(1, size + 1)]


def _entries(value: Any, keys: list[str], constants: Mapping[str, Node]) -> dict[str, Any]:
    return {key: _entry(entry, key, constants) for key, entry in table_of(value, "", " ".join(keys)).items()}


def _entry(value: Any, key: str, constants: Mapping[str, Node]) -> Any:
    if key == "settling":
        table = table_of(value, "time band")
        return Settling(_number(table["time"], "time", constants), _number(table["band"], "band", constants))
    if key == "delay":
        delay = box(value, constants)
        if delay[0] < 0:
            raise Malformed("a delay is not negative")
        return delay
    if key in ("arithmetic", "region"):
        words = ARITHMETICS if key == "arithmetic" else (LARGEST,)
        if value not in list(words):
            raise Malformed(f"{key} is one of {', '.join(words)}")
        return value
    return _number(value, key, constants)


def _number(value: Any, key: str, constants: Mapping[str, Node]) -> Fraction:
    number = rational(value, constants)
    if number < 0 or (number == 0 and key not in ("time", "mixing_time", "softening", "noise", "input_resolution")):
        raise Malformed(f"{key} is {'not negative' if number < 0 else 'positive'}")
    return number
