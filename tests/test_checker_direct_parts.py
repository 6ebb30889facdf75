"""The parts of the rule for direct/1 against what they enclose: kernels, loops, increments and surroundings."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import direct_producer as producer
import numpy as np
import pytest
from scipy.linalg import expm

from certify.checker.certificate import read_certificate
from certify.checker.expressions import Name, parse
from certify.checker.intervals import between, enclose
from certify.checker.plant import read_plant
from certify.checker.rules import increments, kernels, loop
from certify.checker.rules.mixing import UNIT
from certify.checker.rules.reference import Reference, Step
from certify.checker.rules.surroundings import Exosystem, Outside, Surroundings
from certify.checker.verdict import Rejected, Undecided, start_meter


@pytest.fixture(autouse=True)
def _fresh_meter() -> None:
    start_meter()


def exactly(A: Any) -> list[list[Fraction]]:
    return [[Fraction(float(entry)) for entry in row] for row in np.array(A, dtype=float)]


def prove(A: Any, H: Any, blocks: list[int], rates: list[Fraction], c: Any, outputs: Any = None, inputs: Any = None
          ) -> None:
    size = len(A)
    outputs = np.eye(size) if outputs is None else outputs
    inputs = np.zeros((size, 0)) if inputs is None else inputs
    plain = loop.Loop(0, 1, 0, exactly(A), [list(map(Fraction, row)) for row in inputs], exactly(outputs))
    table = [[[Fraction(entry) for entry in entries] for entries in row] for row in c]
    witness: Any = SimpleNamespace(modes=exactly(H), blocks=blocks, rates=rates, kernels=table)
    kernels.prove("agent 1", plain, witness)


@pytest.mark.parametrize(("c", "proved"), [("21/20", True), ("51/50", True), ("1", False), ("0", False)])
def test_an_exponential_needs_its_coefficient(c: str, proved: bool) -> None:
    def attempt() -> None:
        prove([[-1]], [[3]], [1], [Fraction(9, 10)], [[[c]]])
    if proved:
        attempt()
    else:
        with pytest.raises(Rejected, match=r"kernels: \|\(C e\^\(At\) J\)_ij\|.*i = 1, j = 1, from_t = 0"):
            attempt()


ROTATION = [[-1.0, 5.0], [-5.0, -1.0]]


def test_a_damped_rotation_is_one_block_of_two() -> None:
    c = [[["11/10"]] * 2] * 2
    prove(ROTATION, np.eye(2), [2], [Fraction(9, 10)], c)
    with pytest.raises(Rejected, match="μ_1 < σ − ε"):
        prove(ROTATION, np.eye(2), [1, 1], [Fraction(9, 10)], c)
    with pytest.raises(Rejected, match="kernels"):
        prove(ROTATION, np.eye(2), [2], [Fraction(9, 10)], [[["11/10"], ["9/10"]], [["11/10"]] * 2])


def test_a_defective_matrix_is_near_no_diagonal_one() -> None:
    with pytest.raises(Rejected, match="μ_1 < σ − ε"):
        prove([[-1, 1], [0, -1]], np.eye(2), [1, 1], [Fraction(1, 2)], [[["9"]] * 2] * 2)


def test_an_unstable_mode_is_rejected_however_it_is_seen() -> None:
    with pytest.raises(Rejected, match="μ_1 < σ − ε"):
        prove([[-1, 0], [0, 1]], np.eye(2), [1, 1], [Fraction(1, 2)], [[["9"]] * 2], outputs=[[1, 0]])


def test_a_slow_tail_needs_the_slowest_rate() -> None:
    """``e^(−t) ≤ 10 e^(−2t)`` holds for a while only; the first rate must be below the decay."""
    with pytest.raises(Rejected, match="μ_1 < σ − ε"):
        prove([[-1]], [[1]], [1], [Fraction(2)], [[["10"]]])
    A, c = np.diag([-1.0, -50.0]), [[["0", "2"], ["0", "2"]], [["0", "2"], ["0", "2"]]]
    with pytest.raises(Rejected, match="i = 1, j = 1, from_t ="):
        prove(A, np.eye(2), [1, 1], [Fraction(9, 10), Fraction(40)], c)


@pytest.mark.parametrize("seed", range(4))
def test_majorants_of_random_loops(seed: int) -> None:
    """What is proved is above every sample; what is below a sample is not proved."""
    random = np.random.default_rng(seed)
    A = random.normal(size=(4, 4))
    A -= (max(np.linalg.eigvals(A).real) + random.uniform(0.3, 3)) * np.eye(4)
    H, blocks, values = producer.modes(A)
    slowest = min(-values.real)
    rates = np.array([0.8 * slowest, 2 * slowest, 6 * slowest])
    outputs, inputs = random.normal(size=(2, 4)), random.normal(size=(4, 1))
    columns = np.hstack([inputs, np.eye(4)])
    c = producer.majorants(A, outputs, columns, rates, max(abs(values)), slowest)
    short = [Fraction(float(mu)) for mu in rates]
    arguments = (A, H, [int(block) for block in blocks], short)
    prove(*arguments, c.tolist(), outputs, inputs.tolist())
    times = np.linspace(0, 20 / slowest, 150)
    samples = np.array([np.abs(outputs @ expm(A * t) @ columns) for t in times])
    bounds = np.einsum("ija,ta->tij", c, np.exp(-np.outer(times, rates)))
    assert (samples <= bounds).all()
    i, j = random.integers(2), random.integers(5)
    c[i, j] *= 0.99 * (samples / bounds)[:, i, j].max()
    with pytest.raises(Rejected, match=f"i = {i + 1}, j = {j + 1}"):
        prove(*arguments, c.tolist(), outputs, inputs.tolist())


def test_long_denominators_are_refused_before_they_are_multiplied() -> None:
    H = [[Fraction(1, 2**61 + 2 * (40 * i + j) + 1) + (i == j) for j in range(40)] for i in range(40)]
    witness: Any = SimpleNamespace(modes=H, blocks=[1] * 40, rates=[Fraction(1)], kernels=[])
    A = [[Fraction(-int(i == j)) for j in range(40)] for i in range(40)]
    with pytest.raises(Undecided, match="more work"):
        kernels.prove("agent 1", loop.Loop(0, 1, 0, A, [[]] * 40, A), witness)


@pytest.mark.parametrize("make", [producer.first_order, producer.second_order, producer.with_exosystem])
def test_the_nominal_loop_is_that_of_the_original_coordinates(make: Any) -> None:
    tiny = make()
    certificate = producer.produce(tiny)
    read = read_certificate(producer.encode(certificate))
    witness: Any = read.witness.agents[0]
    built = loop.build(read_plant(tiny.toml).agents[0], read.claim.agents[0], witness)
    for exact, found in zip((built.A, built.inputs, built.outputs), producer.loop(tiny), strict=True):
        assert np.allclose(np.array([[float(entry) for entry in row] for row in exact]), found, rtol=1e-9, atol=1e-9)


def test_increments_are_above_sampled_ones() -> None:
    tiny = producer.with_exosystem()
    plant = read_plant(tiny.toml.replace(b"z1*x1/10", b"z1*x1^2/3 + sin(x1)*exp(-z1^2)"))
    agent = plant.agents[0]
    optimum, v = between(-1, 1), {"v1": between(0, 1), "v2": enclose(Fraction(1, 2))}
    around = Surroundings(v, (between(1, 2),), between(-1, 2), enclose(3), enclose(1))
    z_bar, x_bar = [enclose(Fraction(1, 2))], [enclose(Fraction(1, 4))]
    rule = increments.Increments(agent, optimum, {})
    found = rule.slopes(around, z_bar, x_bar)
    bound = increments.bound_f1(found, increments.no_nominal(agent), z_bar, x_bar, around.distance)
    bounds0 = increments.bounds_f0(found, increments.no_nominal(agent), z_bar, x_bar, around.distance)
    random = np.random.default_rng(0)

    def f1(z: Any, x: Any, v1: Any) -> Any:
        return z + v1 + z * x**2 / 3 + np.sin(x) * np.exp(-(z**2))

    s, steady = random.uniform(-1, 1, 5000), random.uniform(1, 2, 5000)
    y, v1 = random.uniform(-1, 2, 5000), random.uniform(0, 1, 5000)
    z, x = steady + random.choice([-0.5, 0.5], 5000), y + random.choice([-0.25, 0.25], 5000)
    worst = np.abs(f1(z, x, v1) - f1(steady, s, v1)).max()
    assert worst <= float(bound.hi) <= 4 * worst
    assert np.abs((x - s) - (z - steady)).max() <= float(bounds0[0].hi)


REFERENCE = Reference(
    enclose(0), Fraction(1, 2), [Step(-k * UNIT, k * UNIT + 1, (5 - k) * UNIT, 7 * UNIT) for k in range(4)],
    enclose(9), enclose(11), Fraction(1, 8))


@pytest.mark.parametrize(("start", "end", "high", "distance", "speed"), [
    ("0", "1/2", 0, 5, 7), ("1/4", "3/4", 1, 5, 7), ("1/2", "1", 1, 4, 7), ("1/2", "9/8", 2, 4, 7),
    ("3/2", "2", 2, 2, 7), ("3/2", "17/8", 9, 9, 11), ("2", "3", 9, 9, 11), ("100", "200", 9, 9, 11)])
def test_the_reference_is_the_hull_over_the_steps_met(start: str, end: str, high: int, distance: int, speed: int
                                                      ) -> None:
    found = REFERENCE.during(Fraction(start), Fraction(end))
    assert (round(found.y.hi), round(found.distance.hi), found.speed.hi) == (high, distance, speed)


def test_the_exosystem_and_the_steady_state_are_enclosed_in_time() -> None:
    v0 = {"v1": enclose(0), "v2": between(1, Fraction(9, 8))}
    forever = {name: between(-2, 2) for name in v0}
    S = [[Fraction(0), Fraction(4, 5)], [Fraction(-4, 5), Fraction(0)]]
    exosystem = Exosystem(S, v0, forever)
    outside = Outside(exosystem, REFERENCE, ["v1/p + s", "p*v2"], {"p": (Fraction(1), Fraction(2))})
    for a, b in pairwise([Fraction(k, 3) for k in range(30)]):
        found = outside.during(a, b)
        width = float(max(v.hi - v.lo for v in found.v.values()))
        assert width <= 0.8 * 1.2 / 3 + 0.2
        for t in np.linspace(float(a), float(b), 7):
            for size in (1, 9 / 8):
                v1, v2 = size * np.sin(0.8 * t), size * np.cos(0.8 * t)
                values = [(v1, found.v["v1"]), (v2, found.v["v2"])]
                values += [(v1 / p, found.steady_state[0]) for p in (1, 1.5, 2)]
                values += [(p * v2, found.steady_state[1]) for p in (1, 1.5, 2)]
                assert all(float(box.lo) - 1e-12 <= value <= float(box.hi) + 1e-12 for value, box in values)
    assert outside.in_tail().v == forever


def test_a_steady_state_that_may_divide_by_zero_is_undecided() -> None:
    outside = Outside(Exosystem([], {}, {}), REFERENCE, ["s/p"], {"p": (Fraction(-1), Fraction(1))})
    with pytest.raises(Undecided, match="division"):
        outside.in_tail()
    assert parse("p", {"p": Name("p")}) == Name("p")
