"""Plant files: the example as the paper has it, and everything that a file may say, exactly."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction

import pytest
import sympy
from plant_texts import BASE, LONE, changed, read

from symbolic.plant import CoordinatorChoice, Edge, Interval, Plant, RequestedGains, symbol


def numbers(*rows: Iterable[Fraction]) -> list[list[Fraction]]:
    return [list(row) for row in rows]


def test_the_example_is_the_papers(five_agents: Plant) -> None:
    edges = [(3, 1), (1, 2), (2, 3), (3, 4), (4, 5), (2, 5), (5, 1)]
    assert five_agents.digraph.edges == tuple(Edge(i, j, Fraction(1)) for i, j in edges)
    z1, x1, x2, x3, v1, v2, s = map(symbol, ("z1", "x1", "x2", "x3", "v1", "v2", "s"))
    p1, p2, p3 = map(symbol, ("p1", "p2", "p3"))
    half = Fraction(1, 2)
    for agent in five_agents.agents:
        i = agent.id
        assert agent.parameters == (p1, p2, p3)
        assert agent.parameter_box == tuple(Interval(c - half, c + half) for c in map(Fraction, (-i, i, i)))
        assert agent.cost == (s - i + 1) ** 2 / 4
        assert agent.b == 1
        assert agent.internal_model is not None
        if i <= 2:
            assert (agent.order, agent.zero_states, agent.chain) == (2, (z1,), (x1, x2))
            assert agent.zero_dynamics == (p1 * z1 + x1 + 11 * v1,)
            assert agent.f == p2 * z1 * x1 * x2 + p3 * x2 + 12 * v2
            assert numbers(*agent.internal_model.M, agent.internal_model.N) == [[0, 1], [-2, -3], [0, 1]]
        else:
            assert (agent.order, agent.zero_states, agent.zero_dynamics) == (3, (), ())
            assert agent.f == p1 * x3 + p2 * x2 + p3 * x1**3 + 13 * v1
            rows = numbers(*agent.internal_model.M, agent.internal_model.N)
            assert rows == [[-3, -7, -5], [1, 0, 0], [0, 1, 0], [1, 0, 0]]
    theta = sympy.Rational(4, 5)
    assert five_agents.exosystem.S.tolist() == [[0, theta], [-theta, 0]]
    assert five_agents.exosystem.initial == (Interval(Fraction(0), Fraction(0)), Interval(Fraction(1), Fraction(1)))
    assert (five_agents.coordinator, five_agents.gains) == (CoordinatorChoice(), ())


def test_the_three_examples_differ_only_where_they_say(
    five_agents: Plant, five_agents_box: Plant, five_agents_published: Plant
) -> None:
    unit, zero = Interval(Fraction(-1), Fraction(1)), Interval(Fraction(0), Fraction(0))
    plants = (five_agents, five_agents_box, five_agents_published)
    for plain, box, published in zip(*(plant.agents for plant in plants), strict=True):
        assert plain == replace(published, gamma=None, observer=None)
        assert (published.gamma, published.observer) == {2: ((1,), (1, 2)), 3: ((1, 2), (1, 3, 3))}[plain.order]
        assert set(plain.initial.z) <= {unit}
        assert set(plain.initial.x) == {unit}
        assert (plain.initial.eta, plain.initial.reference) == (zero, zero)
        assert plain.initial.observer == (zero,) * plain.order
        assert box.initial.z == plain.initial.z
        assert box.initial.x == plain.initial.x
        assert (box.initial.eta, box.initial.reference) == (unit, unit)
        assert box.initial.observer == (unit,) * plain.order
        assert plain.f == box.f
    assert five_agents_published.gains == (RequestedGains(g=Fraction(1), K=Fraction(40000), h=Fraction(100)),) * 5
    assert five_agents_box.gains == ()


def test_everything_that_a_file_may_say() -> None:
    plant = read(BASE)
    second = plant.agents[1]
    z1, x1, x2, v1, v2, p1, p2, s = map(symbol, ("z1", "x1", "x2", "v1", "v2", "p1", "p2", "s"))
    assert plant.digraph.edges == (Edge(1, 2, Fraction(1)), Edge(2, 1, Fraction(1, 10)))
    assert second.zero_dynamics == (p1 * z1 + x1 + 11 * v1,)
    assert second.f == p2 * z1 * x1 * x2 + 20 * x2 + 10 * v2
    assert second.b == 1 + p2**2
    assert second.cost == (s - 1) ** 2 / 4
    ends = [(interval.lo, interval.hi) for interval in second.parameter_box]
    assert ends == [(Fraction(-5, 2), Fraction(-3, 2)), (Fraction(-1, 2), Fraction(1, 2))]
    assert second.steady_state == (-s / p1,)
    assert second.lyapunov == z1**2 / 2
    assert second.gamma == (Fraction(1, 2),)
    assert numbers(second.observer or ()) == [[1, 2]]
    assert plant.exosystem.initial[1] == Interval(Fraction(1, 2), Fraction(1))
    assert plant.coordinator == CoordinatorChoice(Fraction(3), Fraction(3, 2))
    assert plant.gains_of(2) == RequestedGains(K=Fraction(40000), h=Fraction(100))
    assert plant.sha256 == hashlib.sha256(BASE.encode()).hexdigest()


def test_a_plant_is_a_value() -> None:
    assert read(BASE) == read(BASE)
    assert hash(read(BASE)) == hash(read(BASE))
    assert read(BASE) != read(changed("K = 40000", "K = 40001"))


def test_without_an_exosystem_there_are_no_states() -> None:
    plant = read(LONE)
    assert (plant.exosystem.states, plant.exosystem.S.shape, plant.exosystem.initial) == ((), (0, 0), ())
    assert (plant.agents[0].zero_states, plant.agents[0].initial.z) == ((), ())


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("0.1", Fraction(1, 10)),
        ("1_000.5", Fraction(2001, 2)),
        ("+1e-3", Fraction(1, 1000)),
        ("2.5E+3", Fraction(2500)),
        ("0x10", Fraction(16)),
        ("12345678901234567890", Fraction(12345678901234567890)),
        ('"1/3"', Fraction(1, 3)),
        ("0.1000000000000000055511151231257827", Fraction("0.1000000000000000055511151231257827")),
    ],
)
def test_numbers_are_read_as_they_are_written(written: str, value: Fraction) -> None:
    plant = read(changed("K = 40000", f"K = {written}"))
    assert value == plant.gains_of(1).K


def test_a_matrix_of_the_exosystem_may_be_irrational() -> None:
    plant = read(changed('[[0, "theta"], ["-theta", 0]]', '[[0, "root"], ["-root", 0]]'))
    assert plant.exosystem.S.tolist() == [[0, sympy.sqrt(2)], [-sympy.sqrt(2), 0]]


@pytest.mark.parametrize("ids", ['"1-2"', '["1-2"]', '["1..2"]', "[2, 1]", '["1-1", 2]'])
def test_ids_may_be_ranges(ids: str) -> None:
    assert [agent.id for agent in read(changed("ids = [1, 2]", f"ids = {ids}")).agents] == [1, 2]


ENDS = {
    "unit": Interval(Fraction(-1), Fraction(1)),
    "zero": Interval(Fraction(0), Fraction(0)),
    "two": Interval(Fraction(2), Fraction(2)),
    "wide": Interval(Fraction(-3), Fraction(4)),
}


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("", ["unit", "unit", "unit"]),
        ("x = 2", ["two", "two", "two"]),
        ("x = [-3, 4]", ["wide", "wide", "wide"]),
        ("x = [[-1, 1], [2, 2], [-3, 4]]", ["unit", "two", "wide"]),
        ("x = { x3 = 2, x1 = 0 }", ["zero", "unit", "two"]),
    ],
)
def test_the_initial_box_by_component(line: str, expected: list[str]) -> None:
    agent = read(changed("box = 0", f"box = [-1, 1]\n{line}", LONE)).agents[0]
    assert agent.initial.x == tuple(ENDS[name] for name in expected)
    assert agent.initial.eta == ENDS["unit"]


def test_the_observer_may_start_from_the_measurement() -> None:
    assert read(changed("box = 0", 'box = 0\nobserver = "measured"', LONE)).agents[0].initial.observer is None


def test_the_reference_may_differ_by_agent() -> None:
    plant = read(changed("reference = 0", 'reference = ["-id", "id"]'))
    assert [agent.initial.reference.hi for agent in plant.agents] == [1, 2]
