"""Plants from SymPy expressions and networkx graphs mean what the same plant file means."""

from __future__ import annotations

import doctest
from fractions import Fraction
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
import sympy

import symbolic.network_description
from symbolic.errors import InputError
from symbolic.network_description import Network, agent
from symbolic.plant import Interval, Plant
from symbolic.plant_file import load_plant
from symbolic.toml_value import toml_value

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
theta, omega, d, v1, v2, s, i = sympy.symbols("theta omega d v1 v2 s id")
PENDULUM = agent(
    -9.81 / (1 + i / 4) * sympy.sin(theta) - d * omega + v1,
    (s - (i - 2) / 4) ** 2,
    states=(theta, omega),
    uncertain={d: (0.3, 0.7)},
)
RING = nx.DiGraph([(1, 2), (2, 3), (3, 1), (1, 3)])


def pendulums(**changes: object) -> Network:
    given = {
        "name": "pendulums",
        "graph": RING,
        "agents": PENDULUM,
        "exosystem": {"states": (v1, v2), "S": sympy.Matrix([[0, 1], [-1, 0]]), "initial": {v1: 0, v2: 0.5}},
        "initial": {"z": 0, "x": np.array([-0.5, 0.5])},
    }
    return Network(**{**given, **changes})  # type: ignore[arg-type]


def parts(plant: Plant) -> tuple[object, ...]:
    return plant.name, plant.exosystem, plant.agents, set(plant.digraph.edges)


def test_docstrings_hold() -> None:
    assert doctest.testmod(symbolic.network_description).failed == 0


def test_same_plant_as_the_file() -> None:
    assert parts(pendulums().plant) == parts(load_plant(EXAMPLES / "pendulums.toml"))


def test_nodes_of_any_kind_and_weights() -> None:
    graph = nx.DiGraph()
    graph.add_edge("north", "south", weight=0.1)
    graph.add_edge("south", "north")
    problem = pendulums(graph=graph, agents={"south": PENDULUM, "north": PENDULUM})
    assert problem.numbers == {"north": 1, "south": 2}
    assert [(e.source, e.target, e.weight) for e in problem.plant.digraph.edges] == [
        (1, 2, Fraction(1, 10)),
        (2, 1, Fraction(1)),
    ]


def test_undirected_edges_go_both_ways() -> None:
    edges = pendulums(graph=nx.Graph([(1, 2), (2, 3)])).plant.digraph.edges
    assert {(e.source, e.target) for e in edges} == {(1, 2), (2, 1), (2, 3), (3, 2)}


def test_designers_values_are_zero_unless_a_box_is_given() -> None:
    zero, box = Interval(Fraction(0), Fraction(0)), Interval(Fraction(-1), Fraction(1))
    assert pendulums().plant.agents[0].initial.eta == zero
    assert pendulums(initial={"box": (-1, 1)}).plant.agents[0].initial.eta == box


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"graph": nx.MultiDiGraph([(1, 2)])}, "pendulums: graph: one edge"),
        ({"agents": {1: PENDULUM}}, "agents: a description for every node is needed, node 2 has none"),
        ({"agents": {7: PENDULUM}}, "agents: a description for every node is needed, 7 is no node"),
        ({"initial": {"x": float("inf")}}, "initial: x: a finite number"),
        ({"initial": {"x": object()}}, "initial: x: a number, an expression or a text is needed, found object"),
        ({"gains": {"K": True}}, "gains: K: a number is needed, found True"),
        ({"gains": {"k": 1}}, "gains: unknown key 'k'; did you mean 'K'"),
        ({"agents": agent(sympy.Abs(theta), s**2)}, r"agent\[1\]\.f: column 1: unknown function 'Abs'"),
        ({"agents": agent(sympy.Symbol("y") + 1, s**2)}, r"agent\[1\]\.f: column 1: 'y' may not appear"),
        ({"graph": nx.DiGraph()}, "pendulums: graph: at least one node"),
    ],
)
def test_refusals_name_the_key(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        pendulums(**changes).plant  # noqa: B018


def test_own_names_of_states_may_be_used_in_the_initial_box() -> None:
    own = pendulums(initial={"z": 0, "x": {theta: (-0.1, 0.1), "omega": 0}})
    chain = pendulums(initial={"z": 0, "x": {"x1": (-0.1, 0.1), "x2": 0}})
    assert own.plant.agents == chain.plant.agents
    turned = agent(-theta, s**2, states=(omega, theta))
    with pytest.raises(InputError, match="the state 'omega' is x2 of one and x1 of another"):
        pendulums(agents=[PENDULUM, turned, PENDULUM]).plant  # noqa: B018


def test_a_list_has_a_description_for_every_node_in_order() -> None:
    first = agent(v1 - sympy.Symbol("x1"), s**2)
    assert [one.order for one in pendulums(agents=[first, PENDULUM, first]).plant.agents] == [1, 2, 1]
    with pytest.raises(InputError, match="found 1 descriptions for 3 nodes"):
        pendulums(agents=[first]).plant  # noqa: B018


def test_functions_of_time_are_states() -> None:
    moving = sympy.Function("x1")(sympy.Symbol("t"))
    assert pendulums(agents=agent(-moving, s**2)).plant.agents[0].f == -pendulums().plant.agents[0].chain[0]


def test_messages_name_no_line_of_a_text_that_nobody_has_seen() -> None:
    with pytest.raises(InputError) as caught:
        pendulums(initial={}).plant  # noqa: B018
    assert str(caught.value).startswith("pendulums: initial.x: missing")


def test_a_plant_and_a_network_are_a_line() -> None:
    assert repr(pendulums()) == "<Network 'pendulums': 3 agents, 4 edges>"
    assert repr(pendulums().plant).startswith("<Plant 'pendulums': 3 agents of order 2, 4 edges, 2 exosystem states")
    with pytest.raises(InputError, match="pendulums: graph: a graph of networkx is needed, found list"):
        pendulums(graph=[(1, 2)])


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.1, "0.1"),
        (np.float64(0.1), "0.1"),
        (np.int64(3), "3"),
        (1e-5, "0.00001"),
        (Fraction(1, 3), '"1/3"'),
        (sympy.sqrt(2), '"sqrt(2)"'),
        (0.1 * sympy.Symbol("a"), '"a/10"'),
        ({sympy.Symbol("p"): (-1, 1)}, "{ p = [-1, 1] }"),
        ("id + 1", '"id + 1"'),
    ],
)
def test_values_stay_exact(value: object, text: str) -> None:
    assert toml_value(value) == text


def test_quantities_are_taken_in_the_declared_unit() -> None:
    pint = pytest.importorskip("pint")
    quantity = pint.UnitRegistry(non_int_type=Fraction).Quantity
    half_minute = quantity(Fraction(1, 2), "minute")
    assert toml_value(half_minute) == "30"
    assert toml_value({"d": half_minute}, units={"d": "hour"}) == '{ d = "1/120" }'
    with pytest.raises(InputError, match=r"initial: x\.x1: Cannot convert from 'minute'"):
        pendulums(initial={"x": {"x1": half_minute}}, units={"x1": "metre"}).text  # noqa: B018
