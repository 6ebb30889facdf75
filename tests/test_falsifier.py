"""The falsifier: finds the counterexamples that are there, confirms them, and lets good gains live."""

from __future__ import annotations

import dataclasses
import json
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from closed_loops import at_the_centre, controller_for, with_gains

from sims.bounds import SignalBound
from sims.bounds import margin as bound_margin
from sims.falsifier import falsify
from sims.fate import judge, windows
from sims.search_space import Box
from sims.witness import Witness, read_witness, replay
from symbolic.controller import AgentController, Controller, CoordinatorGains
from symbolic.errors import InputError
from symbolic.plant import Interval, Plant
from symbolic.plant_file import load_plant


@pytest.fixture(scope="module")
def good(five_agents: Plant) -> Controller:
    return controller_for(five_agents, g=5, K=100, h=500, delta=1000)


@pytest.fixture(scope="module")
def weak(good: Controller) -> Controller:
    return with_gains(good, g=3, K=30, h=100)


@pytest.fixture(scope="module")
def escape(five_agents: Plant, weak: Controller) -> Witness:
    """The witness that the search finds for ``(g, K, h) = (3, 30, 100)``."""
    result = falsify(five_agents, weak, budget=128)
    assert result.status == "refuted" and result.witness is not None
    assert result.margin == -math.inf
    assert result.reason.startswith("agent 1 escapes at t = 3.")
    return result.witness


# --- what must be found -----------------------------------------------------------------------------------------------


def test_the_corner_that_random_starts_miss(five_agents: Plant, weak: Controller, escape: Witness) -> None:
    assert escape.point.parameters[:2] == (Fraction(-1, 2), Fraction(3, 2))
    assert abs(escape.point.z[0]) == 1
    again = replay(five_agents, weak, escape)
    assert again.broken and again.fate == "escaped" and 3.0 < again.end < 3.3


def test_weaker_gains_escape_too(five_agents: Plant, good: Controller) -> None:
    result = falsify(five_agents, with_gains(good, g=2, K=10, h=50), budget=128)
    assert result.status == "refuted" and result.witness is not None and result.witness.fate == "escaped"


def test_published_gains_end_in_a_limit_cycle(five_agents: Plant, good: Controller) -> None:
    """``K = 4e4, h = 100, δ = 200`` from the centre of all intervals: an amplitude of about 0.06 that stays."""
    published = with_gains(good, g=1, K=40_000, h=100, delta=200)
    result = falsify(at_the_centre(five_agents), published, budget=1, horizon=16, agents=[1])
    assert result.status == "refuted" and result.witness is not None
    assert result.witness.fate == "oscillates"
    assert "ends in an oscillation" in result.reason
    assert -800 < result.margin < -400
    size = [float(text) for text in dict(result.witness.seen)["amplitudes"].split()]
    assert 0.04 < size[-1] < 0.08 and size[-1] > 0.9 * size[-2]


def f1_controller(plant: Plant, g: int, K: int, h: int, delta: int) -> Controller:
    gains = {"g": Fraction(g), "K": Fraction(K), "delta": Fraction(delta), "h": Fraction(h)}
    polynomials: dict[str, Any] = {"gamma": (Fraction(1),), "observer": (Fraction(1), Fraction(2))}
    laws = [AgentController(agent.id, M=(), N=(), psi=(), **polynomials, **gains) for agent in plant.agents]
    return Controller(CoordinatorGains(Fraction(3), Fraction(2)), tuple(laws))


@pytest.mark.parametrize("gains", [(5, 100, 500, 1000), (1000, 10**7, 10**8, 10**9)])
def test_finite_escape_that_no_gain_prevents(examples: Path, gains: tuple[int, int, int, int]) -> None:
    """Theory.md section 7, F1: A1 … A6 hold and the state escapes all the same."""
    plant = load_plant(examples / "f1_counterexample.toml")
    law = f1_controller(plant, *gains)
    result = falsify(plant, law, budget=4)
    assert result.status == "refuted" and result.witness is not None and result.witness.fate == "escaped"
    assert 0.2 < replay(plant, law, result.witness).end < 0.35


