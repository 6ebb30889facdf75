"""Simulation of the closed loop: what is conserved, convergence, escape and failure as results."""

from __future__ import annotations

import dataclasses
import warnings
from fractions import Fraction

import numpy as np
import pytest
from closed_loops import controller_for, corner, with_gains

from sims import Trajectory, nominal, random_scenario, simulate
from sims.coordinator import estimated_optimum
from symbolic.controller import AgentController, Controller, CoordinatorGains
from symbolic.errors import InputError
from symbolic.network import laplacian
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant

R = np.array([2.0, 4.0, 3.0, 1.0, 1.0]) / 11  # left null vector of the example's Laplacian


def with_alpha(controller: Controller, alpha1: int, alpha2: int) -> Controller:
    return dataclasses.replace(controller, coordinator=CoordinatorGains(Fraction(alpha1), Fraction(alpha2)))


def without_internal_model(controller: Controller) -> Controller:
    laws = tuple(dataclasses.replace(law, M=(), N=(), psi=()) for law in controller.agents)
    return dataclasses.replace(controller, agents=laws)


@pytest.fixture(scope="module")
def controller(five_agents: Plant) -> Controller:
    return controller_for(five_agents, g=5, K=100, h=500, delta=1000)


@pytest.fixture(scope="module")
def run(five_agents: Plant, controller: Controller) -> Trajectory:
    """A start that saturates every agent's input at first."""
    scenario = random_scenario(five_agents, controller, 2)
    return simulate(five_agents, controller, horizon=40, scenario=scenario)


# --- the coordinator --------------------------------------------------------------------------------------------------


def test_coordinator_conserves_and_mixes(run: Trajectory) -> None:
    """``rᵀζ = 0`` is conserved, ``ξ_i^i → r_i``, ``y^r → s*``, and the exosystem stays on its circle."""
    assert np.abs(R @ run.zeta).max() < 1e-9
    assert run.mixing[:, 0] == pytest.approx(np.ones(5))
    assert run.mixing[:, -1] == pytest.approx(R, abs=1e-10)
    assert run.mixing[0].min() == pytest.approx(0.1667, abs=1e-4)  # below r_1 = 2/11 for a while
    assert run.reference[:, -1] == pytest.approx(np.full(5, 2.0), abs=1e-8)
    assert np.abs((run.v**2).sum(axis=0) - 1).max() < 1e-8


def test_mixing_is_the_matrix_exponential(five_agents: Plant, run: Trajectory) -> None:
    from scipy.linalg import expm

    L = np.array(laplacian(five_agents.digraph), dtype=float)
    for k in (1, 10, 25, 100, 400):
        assert run.mixing[:, k] == pytest.approx(np.diagonal(expm(-L * run.t[k])), abs=1e-10)


@pytest.mark.parametrize("alpha2", [1, 5])
def test_another_zeta_settles_elsewhere(five_agents: Plant, controller: Controller, alpha2: int) -> None:
    """``Σ c_i'(s) = −α2 rᵀζ(0)``: from ``ζ(0) = ½·1`` the outputs settle at ``2 − α2/5``: 1.8 for ``α2 = 1``."""
    law = with_alpha(controller, 5, alpha2)
    scenario = nominal(five_agents, law).with_zeta([0.5] * 5)
    run = simulate(five_agents, law, horizon=60, scenario=scenario, samples=2)
    assert run.y[:, -1] == pytest.approx(np.full(5, 2 - alpha2 / 5), abs=1e-4)


