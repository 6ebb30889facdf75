"""The parts of the rule for direct/3 against what they enclose: kernels, loops, slopes, ranges, time."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import direct_producer as producer
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from certify.checker import linear
from certify.checker.balls import BITS, precision
from certify.checker.certificate import read_certificate
from certify.checker.expressions import Name, Node, evaluate, names_in, parse
from certify.checker.functions import call
from certify.checker.intervals import between, enclose
from certify.checker.plant import read_plant
from certify.checker.rules import kernels, loop
from certify.checker.rules.increments import Increments, increment
from certify.checker.rules.mixing import UNIT
from certify.checker.rules.observer import tabulate
from certify.checker.rules.reference import Reference, Step
from certify.checker.rules.surroundings import Exosystem, Outside, Surroundings
from certify.checker.rules.zero_ranges import ZeroRanges
from certify.checker.slopes import Path
from certify.checker.theorems import kinds
from certify.checker.verdict import Rejected, Undecided


@cache
def produced(make: Any) -> Any:
    return producer.produce(make())


def exactly(A: Any) -> list[list[Fraction]]:
    return [[Fraction(float(entry)) for entry in row] for row in np.array(A, dtype=float)]


def prove(
    A: Any, H: Any, blocks: list[int], rates: list[Fraction], c: Any, outputs: Any = None, inputs: Any = None
) -> None:
    size = len(A)
    outputs = np.eye(size) if outputs is None else outputs
    inputs = np.zeros((size, 0)) if inputs is None else inputs
    plain = loop.Loop(
        0, 1, exactly(A), [list(map(Fraction, row)) for row in inputs], exactly(np.eye(size)), exactly(outputs)
    )
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
    prove(ROTATION, np.eye(2), [2], [Fraction(3, 4)], c)
    with pytest.raises(Rejected, match="μ_1 < σ − ε"):
        prove(ROTATION, np.eye(2), [1, 1], [Fraction(3, 4)], c)
    with pytest.raises(Rejected, match="kernels"):
        prove(ROTATION, np.eye(2), [2], [Fraction(3, 4)], [[["11/10"], ["9/10"]], [["11/10"]] * 2])


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


@pytest.mark.parametrize(
    ("second", "third", "proved"),
    [("-1/2", "-3/10", True), ("-1/2", "-3/5", False), ("-11/10", "0", False), ("-1/2", "0", True), ("0", "0", True)],
)
def test_a_coefficient_may_be_negative(second: str, third: str, proved: bool) -> None:
    """``|e^(−t) − e^(−4t)| ≤ 21/20 e^(−0.9t) + c_2 e^(−4t) + c_3 e^(−8t)``: the sum must not be below 0 at 0."""

    def attempt() -> None:
        wide = ["21/20", "0", "0"]
        prove(
            np.diag([-1, -4]),
            np.eye(2),
            [1, 1],
            [Fraction(9, 10), Fraction(4), Fraction(8)],
            [[["21/20", second, third], wide, wide]],
            outputs=[[1, -1]],
            inputs=[[1], [1]],
        )

    if proved:
        attempt()
    else:
        with pytest.raises(Rejected, match="i = 1, j = 1, from_t = 0"):
            attempt()


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
        kernels.prove("agent 1", loop.Loop(0, 1, A, [[]] * 40, A, A), witness)


@pytest.mark.parametrize(
    "make", [producer.first_order, producer.second_order, producer.third_order, producer.with_exosystem]
)
def test_the_nominal_loop_is_that_of_the_original_coordinates(make: Any) -> None:
    tiny = make()
    read = read_certificate(producer.encode(produced(make)), kinds())
    witness: Any = read.witness.agents[0]
    built = loop.build(read_plant(tiny.toml).agents[0], read.claim.agents[0], witness)
    A, inputs, outputs = producer.loop(tiny)
    for exact, found in zip(
        (built.A, built.inputs, built.starts, built.outputs),
        (A, inputs, producer.starts(tiny, len(A)), outputs),
        strict=True,
    ):
        assert np.allclose(np.array([[float(entry) for entry in row] for row in exact]), found, rtol=1e-9, atol=1e-9)


NAMES = ("a", "b", "c")
LEAVES = st.one_of(st.sampled_from(NAMES), st.integers(1, 5).map(str))
EXPRESSIONS = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda parts: "({} {} {})".format(*parts)),
        st.tuples(inner, inner).map(lambda parts: "({} / (6 + {}^2))".format(*parts)),
        st.tuples(inner, st.sampled_from([2, 3, -2])).map(lambda parts: "(4 + sin({}))^{}".format(*parts)),
        st.tuples(st.sampled_from(["sin", "cos", "atan", "tanh"]), inner).map(lambda parts: "{}({})".format(*parts)),
        inner.map(lambda part: f"exp(sin({part}))"),
        inner.map(lambda part: f"sqrt(2 + cos({part}))"),
        inner.map(lambda part: f"log(3 + sin({part}))"),
        inner.map(lambda part: f"-{part}"),
    ),
    max_leaves=8,
)
BOX = st.tuples(st.integers(-8, 8), st.integers(0, 6)).map(lambda ends: (Fraction(ends[0], 4), Fraction(sum(ends), 4)))
PLACE = st.integers(0, 4)


@settings(max_examples=300, deadline=None)
@given(EXPRESSIONS, st.tuples(BOX, BOX, BOX), st.tuples(BOX, BOX, BOX), st.tuples(*[PLACE] * 6))
def test_slopes_hold_every_quotient_of_differences(text: str, before: Any, after: Any, places: Any) -> None:
    """On ``text(x) − text(c)``, leg by leg, for points ``c`` and ``x`` of the boxes."""
    node = parse(text, {name: Name(name) for name in NAMES})
    found = Path(node, NAMES).slopes(
        {name: between(*box) for name, box in zip(NAMES, before, strict=True)},
        {name: between(*box) for name, box in zip(NAMES, after, strict=True)},
    )
    ends = [lo + (hi - lo) * k / 4 for (lo, hi), k in zip((*before, *after), places, strict=True)]
    values = {name: enclose(end) for name, end in zip(NAMES, ends[:3], strict=True)}
    for name, c, x, slope in zip(NAMES, ends[:3], ends[3:], found, strict=True):
        start = evaluate(node, values, enclose, call)
        values[name] = enclose(x)
        change = evaluate(node, values, enclose, call) - start
        possible = slope * (x - c) - change
        assert possible.lo <= 0 <= possible.hi
        assert name in names_in(node) or slope.is_zero


def test_slopes_are_sharp_where_one_coordinate_occurs_once() -> None:
    node = parse("2*a^3 - b/(1 + c)", {name: Name(name) for name in NAMES})
    still, moved = dict.fromkeys(NAMES, enclose(1)), dict.fromkeys(NAMES, enclose(3))
    slopes = Path(node, NAMES).slopes(still, moved)
    assert [(float(slope.lo), float(slope.hi)) for slope in slopes] == [(26, 26), (-0.5, -0.5), (0.375, 0.375)]


@pytest.mark.parametrize("text", ["1/b + a", "a + (b - b)/b", "sqrt(b)", "log(b)", "b/b"])
def test_a_slope_needs_an_expression_that_is_smooth_at_the_box(text: str) -> None:
    """Also if no coordinate that moves occurs in it."""
    node, box = parse(text, {name: Name(name) for name in NAMES}), dict.fromkeys(NAMES, between(-1, 1))
    with pytest.raises(Undecided):
        Path(node, ["a", "c"]).slopes(box, box)


def test_increments_are_above_sampled_ones() -> None:
    tiny = producer.with_exosystem()
    plant = read_plant(tiny.toml.replace(b"z1*x1/10", b"z1*x1^2/3 + sin(x1)*exp(-z1^2)"))
    agent = plant.agents[0]
    optimum, v = between(-1, 1), {"v1": between(0, 1), "v2": enclose(Fraction(1, 2))}
    around = Surroundings(v, (between(1, 2),), between(-1, 2), enclose(3), enclose(1))
    z_bar, x_bar = [enclose(Fraction(1, 2))], [enclose(Fraction(1, 4))]
    rule = Increments(agent, optimum, {}, ZeroRanges("agent 1", agent, []))
    found = rule.in_tail(around, z_bar, x_bar)
    bound = increment(found.f1, [enclose(0)] * 2, z_bar, x_bar, around.distance)
    bound_z = increment(found.f0[0], [enclose(0)] * 2, z_bar, x_bar, around.distance)
    beside = increment(found.f1, [enclose(-1), enclose(Fraction(1, 2))], z_bar, x_bar, around.distance)
    random = np.random.default_rng(0)

    def f1(z: Any, x: Any, v1: Any) -> Any:
        return z + v1 + z * x**2 / 3 + np.sin(x) * np.exp(-(z**2))

    s, steady = random.uniform(-1, 1, 5000), random.uniform(1, 2, 5000)
    y, v1 = random.uniform(-1, 2, 5000), random.uniform(0, 1, 5000)
    z, x = steady + random.choice([-0.5, 0.5], 5000), y + random.choice([-0.25, 0.25], 5000)
    change = f1(z, x, v1) - f1(steady, s, v1)
    assert np.abs(change).max() <= float(bound.hi) <= 5 * np.abs(change).max()
    assert np.abs(change - (z - steady) + (x - y) / 2).max() <= float(beside.hi)
    assert np.abs((x - s) - (z - steady)).max() <= float(bound_z.hi)


def test_increments_use_the_ranges_of_zero_states() -> None:
    tiny = producer.with_exosystem()
    agent = read_plant(tiny.toml.replace(b"z1*x1/10", b"z1*x1")).agents[0]
    v = dict.fromkeys(("v1", "v2"), between(-1, 1))
    around = Surroundings(v, (between(-1, 1),), between(-1, 1), enclose(1), enclose(1))
    rule = Increments(agent, enclose(0), {}, ZeroRanges("agent 1", agent, [[(Fraction(-4), Fraction(5))]]))
    by_ranges = rule.on_step(0, Fraction(2), around, [enclose(9)], [enclose(0)])
    without = rule.on_step(1, Fraction(2), around, [enclose(9)], [enclose(0)])
    assert (by_ranges.f1[1].lo, by_ranges.f1[1].hi) == (-4, 5)
    assert (without.f1[1].lo, without.f1[1].hi) == (-10, 10)
    with pytest.raises(Undecided, match="nothing in common"):
        shifted = Surroundings(v, (between(20, 21),), around.y, around.distance, around.speed)
        rule.on_step(0, Fraction(2), shifted, [enclose(9)], [enclose(0)])


@pytest.mark.parametrize("c", [[2, 3], [1, 2], [1, 3, 3], [6, 11, 6], [4, 8, 8, 4]])
def test_the_table_is_above_the_exponential(c: list[int]) -> None:
    n, observer = len(c), tuple(map(Fraction, c))
    table, E3 = tabulate(observer), loop.observer_matrix(observer)
    with precision(BITS):
        *bounds, rest, area = np.array(
            [[[float(x.upper()) for x in row] for row in A.tolist()] for A in (*table.bounds, table.rest, table.area)]
        )
    d, exact = float(table.step), np.array([[float(entry) for entry in row] for row in E3])
    assert 4 * d * np.abs(exact).sum(axis=1).max() <= 1 < 8 * d * np.abs(exact).sum(axis=1).max()
    fine = 8
    small, E, integral = expm(exact * d / fine), np.eye(n), np.zeros((n, n))
    sampled = []
    for _ in range((len(bounds) + 200) * fine):
        sampled.append(np.abs(E))
        integral += np.abs(E) * d / fine
        E = E @ small
    later = np.maximum.accumulate(np.array(sampled)[::-1])[::-1][::fine]
    assert (later[: len(bounds)] <= np.maximum(bounds, rest) * (1 + 1e-9)).all()
    assert (later[len(bounds) :] <= rest).all()
    assert (np.maximum(bounds, rest) <= 1.8 * later[: len(bounds)].max()).all()
    assert (integral <= area * 1.01).all() and (area <= 1.5 * integral + 0.1).all()


@pytest.mark.parametrize("c", [[1, -1], [0, 1], [1, 0], [4, 1, 1]])
def test_an_observer_that_does_not_settle_has_no_table(c: list[int]) -> None:
    with pytest.raises(Undecided, match="too slow"):
        tabulate(tuple(map(Fraction, c)))


def test_ranges_hold_the_trajectories_of_two_zero_states() -> None:
    """``z1' = −z1 + z2²/4 + x1``, ``z2' = −2 z2 + p z1 + v1`` in ranges that are just wide enough on their faces."""
    toml = (
        producer.with_exosystem()
        .toml.decode()
        .replace("{ q =", "{ p = [0.5, 1], q =")
        .replace(
            'zero_dynamics = { z1 = "-z1 + x1 + v1" }',
            'zero_dynamics = { z1 = "-z1 + z2^2/4 + x1", z2 = "-2*z2 + p*z1 + v1" }',
        )
    )
    agent = read_plant(toml.encode()).agents[0]
    length, steps, X, V = Fraction(1, 16), 40, Fraction(1, 2), Fraction(1, 4)
    box = {"v1": between(-V, V), "v2": between(-1, 1), "x1": between(-X, X), "p": between(Fraction(1, 2), 1)}
    edges, entries = (Fraction(1), Fraction(1)), []
    for _ in range(steps):
        a, b = edges  # |z1| ≤ a, |z2| ≤ b: the faces move inward at −a + b²/4 + X and −2b + a + V, slower than they may
        edges = (
            a + length * max(-a * 9 / 10 + b**2 / 4 + X, Fraction(0)),
            b + length * max(-2 * b * 9 / 10 + a * 21 / 20 + V, Fraction(-1, 8)),
        )
        entries.append([(-edge, edge) for edge in edges])
    ranges = ZeroRanges("agent 1", agent, entries)
    for k in range(steps):
        held = ranges.during(k)
        assert held is not None
        ranges.prove(k, length, {**box, "z1": held[0], "z2": held[1]})
    assert ranges.during(steps) is None
    random = np.random.default_rng(1)
    for _ in range(20):
        z, p, phase = random.choice([-1.0, 1.0], 2), random.uniform(0.5, 1), random.uniform(0, 6, 2)

        def flow(t: float, z: Any, p: float = p, phase: Any = phase) -> Any:
            x1, v1 = float(X) * np.sign(np.sin(3 * t + phase[0])), float(V) * np.cos(t + phase[1])
            return [-z[0] + z[1] ** 2 / 4 + x1, -2 * z[1] + p * z[0] + v1]

        times = np.linspace(0, float(length) * steps, 4 * steps + 1)
        states = solve_ivp(flow, (0, times[-1]), z, t_eval=times, max_step=0.02).y.T
        for k, state in enumerate(states[:-1]):
            held = ranges.during(k // 4)
            assert held is not None
            assert all(float(R.lo) - 1e-6 <= value <= float(R.hi) + 1e-6 for R, value in zip(held, state, strict=True))
    entries[5] = [(lo, hi) for lo, hi in entries[4]]
    entries[5][1] = (entries[5][1][0], entries[5][1][1] * Fraction(3, 4))
    with pytest.raises(Rejected, match=r"ranges: step 6: R_2\^hi outruns z_2"):
        ZeroRanges("agent 1", agent, entries).prove(5, length, {**box, "z1": between(-1, 1), "z2": between(-1, 1)})


REFERENCE = Reference(
    enclose(0),
    [Fraction(k, 2) for k in range(5)],
    [Step(-k * UNIT, k * UNIT + 1, (5 - k) * UNIT, 7 * UNIT) for k in range(4)],
    enclose(9),
    enclose(11),
    Fraction(1, 8),
)


@pytest.mark.parametrize(
    ("start", "end", "high", "distance", "speed"),
    [
        ("0", "1/2", 0, 5, 7),
        ("1/4", "3/4", 1, 5, 7),
        ("1/2", "1", 1, 4, 7),
        ("1/2", "9/8", 2, 4, 7),
        ("3/2", "2", 2, 2, 7),
        ("3/2", "17/8", 9, 9, 11),
        ("2", "3", 9, 9, 11),
        ("100", "200", 9, 9, 11),
    ],
)
def test_the_reference_is_the_hull_over_the_steps_met(
    start: str, end: str, high: int, distance: int, speed: int
) -> None:
    found = REFERENCE.during(Fraction(start), Fraction(end))
    assert (round(found.y.hi), round(found.distance.hi), found.speed.hi) == (high, distance, speed)


def read(*texts: str) -> list[Node]:
    return [parse(text, {name: Name(name) for name in ("s", "v1", "v2", "p")}) for text in texts]


def test_the_exosystem_and_the_steady_state_are_enclosed_in_time() -> None:
    v0 = {"v1": enclose(0), "v2": between(1, Fraction(9, 8))}
    forever = {name: between(-2, 2) for name in v0}
    S = [[Fraction(0), Fraction(4, 5)], [Fraction(-4, 5), Fraction(0)]]
    exosystem = Exosystem(S, linear.identity(2), v0, forever)
    outside = Outside(exosystem, REFERENCE, read("v1/p + s", "p*v2"), {"p": (Fraction(1), Fraction(2))}, {})
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
    tail = outside.in_tail()
    assert tail.v == forever
    for t in np.linspace(0, 8, 30):
        v1, v2 = 9 / 8 * np.sin(t), 9 / 8 * np.cos(t)
        for p in (1, 1.5, 2):
            assert all(
                float(box.lo) <= value <= float(box.hi)
                for value, box in zip((v1 / p, p * v2), tail.steady_state, strict=True)
            )
    assert 9 / 4 <= tail.steady_state[1].hi < 2.3


def test_in_the_tail_the_ellipse_of_the_exosystem_bounds_the_steady_state() -> None:
    """``|v1 + v2| ≤ √2`` on the unit circle, ``≤ 2`` on the square around it."""
    v0 = {"v1": enclose(0), "v2": enclose(1)}
    exosystem = Exosystem(
        [[Fraction(0), Fraction(1)], [Fraction(-1), Fraction(0)]],
        linear.identity(2),
        v0,
        dict.fromkeys(v0, between(-1, 1)),
    )
    outside = Outside(exosystem, REFERENCE, read("v1 + v2", "v1*v2"), {}, {})
    by_sum, by_product = outside.in_tail().steady_state
    assert 2 <= by_sum.hi**2 < 2.001
    assert (by_product.lo, by_product.hi) == (-1, 1)


def test_a_steady_state_that_may_divide_by_zero_is_undecided() -> None:
    outside = Outside(Exosystem([], [], {}, {}), REFERENCE, read("s/p"), {"p": (Fraction(-1), Fraction(1))}, {})
    with pytest.raises(Undecided, match="division"):
        outside.in_tail()
    assert parse("p", {"p": Name("p")}) == Name("p")