def test_f1_function_decays_along_the_zero_dynamics(examples: Path) -> None:
    """``V0 = z1² e^{2Ψ} + z2²`` has ``V̇0 ≤ −2V0`` for ``x1 = 0``, so A6 does hold for the example file."""
    agent = load_plant(examples / "f1_counterexample.toml").agents[0]
    z1, z2 = agent.zero_states
    beta = sympy.Dummy("beta", real=True)
    slope = 1 / (3 - 2 * beta + 4 * beta**2)
    f1, f2 = (row.subs(agent.chain[0], 0) for row in agent.zero_dynamics)
    rate = f1 * z2 * 2 * z1 + f2 * z1**2  # of z1² z2
    product = z1**2 * z2
    # V0' / 2 = z1² e^{2Ψ} (f1/z1 + Ψ' rate) + z2 f2; the first bracket is −1, the second term is at most −z2²
    bracket = sympy.cancel(f1 / z1 + slope.subs(beta, product) * rate)
    assert sympy.simplify(bracket + 1) == 0
    assert sympy.expand(z2 * f2 + z2**2 + 4 * z1**4 * z2**4) == 0


def test_a_small_f1_start_survives(examples: Path) -> None:
    plant = load_plant(examples / "f1_counterexample.toml")

    def fifth(side: Interval) -> Interval:
        return Interval(side.lo / 5, side.hi / 5)

    agents = []
    for agent in plant.agents:
        initial = agent.initial
        z, x = tuple(map(fifth, initial.z)), tuple(map(fifth, initial.x))
        smaller = dataclasses.replace(initial, z=z, x=x, reference=fifth(initial.reference))
        agents.append(dataclasses.replace(agent, initial=smaller))
    result = falsify(
        dataclasses.replace(plant, agents=tuple(agents)), f1_controller(plant, 5, 100, 500, 1000), budget=2
    )
    assert result.status == "survived" and result.margin > 0.99


# --- what must not be found -------------------------------------------------------------------------------------------


def test_good_gains_survive_and_the_search_repeats(five_agents: Plant, good: Controller) -> None:
    said: list[str] = []
    result = falsify(five_agents, good, budget=60, agents=[1, 3], seed=1, horizon=25, progress=said.append)
    assert result.status == "survived" and result.witness is None
    assert 0.9 < result.margin < 1
    assert [tried.agent for tried in result.tried] == [1, 3]
    assert all(tried.trajectories >= 40 and tried.failed == tried.slow == 0 for tried in result.tried)
    assert any("evolution" in line for line in said) and any("corners" in line for line in said)
    assert falsify(five_agents, good, budget=60, agents=[1, 3], seed=1, horizon=25) == result


def test_slow_convergence_is_no_counterexample(five_agents: Plant, good: Controller) -> None:
    """After 3 s the errors are far above the tolerance, and falling."""
    result = falsify(at_the_centre(five_agents), good, budget=1, agents=[1], horizon=3)
    assert result.status == "survived"
    assert result.margin == 0.0 and result.tried[0].slow == 1
    assert "1 were still converging" in result.reason


def test_gains_beyond_floats_are_inconclusive(five_agents: Plant, good: Controller) -> None:
    result = falsify(five_agents, with_gains(good, K=10**20, h=10**26, delta=10**20), budget=8, agents=[1])
    assert result.status == "inconclusive" and math.isnan(result.margin)
    assert result.reason.endswith("cannot be integrated in floats (the observer gain is 1e26)")


def test_an_unstable_coordinator_is_inconclusive(five_agents: Plant, good: Controller) -> None:
    unstable = dataclasses.replace(good, coordinator=CoordinatorGains(Fraction(1), Fraction(200)))
    result = falsify(five_agents, unstable, budget=1)
    assert result.status == "inconclusive" and result.reason.startswith("the coordinator escaped")


@pytest.mark.parametrize("options", [{"budget": 0}, {"seed": -1}, {"horizon": 0.0}, {"tolerance": Fraction(0)}])
def test_bad_options_are_refused(five_agents: Plant, good: Controller, options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="the search needs budget >= 1, seed >= 0"):
        falsify(five_agents, good, **options)


# --- bounds -----------------------------------------------------------------------------------------------------------


def test_a_bound_that_is_too_tight_is_broken(five_agents: Plant, good: Controller) -> None:
    plant = at_the_centre(five_agents)
    wide = SignalBound(1, "z1", (Fraction(0),), (Fraction(100),))
    kept = falsify(plant, good, budget=1, agents=[1], horizon=25, bounds=[wide])
    assert kept.status == "survived" and 0.5 < kept.margin < 1
    peak = 100 * (1 - kept.margin)
    tight = SignalBound(1, "z1", (Fraction(0), Fraction(30)), (Fraction(peak) * Fraction(9, 10), Fraction(1)))
    broken = falsify(plant, good, budget=1, agents=[1], horizon=25, bounds=[tight])
    assert broken.status == "refuted" and broken.witness is not None and broken.witness.fate == "bound"
    assert broken.margin == pytest.approx(1 - 10 / 9, abs=1e-2)
    assert read_witness(broken.witness.text()) == broken.witness


