"""Margins of an open loop against closed forms, and of the frozen loops against the closed loop's own stability."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import sympy

from sims.loop_response import loop_response, margins
from symbolic.controller import AgentController
from symbolic.derivation import derive
from symbolic.plant_file import parse_plant
from symbolic.steady_state import SteadyState

OMEGA = np.geomspace(1e-3, 1e3, 4000)
PLANT = """
schema = "consensus-plant/1"
name = "integrators"
network = { agents = 1, edges = [] }
initial = { box = [-1, 1], reference = 0, observer = 0, eta = 0 }
[[agent]]
ids = [1]
order = 2
f = "p*x1"
b = 1
cost = "s^2/2"
uncertain = { p = [-1, 1] }
"""


@pytest.mark.parametrize("gain", [0.5, 1.0, 3.0])
def test_gain_margin_of_a_third_order_loop(gain: float) -> None:
    """``k/(s(s + 1)(s + 2))`` is stable up to ``k = 6``."""
    s = 1j * OMEGA
    found = margins(OMEGA, gain / (s * (s + 1) * (s + 2)))
    assert found.gain == pytest.approx(6 / gain, rel=1e-3)
    assert found.reduction == np.inf


def test_phase_and_delay_margin_of_an_integrator() -> None:
    """``2/s``: 90° at 2 rad/s, so a delay of ``π/4`` seconds."""
    found = margins(OMEGA, 2 / (1j * OMEGA))
    assert found.phase == pytest.approx(90, rel=1e-3)
    assert found.delay == pytest.approx(np.pi / 4, rel=1e-3)
    assert found.gain == np.inf
    assert found.distance == pytest.approx(1.0, rel=1e-3)


def test_a_loop_that_needs_gain_may_not_lose_it() -> None:
    """``2/(s − 1)``: its gain may fall to a half."""
    found = margins(OMEGA, 2 / (1j * OMEGA - 1))
    assert found.reduction == pytest.approx(2.0, rel=1e-2)
    assert found.phase == pytest.approx(60, rel=1e-3)


def law(K: int) -> AgentController:
    one = Fraction(1)
    return AgentController(
        1, (one,), (Fraction(2), Fraction(3)), (), (), (), one, Fraction(K), Fraction(99), Fraction(60)
    )


def test_the_gain_margin_is_where_the_closed_loop_becomes_unstable() -> None:
    plant = parse_plant(PLANT.encode(), "p.toml")
    agent, steady = plant.agents[0], derive(plant, sympy.S.Zero).agents[0].steady_state
    assert isinstance(steady, SteadyState)
    found = loop_response(agent, law(6), steady, 0.0)
    assert found is not None
    assert len(found.values) == 2  # corners of W
    for factor, stable in ((0.97, True), (1.03, False)):
        K = Fraction(6 * found.margins.gain * factor)
        again = loop_response(agent, replace(law(6), K=K), steady, 0.0)
        assert (again is not None) == stable