def test_a_coordinator_that_never_settles_ends_with_a_reason(
    five_agents: Plant, controller: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sims.coordinator.MAX_STEPS", 200)
    run = simulate(five_agents, with_alpha(controller, 1000, 5), horizon=41)
    assert run.status == "failed" and 0 < run.end < 1
    assert run.reason.startswith("the coordinator does not settle: 200 steps reach only t = 0.")
    assert run.reason.endswith(" s of 41 s") and "\n" not in run.reason


def test_unstable_coordinator_escapes(five_agents: Plant, controller: Controller) -> None:
    """For ``α1 = 1`` the example's coordinator is unstable beyond ``α2 = 73``."""
    run = simulate(five_agents, with_alpha(controller, 1, 200), horizon=40)
    assert run.status == "escaped"
    assert run.end < 40


# --- what a run shows -------------------------------------------------------------------------------------------------


def test_outputs_reach_the_optimum(run: Trajectory) -> None:
    assert run.status == "completed" and run.end == 40
    assert run.optimum == pytest.approx(2.0, abs=1e-12)
    assert run.final_error(window=1.0) < 1e-7
    assert np.abs(run.u).max() > 500
    assert (run.saturated_fraction > 0).all() and (run.saturated_fraction < 0.01).all()
    assert all(agent.last_saturated < 0.5 for agent in run.agents)


def test_start_is_the_scenario(run: Trajectory) -> None:
    for agent, start in zip(run.agents, run.scenario.agents, strict=True):
        assert tuple(agent.z[:, 0]) == start.z
        assert tuple(agent.x[:, 0]) == start.x
        assert agent.observer[:, 0] == pytest.approx(start.observer, abs=1e-12)
        assert tuple(agent.eta[:, 0]) == start.eta
        assert all(abs(value) <= 1 for value in start.x + start.z)


def test_tolerances_resolve_the_kink(five_agents: Plant, controller: Controller, run: Trajectory) -> None:
    """All inputs saturate at first; a hundredfold tolerance moves no output by more than a few tolerances."""
    tight = simulate(five_agents, controller, horizon=40, scenario=run.scenario, rtol=1e-10, atol=1e-12)
    assert np.abs(run.y - tight.y).max() < 2e-7
    assert all(
        a.last_saturated == pytest.approx(b.last_saturated, abs=1e-3)
        for a, b in zip(run.agents, tight.agents, strict=True)
    )


def test_internal_model_matters(five_agents: Plant, controller: Controller) -> None:
    run = simulate(five_agents, without_internal_model(controller), horizon=30)
    assert run.status == "completed"
    assert (run.error[:, run.t > 20].max(axis=1) > 5e-3).all()  # every output keeps oscillating


def test_published_gains_end_in_a_limit_cycle(five_agents: Plant, controller: Controller) -> None:
    """``K = 4e4, h = 100`` is linearly unstable: the feedback stays at its bound and ``|y − 2|`` does not vanish."""
    law = with_gains(controller, K=40_000, h=100, delta=200)
    run = simulate(five_agents, law, horizon=12, samples=np.linspace(8, 12, 2001))
    assert run.status == "completed"
    first, second = np.split(run.error[:, :2000], 2, axis=1)
    swing = np.ptp(run.y[:, run.t > 10], axis=1)
    assert (swing > 1e-3).all()
    assert (second.max(axis=1) > 0.3 * first.max(axis=1)).all()
    assert (run.saturated_fraction > 0.9).all()


def test_finite_escape_is_a_result(five_agents: Plant, controller: Controller) -> None:
    """``(g, K, h) = (3, 30, 100)`` at the corner escapes; ``(2, 40, 150)`` survives the same corner."""
    weak = with_gains(controller, g=3, K=30, h=100)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = simulate(five_agents, weak, horizon=40, scenario=corner(five_agents, weak))
    assert run.status == "escaped"
    assert run.reason.startswith("agent 1: a plant state exceeds 1e+09 at t = 3.09")
    assert 3.0 < run.end < 3.2
    assert run.final_error() == float("inf")
    assert [agent.status for agent in run.agents] == ["escaped"] * 2 + ["completed"] * 3
    assert np.isnan(run.y[0, run.t > run.end]).all() and np.isfinite(run.y[0, run.t < run.end]).all()
    strong = with_gains(controller, g=2, K=40, h=150)
    assert simulate(five_agents, strong, horizon=20, scenario=corner(five_agents, strong)).final_error() < 1e-3


def test_gains_beyond_the_integrator_are_a_failure_with_a_reason(five_agents: Plant, controller: Controller) -> None:
    recipe = with_gains(controller, K=10**12, h=10**41, delta=10**20)
    run = simulate(five_agents, recipe, horizon=1)
    assert run.status == "failed"
    assert run.reason.startswith("agent 1: the integrator stops at t = 0 s: lsoda:")


def test_large_gains_are_integrated(five_agents: Plant, controller: Controller) -> None:
    """``h^3 = 2e16``: in the observer's own coordinates rounding noise would stall the step control."""
    law = with_alpha(with_gains(controller, g=3, K=1000, h=260_000, delta=4800), 3, 2)
    run = simulate(five_agents, law, horizon=40, scenario=random_scenario(five_agents, law, 1))
    assert run.final_error() < 1e-6
    assert max(agent.steps for agent in run.agents) < 20_000


# --- other plants -----------------------------------------------------------------------------------------------------

FIRST_ORDER = b"""
schema = "consensus-plant/1"
name = "first-order"
[network]
agents = 2
edges = ["1 -> 2", "2 -> 1"]
[initial]
box = [-1, 1]
[[agent]]
ids = [1, 2]
order = 1
f = "p*x1 - x1^3"
b = "1"
cost = "(s - id)^2 + exp(s - id)"
uncertain = { p = [0, 1] }
"""


def proportional(plant: Plant, K: int | Fraction, delta: int) -> Controller:
    """``u = −sat_δ(K (y − y^r))`` for agents of order 1."""
    gains = {"g": Fraction(1), "K": Fraction(K), "delta": Fraction(delta), "h": None}
    laws = [AgentController(agent.id, gamma=(), observer=(), M=(), N=(), psi=(), **gains) for agent in plant.agents]
    return Controller(CoordinatorGains(Fraction(2), Fraction(2)), tuple(laws))


def test_first_order_without_disturbance_or_observer() -> None:
    """Non-quadratic costs; proportional control leaves an offset that shrinks like 1/K, and there is no observer."""
    plant = parse_plant(FIRST_ORDER, "test")
    optimum = estimated_optimum(plant)
    slope = sum(2 * (optimum - i) + np.exp(optimum - i) for i in (1, 2))
    assert abs(slope) < 1e-12
    law = proportional(plant, K=1000, delta=10_000)
    run = simulate(plant, law, horizon=60, scenario=random_scenario(plant, law, 0))
    assert run.agents[0].observer.shape == (0, 1001) and run.v.shape == (0, 1001)
    assert run.reference[:, -1] == pytest.approx(np.full(2, optimum), abs=1e-7)
    assert 1e-7 < run.final_error() < 1e-2


def test_leaving_the_domain_is_a_failure_with_a_reason() -> None:
    plant = parse_plant(FIRST_ORDER.replace(b"p*x1 - x1^3", b"p*log(1 + x1) - 5"), "test")
    run = simulate(plant, proportional(plant, K=Fraction(1, 100), delta=1), horizon=10)
    assert run.status == "failed"
    assert "the right-hand side cannot be evaluated beyond t = " in run.reason


def test_costs_without_a_minimum_are_refused() -> None:
    plant = parse_plant(FIRST_ORDER.replace(b"(s - id)^2 + exp(s - id)", b"exp(s)"), "test")
    with pytest.raises(InputError, match=r"cannot be evaluated|no minimum"):
        estimated_optimum(plant)