def test_bounds_are_steps_in_time(five_agents: Plant) -> None:
    bound = SignalBound(3, "error", (Fraction(0), Fraction(1)), (Fraction(2), Fraction(1, 2)))
    assert bound.at(np.array([0.0, 0.99, 1.0, 9.0])).tolist() == [2.0, 2.0, 0.5, 0.5]
    states = np.array([[[3.0, 2.4, np.nan]], [[2.0, 2.0, 2.0]]])  # y of two runs, s* = 2
    found = bound_margin([bound], five_agents.agents[2], states, np.array([0.0, 1.0, 2.0]), 2.0)
    assert found == pytest.approx([0.2, 1.0])
    with pytest.raises(InputError, match="agent 3 has no signal z1 to bound"):
        bound_margin([dataclasses.replace(bound, signal="z1")], five_agents.agents[2], states, np.zeros(3), 2.0)
    with pytest.raises(InputError, match="a bound must be positive"):
        SignalBound(1, "x1", (Fraction(0),), (Fraction(0),))
    with pytest.raises(InputError, match="times from 0 on that increase"):
        SignalBound(1, "x1", (Fraction(1),), (Fraction(1),))


# --- fates ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("signal", "fate"),
    [
        (lambda t: np.exp(-t), "converged"),
        (lambda t: np.exp(-0.05 * t) * np.cos(3 * t), "slow"),
        (lambda t: 0.05 * np.cos(63 * t) + np.exp(-t), "oscillates"),
        (lambda t: 0.05 * np.cos(0.8 * t), "oscillates"),
        (lambda t: 0.01 + np.exp(-t), "offset"),
        (lambda t: 1e-3 * np.exp(0.1 * t), "grows"),
        (lambda t: t * np.nan, "failed"),
    ],
)
def test_fates_of_known_signals(five_agents: Plant, signal: Any, fate: str) -> None:
    frame = windows(five_agents, 40.0)
    assert judge(signal(frame.times), frame, 1e-4) == fate


# --- the cube and the witness file ------------------------------------------------------------------------------------


def test_points_of_the_cube_are_exact() -> None:
    box = Box((Interval(Fraction(1, 3), Fraction(2, 3)), Interval(Fraction(7), Fraction(7))))
    generator = np.random.default_rng(0)
    assert [box.point(corner) for corner in box.corners(4, generator)] == [(Fraction(1, 3), 7), (Fraction(2, 3), 7)]
    assert box.contains(box.point((0.123456789,))) and not box.contains((Fraction(1), Fraction(7)))
    many = Box((Interval(Fraction(-1), Fraction(1)),) * 20).corners(10, generator)
    assert len(set(many)) == 10 and (0.0,) * 20 in many and (1.0,) * 20 in many


def test_witness_file_is_what_was_found(escape: Witness) -> None:
    assert read_witness(escape.text()) == escape
    assert json.loads(escape.text())["start"]["parameters"][:2] == ["-1/2", "3/2"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "consensus-witness/2"}, "only consensus-witness/1 is known"),
        ({"extra": "1"}, "extra missing or unknown"),
        ({"horizon": "1e999999"}, "a number is a string p or p/q"),
        ({"horizon": 40}, "a number is a string p or p/q"),
        ({"start": {}}, "not of the documented shape"),
        ({"gains": []}, "not of the documented shape"),
    ],
)
def test_other_files_are_no_witness(escape: Witness, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_witness(json.dumps(escape.to_json() | change))
    with pytest.raises(InputError, match="not of the documented shape"):
        read_witness("{")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"plant_sha256": "0"}, "another plant file"),
        ({"agent": "2"}, "outside the set"),
        ({"agent": "9"}, "agent 9, which the plant does not have"),
        ({"fate": "bored"}, "unknown fate"),
        ({"gains": {}}, "other gains"),
    ],
)
def test_a_witness_is_replayed_for_its_claim_only(
    five_agents: Plant, weak: Controller, escape: Witness, change: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        replay(five_agents, weak, read_witness(json.dumps(escape.to_json() | change)))


def test_a_witness_that_does_not_hold_is_told(five_agents: Plant, weak: Controller, escape: Witness) -> None:
    centre = (Fraction(-1), Fraction(1), Fraction(1))
    harmless = dataclasses.replace(escape, point=dataclasses.replace(escape.point, parameters=centre))
    again = replay(five_agents, weak, harmless)
    assert not again.broken and again.fate == "converged"
