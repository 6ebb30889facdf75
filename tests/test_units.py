"""A verdict does not depend on units (docs/units.md)."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from certify.agent_model import AgentModel
from certify.assumptions.check import check_assumptions
from certify.pipeline import design_gains
from certify.preparation import Prepared, prepare
from certify.results import GainsResult
from certify.tube.ladder import Ladder
from certify.tube.loop import LoopGains
from certify.tube.modes import NoModes, modes
from certify.tube.search_rule import TENTHS, SearchRule
from certify.tube.trial import AgentTrials, TrialFailure
from certify.units.apply import scaled_model
from certify.units.natural import natural_scales
from certify.units.plants import Measure, measured
from certify.units.reduction import scaled_network
from certify.units.scales import Scales
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant
from symbolic.plant_writer import with_source
from tests.tubes import prepared

CASES = Path(__file__).parent / "cases" / "units"
EXAMPLES = Path(__file__).parent.parent / "examples"
SMALL = """
schema = "consensus-plant/1"
name = "lag"
network = { agents = 2, edges = ["1 -> 2", "2 -> 1"] }
initial = { box = [-1, 1], reference = 0, observer = 0, eta = 0 }
[exosystem]
states = ["v1"]
S = [[0]]
initial = { v1 = [0, 1] }
[[agent]]
ids = [1, 2]
zero_dynamics = { z1 = "-2*z1 + x1 + v1" }
order = 1
f = "-p*x1 + z1^2/8 + v1"
b = 1
cost = "(s - id)^2"
uncertain = { p = [1, 2] }
"""
NUMBERS = [Fraction(1000), Fraction(1, 1000), Fraction(1024), Fraction(1, 1024)]


def read(text: str) -> Plant:
    return parse_plant(text.encode(), "plant")


@cache
def direct(text: str) -> GainsResult:
    return design_gains(read(text), "direct")


def in_units(text: str, measure: Measure) -> GainsResult:
    return design_gains(with_source(measured(read(text), measure)), "direct")


def gains(result: GainsResult, plant: Plant, measure: Measure) -> list[tuple[Fraction | None, ...]]:
    """In the units of the plant before it was measured otherwise."""
    assert result.certificate is not None, result.reason
    rows = []
    for claim, agent in zip(result.certificate["claim"]["agents"], plant.agents, strict=True):
        scales = measure.scales(agent)
        units = {"g": scales.rate, "K": scales.K, "delta": scales.input, "h": scales.rate}
        rows.append(tuple(None if claim[key] is None else Fraction(claim[key]) * unit for key, unit in units.items()))
    return rows


def same(text: str, measure: Measure) -> None:
    """Exactly for powers of two, else to within a factor of three: the descent to the default has coarse steps."""
    first, other, plant = direct(text), in_units(text, measure), read(text)
    assert first.status == other.status, other.reason
    powers = all(_is_power_of_two(value) for value in vars(measure).values())
    if first.status == "certified":
        for mine, theirs in zip(gains(first, plant, Measure()), gains(other, plant, measure), strict=True):
            if powers:
                assert mine == theirs
            for a, b in zip(mine, theirs, strict=True):
                assert a is b is None or (a is not None and b is not None and 1 / 3 < a / b < 3)


def same_verdict(text: str, measure: Measure) -> None:
    """The default gains may be up to six times apart (docs/units.md section 4)."""
    first, other = direct(text), in_units(text, measure)
    assert first.status == other.status, (first.reason, other.reason)


def _is_power_of_two(value: Fraction) -> bool:
    return value.numerator & (value.numerator - 1) == 0 == value.denominator & (value.denominator - 1)


@pytest.mark.parametrize(
    "measure",
    [
        Measure(input=Fraction(1024)),
        Measure(zeros=Fraction(1, 1024), disturbance=Fraction(512), input=Fraction(1, 4096)),
        Measure(zeros=Fraction(1000), disturbance=Fraction(1, 1000), input=Fraction(1000)),
    ],
)
def test_agents_are_certified_with_the_same_gains_in_other_units(measure: Measure) -> None:
    assert direct(SMALL).status == "certified"
    same(SMALL, measure)


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("name", ["time", "output", "zeros", "disturbance", "input", "cost", "all"])
def test_the_network_is_certified_with_the_same_gains_in_other_units(name: str, number: Fraction) -> None:
    quantities = vars(Measure()) if name == "all" else (name,)
    same(SMALL, Measure(**dict.fromkeys(quantities, number)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first_order", "pendulums", "rooms", "third_order_actuator", "thermal_springs"])
def test_examples_are_certified_in_any_units(name: str) -> None:
    text = (EXAMPLES / f"{name}.toml").read_text()
    for number in NUMBERS[:2]:
        same_verdict(text, Measure(**dict.fromkeys(vars(Measure()), number)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_random_plants_have_the_same_verdict_in_random_units(seed: int) -> None:
    draw = random.Random(seed)
    order, zeros = draw.choice([1, 1, 2]), draw.choice([0, 1])
    states = [f"x{k}" for k in range(1, order + 1)] + ["z1"] * zeros
    terms = [f"{draw.choice(['p', '-1', '1/2'])}*{x}" for x in states]
    zero_dynamics = f'zero_dynamics = {{ z1 = "-{draw.randint(1, 4)}*z1 + x1" }}\n' * zeros
    text = f"""
