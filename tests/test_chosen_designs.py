"""The design that a certificate chooses, shown as lines that fix it in the plant file."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reports.designs import chosen_designs, designed_plant
from symbolic.design import characteristic_polynomial, companion_pair, damped_polynomial, is_controllable
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant
from tests.tubes import EXAMPLES

PLANT = EXAMPLES / "third_order_actuator.toml"
DEFAULT = {
    "gamma": ["1", "2"],
    "observer": ["1", "3", "3"],
    "M": [["0", "1", "0"], ["0", "0", "1"], ["-6", "-11", "-6"]],
    "N": ["0", "0", "1"],
}
CHOSEN = {
    "gamma": ["1", "3/2"],
    "observer": ["1", "5/2", "5/2"],
    "M": [["0", "1", "0"], ["0", "0", "1"], ["-3/4", "-11/4", "-3"]],
    "N": ["0", "0", "1"],
}


@pytest.fixture(scope="module")
def plant() -> Plant:
    return parse_plant(PLANT.read_bytes(), PLANT.name)


def test_lines_of_a_chosen_design_fix_it_in_the_plant_file(plant: Plant) -> None:
    claim = {"agents": [CHOSEN] * len(plant.agents)}
    lines = chosen_designs(plant, claim)
    assert lines == [
        'agents 1, 2: observer = [1, "5/2", "5/2"]',
        'agents 1, 2: gamma = [1, "3/2"]',
        'agents 1, 2: internal_model = { M = [[0, 1, 0], [0, 0, 1], ["-3/4", "-11/4", -3]], N = [0, 0, 1] }',
    ]
    fixed = "".join(line.partition(": ")[2] + "\n" for line in lines)
    text = PLANT.read_text().replace("order     = 3", f"order = 3\n{fixed}")
    again = parse_plant(text.encode(), PLANT.name)
    designed = designed_plant(plant, claim)
    for theirs, ours in zip(again.agents, designed.agents, strict=True):
        assert (theirs.gamma, theirs.observer, theirs.internal_model) == (
            ours.gamma,
            ours.observer,
            ours.internal_model,
        )
    assert chosen_designs(again, claim) == []


def test_the_default_design_needs_no_lines(plant: Plant) -> None:
    assert chosen_designs(plant, {"agents": [DEFAULT, DEFAULT]}) == []
    assert chosen_designs(plant, {"agents": [DEFAULT, CHOSEN]})[0].startswith("agent 2: ")


@given(st.integers(1, 6), st.fractions(Fraction(1, 10), 10, max_denominator=10))
def test_companion_pairs_have_the_poles_and_are_controllable(order: int, pole: Fraction) -> None:
    pair = companion_pair(order, pole)
    roots = np.sort(np.roots([float(c) for c in characteristic_polynomial(pair.M)]))
    assert roots == pytest.approx([-float(pole) * k for k in range(order, 0, -1)], rel=1e-4)
    assert is_controllable(pair.M, pair.N)


@given(st.integers(1, 6), st.fractions(Fraction(1, 10), 1, max_denominator=20))
def test_damped_polynomials_have_roots_of_modulus_one_and_that_damping(degree: int, damping: Fraction) -> None:
    coefficients = [1.0, *map(float, reversed(damped_polynomial(degree, damping)))]
    assert len(coefficients) == degree + 1
    if degree <= 3 and damping < Fraction(9, 10):
        roots = np.roots(coefficients)
        assert np.abs(roots) == pytest.approx(np.ones(degree))
        oscillating = roots[np.abs(roots.imag) > 1e-9]
        assert -oscillating.real == pytest.approx(np.full(2 * (degree // 2), float(damping)))
    unit = np.polyval(coefficients, 1.0)  # each quadratic factor is 2 + 2 damping at 1, each linear one 2
    assert unit == pytest.approx((2 + 2 * float(damping)) ** (degree // 2) * 2 ** (degree % 2))
