"""The optimum of a certificate is a point only where the independent checker sees that it is one."""

from __future__ import annotations

from fractions import Fraction

import pytest

from certify.foreseen import foreseen_refusal, seen_optimum
from certify.optimum import optimum
from certify.pipeline import design_gains
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant

PLANT = """schema = "consensus-plant/1"
name = "two agents"
network = {{ agents = 2, edges = ["1 -> 2", "2 -> 1"] }}
initial = {{ box = [-1, 1], reference = 0, observer = 0, eta = 0 }}
[[agent]]
ids = [1, 2]
order = 1
f = "p*x1"
b = 1
cost = "{cost}"
uncertain = {{ p = [-1, 1] }}
"""


def plant_of(cost: str) -> Plant:
    return parse_plant(PLANT.format(cost=cost).encode(), "two agents")


@pytest.mark.parametrize(("cost", "exact"), [("(s - id)^2", Fraction(3, 2)), ("s^2 + s*tanh(s)", Fraction(0))])
def test_a_point_that_the_checker_sees_stays_a_point(cost: str, exact: Fraction) -> None:
    plant = plant_of(cost)
    found = seen_optimum(plant, optimum(plant))
    assert not foreseen_refusal(plant)
    assert found.exact == found.enclosure.lo == found.enclosure.hi == exact


def test_a_point_that_the_checker_only_encloses_becomes_an_interval() -> None:
    plant = plant_of("(s - id)^2/2 + log(1 + (s - id)^2)/8")
    known = optimum(plant)
    found = seen_optimum(plant, known)
    assert known.exact == Fraction(3, 2) and found.exact is None
    assert found.enclosure.lo < Fraction(3, 2) < found.enclosure.hi < found.enclosure.lo + Fraction(1, 10**12)


@pytest.mark.parametrize("route", ["recipe", "direct"])
@pytest.mark.parametrize("cost", ["(s - id)^2/2 + log(1 + (s - id)^2)/8", "s^2/2 + log(cosh(s - id))"])
def test_costs_that_are_enclosed_as_written_or_simplified_end_in_a_certificate(cost: str, route: str) -> None:
    result = design_gains(plant_of(cost), route)
    assert result.status == "certified", result.reason