schema = "consensus-plant/1"
name = "random-{seed}"
network = {{ agents = 2, edges = ["1 -> 2", "2 -> 1"] }}
initial = {{ box = [-1, 1], reference = 0, observer = 0, eta = 0 }}
[[agent]]
ids = [1, 2]
{zero_dynamics}order = {order}
f = "{" + ".join(terms)} - sin(x1)/2"
b = {draw.randint(1, 5)}
cost = "{draw.randint(1, 5)}*(s - id)^2"
uncertain = {{ p = [-{draw.randint(0, 2)}, {draw.randint(1, 2)}] }}
"""
    same_verdict(text, Measure(**{key: Fraction(10) ** draw.randint(-3, 3) for key in vars(Measure())}))


QUICK_CASES = ["cruise-control-newton", "equal-lags", "input-gain-0.0018"]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(path.stem, marks=[] if path.stem in QUICK_CASES else pytest.mark.slow)
        for path in sorted(CASES.glob("*.toml"))
    ],
)
def test_plants_in_the_units_of_their_papers_are_certified(name: str) -> None:
    result = direct((CASES / f"{name}.toml").read_text())
    assert result.status == "certified", result.reason


def test_scales_undo_what_their_inverse_does() -> None:
    model = prepared("mass_spring").models[0]
    assert isinstance(model, AgentModel)
    scales = Scales(Fraction(1, 4), Fraction(8), (), Fraction(1, 32), model.order)
    back = scaled_model(scaled_model(model, scales), scales.inverse)
    assert replace(back.agent, lyapunov=model.agent.lyapunov) == model.agent
    for name in ("exosystem", "steady_state", "internal_model", "optimum", "references", "disturbance", "extent"):
        assert getattr(back, name) == getattr(model, name), name


@pytest.mark.parametrize("name", ["first_order", "mass_spring", "rooms"])
def test_a_loop_in_other_units_is_the_same_loop(name: str) -> None:
    """The spectrum of the nominal loop is divided by the unit of time, and a tube of the one is one of the other."""
    network = prepared(name)
    model = network.models[0]
    assert isinstance(model, AgentModel)
    order, zeros = model.order, (Fraction(1, 2),) * len(model.agent.zero_states)
    scales = Scales(Fraction(1), Fraction(4), zeros, Fraction(1, 64), order)
    scaled = scaled_network(network, 0, scales)
    there = scaled.models[0]
    assert isinstance(there, AgentModel)
    mine = AgentTrials(model, network.coordinator.envelope, 0)
    theirs = AgentTrials(there, scaled.coordinator.envelope, 0)
    K, h = Fraction(64), None if order == 1 else Fraction(4096)
    one = mine.attempt(LoopGains(Fraction(2), K, h))
    other = theirs.attempt(LoopGains(Fraction(2), K / scales.K, h))
    assert not isinstance(one, TrialFailure) and not isinstance(other, TrialFailure)
    assert other.delta * scales.input == pytest.approx(one.delta, rel=0.2)
    assert np.allclose(np.sort(one.modes.decay), np.sort(other.modes.decay), rtol=1e-9)
    sizes = np.array([float(scale) for scale in scales.outputs])
    assert np.allclose(one.tube.tail, other.tube.tail * sizes, rtol=0.3)


@pytest.mark.parametrize("name", ["first_order", "rooms", "pendulums", "mass_spring"])
def test_natural_units_of_a_plant_in_other_units_are_the_same_units(name: str) -> None:
    network = prepared(name)
    model = network.models[0]
    assert isinstance(model, AgentModel)
    zeros = (Fraction(2**9),) * len(model.agent.zero_states)
    scales = Scales(Fraction(1, 2**7), Fraction(2**5), zeros, Fraction(1, 2**12), model.order)
    scaled = scaled_network(network, 0, scales)
    there = scaled.models[0]
    assert isinstance(there, AgentModel)
    found = natural_scales(there, replace_others(scaled, scales).coordinator.envelope, 0)
    own = natural_scales(model, network.coordinator.envelope, 0)
    assert found.time * scales.time == own.time
    assert found.output * scales.output == own.output
    assert found.input * scales.input == own.input
    assert [a * b for a, b in zip(found.zeros, scales.zeros, strict=True)] == list(own.zeros)


def replace_others(network: Prepared, scales: Scales) -> Prepared:
    """The other agents' parts of the envelope in the same units, since all agents set the time."""
    from certify.units.apply import _agent_envelope

    envelope = network.coordinator.envelope
    agents = (envelope.agents[0], *(_agent_envelope(agent, scales) for agent in envelope.agents[1:]))
    return replace(network, coordinator=replace(network.coordinator, envelope=replace(envelope, agents=agents)))


def test_equal_lags_are_no_instability() -> None:
    plant = read((CASES / "equal-lags.toml").read_text())
    network = prepare(plant, check_assumptions(plant), lambda message: None)
    assert isinstance(network, Prepared)
    model: Any = network.models[0]
    trials = AgentTrials(model, network.coordinator.envelope, 0)
    from certify.tube.loop import nominal_loop

    loop = LoopGains(Fraction(1), Fraction(20), None)
    assert modes(nominal_loop(model, loop, trials.nominal)) is NoModes.DEFECTIVE
    assert not isinstance(trials.attempt(loop), TrialFailure)


def test_a_ladder_is_the_same_in_every_octave() -> None:
    assert list(TENTHS.between(Fraction(80), Fraction(120))) == [80, 90, 96, 110, 120]
    for k in range(-100, 100):
        assert TENTHS.rung(k + 7) == 2 * TENTHS.rung(k) > TENTHS.rung(k)
        assert TENTHS.index(TENTHS.rung(k)) == k == TENTHS.index(TENTHS.rung(k) * Fraction(99, 100))
    assert Ladder((Fraction(1),)).index(Fraction(3)) == 2
    assert all(TENTHS.rung(TENTHS.index(K)) >= K for K in SearchRule().first_K)
