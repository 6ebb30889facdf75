"""Plant files one to three steps away from a valid one: entries taken out, moved, wrapped, renamed, or replaced."""

from __future__ import annotations

import copy
import json
import random
import tomllib
from typing import Any

from .valid_plants import KEYS, PLAIN, TAKEN, valid_plant

NUMBERS = (0, 1, 2, 3, -1, -5, 0.5, 1e5, -0.0, 10**30, 2**4001, True)
TEXTS = (
    "|1|0|x1|x2|x16|x17|s|id|pi|z1|p|v1|1/3|-1/2|sqrt(2)|sqrt(4)|8^(1/3)|(-8)^(1/3)|0^(1/2)|1/0|0^0|2^0.5|x1^(1/3)|01|3"
    "|measured|largest|double|1-2|1..2|2-1|1 -> 2|2 -> 1|1 -> 1|1e300|1e301|1e-300|1e+000300|consensus-plant/1|exp(1)"
    "|log(1)|sin(0)|cos(0)^0|pi/pi|2*pi|cos(pi)|sqrt(2)*sqrt(2)|(1+sqrt(2))^2|1/(x1-x1)|tan(pi/4)|sinh(0)|id^(1/2)|id/2"
    "|-id|(2)^(-1)|((1))|+1|--1|1.|  1 |1\n|1\t+ 2|1_0|0x10"
).split("|")
TREES: tuple[Any, ...] = ([], {}, [0, 1], [1, 0], [[0, 1]], [[0, 1], [2, 3]], {"time": 1, "band": 1}, {"1": {"K": 2}})
VALUES = (*NUMBERS, *TEXTS, *TREES)
NAMES = (*KEYS, *PLAIN, *TAKEN, "0", "1", "2", "3", "01", "x3", "")


def mutated_plant(rng: random.Random) -> bytes:
    """One file, a function of the state of ``rng``."""
    tree = tomllib.loads(valid_plant(rng).decode())
    for _ in range(rng.randint(1, 3)):
        found = places(tree)
        if found:
            _mutate(rng, *rng.choice(found), found)
    return document(tree)


def _mutate(rng: random.Random, container: Any, key: Any, found: list[tuple[Any, Any]]) -> None:
    kind, value = rng.randrange(7), container[key]
    if kind == 0:
        del container[key]
    elif kind == 1:
        other, there = rng.choice(found)
        container[key] = copy.deepcopy(other[there])
    elif kind == 2:
        container[key] = [value]
    elif kind == 3 and isinstance(value, dict):
        value[rng.choice(NAMES)] = copy.deepcopy(rng.choice(VALUES))
    elif kind == 4 and isinstance(value, list):
        value.append(copy.deepcopy(rng.choice(VALUES)))
    elif kind == 5 and isinstance(container, dict):
        container[rng.choice(NAMES)] = container.pop(key)
    else:
        container[key] = copy.deepcopy(rng.choice(VALUES))


def places(tree: Any) -> list[tuple[Any, Any]]:
    """Every container and key of a tree."""
    found = []
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ():
        found += [(tree, key), *places(tree[key])]
    return found


def document(tree: dict[str, Any]) -> bytes:
    """The tree as TOML, a line for each of its keys."""
    return "\n".join(f"{json.dumps(key)} = {toml(value)}" for key, value in tree.items()).encode()


def toml(value: Any) -> str:
    """A TOML value; tables inline."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value).replace("\\ud", "?").replace("\x7f", "?") if isinstance(value, str) else str(value)
