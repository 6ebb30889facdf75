"""Plant files as text for tests: one that uses every key and one that uses the fewest."""

from __future__ import annotations

import re

import pytest

from symbolic.errors import InputError
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant

POSITION = re.compile(r"p\.toml(?::([1-9][0-9]*):([1-9][0-9]*))?: ")
BASE = """
schema = "consensus-plant/1"
name = "two"

[network]
agents = 2
edges = ["1 -> 2", ["2 -> 1", 0.1]]

[constants]
theta = "4/5"
A = 10
A1 = "A*1.1"
root = "sqrt(2)"

[exosystem]
states = ["v1", "v2"]
S = [[0, "theta"], ["-theta", 0]]
initial = { v1 = 0, v2 = [0.5, 1] }

[initial]
box = [-1, 1]
reference = 0

[[agent]]
ids = [1, 2]
zero_dynamics = { z1 = "p1*z1 + x1 + A1*v1" }
order = 2
f = "p2*z1*x1*x2 + k*x2 + A*v2"
b = "1 + p2^2"
cost = "(s - id + 1)^2/4"
constants = { k = "id*A" }
uncertain = { p1 = ["-id - 1/2", "-id + 1/2"], p2 = [-0.5, 0.5] }
steady_state = { z1 = "-s/p1" }
zero_dynamics_lyapunov = "z1^2/2"
internal_model = { M = [[0, 1], [-2, -3]], N = [0, 1] }
gamma = ["1/2"]
observer = [1, 2]

[coordinator]
alpha1 = 3
alpha2 = "3/2"

[gains]
K = 40000
h = 100
"""

LONE = """
schema = "consensus-plant/1"
name = "lone"
[network]
agents = 1
edges = []
[initial]
box = 0
[[agent]]
ids = [1]
order = 3
f = "x3"
b = 1
cost = "s^2"
"""


def read(text: str) -> Plant:
    return parse_plant(text.encode(), "p.toml")


def refusal(text: str | bytes) -> str:
    with pytest.raises(InputError) as caught:
        parse_plant(text if isinstance(text, bytes) else text.encode(), "p.toml")
    """The lines of the refusal, each without file and position."""
    lines = []
    for line in caught.value.lines:
        assert line.isprintable()
        match = POSITION.match(line)
        assert match is not None, line
        lines.append(line[match.end() :])
    return "\n".join(lines)


def changed(old: str, new: str, base: str = BASE) -> str:
    assert base.count(old) == 1
    return base.replace(old, new)
