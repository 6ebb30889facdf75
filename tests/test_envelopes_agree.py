"""What the search takes for the references' bounds is no less than what the checker will compute from its witnesses."""

from __future__ import annotations

from fractions import Fraction

import pytest

from certify.certificate import canonical
from certify.checker.certificate import read_certificate
from certify.checker.plant import read_plant
from certify.checker.rules import assumptions, coordinator
from certify.checker.rules.mixing import UNIT
from certify.checker.theorems import kinds
from certify.checker.verdict import start_meter
from certify.pipeline import design_gains
from symbolic.plant_file import parse_plant

ROUNDING = Fraction(1, 10**9)


def plant(cost: str) -> bytes:
    return f"""
schema = "consensus-plant/1"
name = "pair"
network = {{ agents = 2, edges = ["1 -> 2", "2 -> 1"] }}
initial = {{ box = 0 }}
[[agent]]
ids = [1, 2]
order = 1
f = "-x1"
b = 1
cost = "{cost}"
""".encode()


@pytest.mark.parametrize(
    "cost",
    [
        "(s - id)^2/2",
        "s^2/2 + log(1 + exp(s - id))",
        "(s - id/5)^2/4 + sqrt(1 + s^2)",
        "(s - id)^2 + s*atan(s)",
    ],
)
def test_the_checkers_walk_stays_below_the_producers(cost: str) -> None:
    text = plant(cost)
    produced = design_gains(parse_plant(text, "pair.toml"), route="recipe")
    assert produced.certificate is not None and produced.envelope is not None, produced.reason
    start_meter()
    read, certificate = read_plant(text), read_certificate(canonical(produced.certificate) + b"\n", kinds())
    checked = coordinator.prove(read, certificate, assumptions.prove(read, certificate))
    for ours, theirs in zip(produced.envelope.agents, checked, strict=True):
        for k, step in enumerate(theirs.reference.steps):
            assert Fraction(step.distance, UNIT) <= ours.deviation[k] + ROUNDING
            assert Fraction(step.speed, UNIT) <= ours.rate[k] + ROUNDING
