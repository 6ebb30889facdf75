"""A1 of the checker: a cost must be smooth on the whole line before its second derivative says anything."""

from __future__ import annotations

import pytest

from certify.checker.plant import read_plant
from certify.checker.rules.costs import prove_cost
from certify.checker.verdict import STEPS, Rejected, start_meter

PLANT = """schema = "consensus-plant/1"
name = "cost"
[network]
agents = 1
edges = []
[initial]
box = 0
[[agent]]
ids = [1]
order = 1
f = "0"
b = 1
cost = "{cost}"
"""


def curvature(cost: str) -> tuple[float, float]:
    start_meter(STEPS)
    found = prove_cost(read_plant(PLANT.format(cost=cost).encode()).agents[0])
    return float(found.least), float(found.largest)


@pytest.mark.parametrize(
    "cost",
    [
        "s^2 + 4*s - s*exp(atan(s) + atan(1/s))",  # c'' has no trace of the jump of c' at 0
        "s^2/4 + 10000*exp(atan(s + 100) + atan(1/(s + 100)))",  # nor of a jump far from every trajectory
        "s^2/4 + 0*log(s)",
        "s^2 + 0/s",
        "s^2 + exp(atan(tan(s)) - s)",
        "s^2 + sqrt(s)*0",
    ],
)
def test_a_cost_that_is_not_smooth_somewhere_is_refused(cost: str) -> None:
    with pytest.raises(Rejected, match="A1"):
        curvature(cost)


@pytest.mark.parametrize(
    ("cost", "least", "largest"),
    [
        ("s^2/4", 0.5, 0.5),
        ("s^2/2 + log(1 + exp(s))", 1.0, 1.25),
        ("(s - 1)^2/4 + sin(s)/10", 0.4, 0.6),
        ("s^2 + sqrt(1 + s^2)", 2.0, 3.0),
    ],
)
def test_smooth_costs_keep_their_bounds(cost: str, least: float, largest: float) -> None:
    low, high = curvature(cost)
    assert 0.9 * least <= low <= least + 1e-12
    assert largest - 1e-12 <= high <= 1.1 * largest
