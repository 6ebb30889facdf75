"""The rule for requirements: simulated loops obey what is proved, what is not proved is rejected, and the claim repeats
the plant file."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

import direct_producer as producer
import numpy as np
import pytest
from direct_producer import Json, Tiny
from tiny_loops import MODELS, Simulation

from certify.checker import check
from certify.checker.rules.requirements import slow_enough
from certify.checker.verdict import Rejected, Undecided, Verdict, start_meter

NOTHING: Json = {"settling": None, "input": None, "bandwidth": None}
BANDS = (Fraction(1, 20),)
SPAN = 3.0  # seconds simulated


@cache
def certified(name: str) -> tuple[Tiny, Json]:
    tiny = MODELS[name][0]()
    return tiny, producer.produce(tiny)


@cache
def simulations(name: str) -> list[Simulation]:
    return [Simulation(name, seed) for seed in range(8)]


def table(asked: Json) -> str:
    settling = asked["settling"]
    lines = [f'{key} = "{asked[key]}"' for key in ("input", "bandwidth") if asked[key] is not None]
    if settling:
        lines.append(f'settling = {{ time = "{settling["time"]}", band = "{settling["band"]}" }}')
    return "\n".join(["[requirements]", *lines])


def judge(name: str, asked: Json, claimed: Json | None = None) -> Verdict:
    """The verdict on the same witness for a plant file that asks for more; the claim repeats it or says otherwise."""
    tiny, certificate = certified(name)
    certificate = copy.deepcopy(certificate)
    toml = f"{tiny.toml.decode()}\n{table({**NOTHING, **asked})}\n".encode()
    certificate["claim"]["plant_sha256"] = hashlib.sha256(toml).hexdigest()
    certificate["claim"]["agents"][0]["requirements"] = {**NOTHING, **asked} if claimed is None else claimed
    return check(toml, producer.encode(certificate))


def least(holds: Callable[[Fraction], bool], low: float, high: float, rounds: int = 7) -> Fraction:
    """Nearly the least number that is proved."""
    assert holds(Fraction(high))
    for _ in range(rounds):
        middle = (low * high) ** 0.5
        low, high = (low, middle) if holds(Fraction(middle)) else (middle, high)
    return Fraction(high)


def within(time: Fraction, band: Fraction) -> Json:
    return {"settling": {"time": str(time), "band": str(band)}}


def inputs(loop: Simulation) -> np.ndarray[Any, Any]:
    found = []
    for t in np.append(np.linspace(0, SPAN, 300), np.geomspace(1e-5, 0.1, 200)):
        _, x, eta, guess, (y,) = np.split(loop.solution(t), loop.cuts)
        found.append(abs(loop.steering(x, guess, y)[1] + loop.psi @ eta))
    return np.array(found)


@pytest.mark.parametrize("name", MODELS)
def test_simulated_inputs_stay_below_every_limit_that_is_proved(name: str) -> None:
    limit = least(lambda q: judge(name, {"input": str(q)}).status == "verified", 2.0, 256.0)
    peak = max(inputs(loop).max() for loop in simulations(name))
    assert float(limit) / 2.6 <= peak <= float(limit)
    refused = judge(name, {"input": str(limit * Fraction(4, 5))})
    assert (refused.status, refused.obligation) == ("rejected", "agent 1: input: |u| ≤ limit")


@pytest.mark.parametrize("band", BANDS)
@pytest.mark.parametrize("name", MODELS)
def test_simulated_outputs_have_settled_when_it_is_proved(name: str, band: Fraction) -> None:
    time = least(lambda q: judge(name, within(q, band)).status == "verified", 0.3, 40.0)
    late = [t for t in np.linspace(0, SPAN, 200) if t >= time]
    for loop in simulations(name):
        assert all(abs(np.split(loop.solution(t), loop.cuts)[1][0]) <= band for t in late)
    if time > 1:
        refused = judge(name, within(time * Fraction(4, 5), band))
        assert refused.status == "rejected"
        assert refused.obligation.startswith("agent 1: settling: |x̄_1| + |y^r − s*| ≤ band")


def test_a_band_that_only_the_tail_reaches_is_proved_from_then_on() -> None:
    band = Fraction(1, 10**6)
    time = least(lambda q: judge("saturated", within(q, band)).status == "verified", 20.0, 400.0)
    assert time > 21  # after the grid
    assert judge("saturated", within(time + 1, band)).status == "verified"
    assert "in the tail" in judge("saturated", within(time - 2, band)).obligation


@pytest.mark.parametrize(
    ("name", "bandwidth", "status"),
    [
        ("second", "512", "verified"),  # h = 256, c = (λ + 1)(λ + 2)
        ("second", "51199/100", "rejected"),
        ("third", "256", "verified"),  # c = (λ + 1)³
        ("third", "25599/100", "rejected"),
        ("saturated", "1/1000", "verified"),  # order 1 has no observer
    ],
)
def test_the_fastest_observer_pole_is_decided_exactly(name: str, bandwidth: str, status: str) -> None:
    assert judge(name, {"bandwidth": bandwidth}).status == status


@pytest.mark.parametrize("seed", range(40))
def test_roots_are_those_that_numpy_finds(seed: int) -> None:
    """Factors of every degree, real and conjugate, also such that have the limit as the size of a root."""
    random = np.random.default_rng(seed)
    roots: list[complex] = []
    for _ in range(random.integers(1, 4)):
        a, b = (int(k) for k in random.integers(1, 6, 2))
        roots += [complex(-a, b), complex(-a, -b)] if random.random() < 0.5 else [complex(-a)]
    c = np.poly(roots).real.round().astype(int).tolist()
    observer = tuple(Fraction(k) for k in reversed(c[1:]))
    square = max(round(abs(root) ** 2) for root in roots)
    start_meter()
    slow_enough("agent 1", observer, Fraction(1), Fraction(np.ceil(np.sqrt(square))))
    with pytest.raises(Rejected):
        slow_enough("agent 1", observer, Fraction(1), Fraction(np.sqrt(square) * 0.999))


def test_an_irreducible_observer_and_one_that_is_too_long() -> None:
    cubic = (Fraction(1), Fraction(1), Fraction(2))  # λ³ + 2λ² + λ + 1, |λ| up to 1.7549
    slow_enough("agent 1", cubic, Fraction(2), Fraction(351, 100))
    with pytest.raises(Rejected):
        slow_enough("agent 1", cubic, Fraction(2), Fraction(350, 100))
    with pytest.raises(Undecided):
        slow_enough("agent 1", (Fraction(1, 3**9000), Fraction(1)), Fraction(1), Fraction(9))


@pytest.mark.parametrize(
    ("asked", "claimed"),
    [
        ({"input": "200"}, NOTHING),
        ({"input": "200"}, {**NOTHING, "input": "201"}),
        ({"input": "200"}, {**NOTHING, "input": "199"}),
        ({}, {**NOTHING, "input": "200"}),
        ({"bandwidth": "600"}, {**NOTHING, "bandwidth": "601"}),
        (within(Fraction(30), Fraction(1)), NOTHING),
        (within(Fraction(30), Fraction(1)), {**NOTHING, **within(Fraction(31), Fraction(1))}),
        (within(Fraction(30), Fraction(1)), {**NOTHING, **within(Fraction(30), Fraction(2))}),
    ],
)
def test_the_claim_repeats_the_plant_file(asked: Json, claimed: Json) -> None:
    assert judge("second", asked).status == "verified"
    verdict = judge("second", asked, claimed)
    assert verdict.status == "rejected"
    assert "is that of the plant file" in verdict.obligation


@pytest.mark.parametrize(
    "claimed",
    [
        None,
        {},
        {**NOTHING, "region": "largest"},
        {"settling": None, "input": None},
        {**NOTHING, "input": 200},
        {**NOTHING, "input": "two"},
        {**NOTHING, "settling": {"time": "1"}},
        {**NOTHING, "settling": {"time": "1", "band": None}},
        {**NOTHING, "settling": ["1", "1"]},
    ],
)
def test_a_claim_of_another_shape_is_malformed(claimed: Any) -> None:
    certificate = copy.deepcopy(certified("second")[1])
    certificate["claim"]["agents"][0]["requirements"] = claimed
    assert check(certified("second")[0].toml, producer.encode(certificate)).status == "malformed"
    del certificate["claim"]["agents"][0]["requirements"]
    assert check(certified("second")[0].toml, producer.encode(certificate)).status == "malformed"


def test_a_wish_for_the_region_is_nothing_to_prove() -> None:
    tiny, certificate = certified("second")
    toml = tiny.toml + b'\n[requirements]\nregion = "largest"\n'
    certificate = copy.deepcopy(certificate)
    certificate["claim"]["plant_sha256"] = hashlib.sha256(toml).hexdigest()
    assert check(toml, producer.encode(certificate)).status == "verified"
