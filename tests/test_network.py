"""Laplacian, components, cuts and the left null vector, against their definitions."""

from __future__ import annotations

from fractions import Fraction

import networkx
import pytest
from counted import at_most
from hypothesis import given
from hypothesis import strategies as st

from symbolic.network import cuts, is_balanced, laplacian, left_null_vector, strongly_connected_components
from symbolic.plant import Digraph, Edge, Plant


def digraph(agents: int, *pairs: tuple[int, int], weight: Fraction = Fraction(1)) -> Digraph:
    return Digraph(agents, tuple(Edge(source, target, weight) for source, target in pairs))


@st.composite
def digraphs(draw: st.DrawFn) -> Digraph:
    agents = draw(st.integers(1, 7))
    pairs = [(i, j) for i in range(1, agents + 1) for j in range(1, agents + 1) if i != j]
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    weights = st.fractions(min_value=Fraction(1, 50), max_value=50, max_denominator=50)
    return Digraph(agents, tuple(Edge(source, target, draw(weights)) for source, target in chosen))


def test_the_example_by_hand(five_agents: Plant) -> None:
    expected = [[2, 0, -1, 0, -1], [-1, 1, 0, 0, 0], [0, -1, 1, 0, 0], [0, 0, -1, 1, 0], [0, -1, 0, -1, 2]]
    assert [list(row) for row in laplacian(five_agents.digraph)] == expected
    assert left_null_vector(five_agents.digraph) == tuple(Fraction(k, 11) for k in (2, 4, 3, 1, 1))
    assert not is_balanced(five_agents.digraph)
    assert cuts(five_agents.digraph) == ()


def test_a_heard_agent_stands_in_the_row_of_the_one_that_hears() -> None:
    graph = Digraph(2, (Edge(1, 2, Fraction(3, 2)),))
    assert [list(row) for row in laplacian(graph)] == [[0, 0], [Fraction(-3, 2), Fraction(3, 2)]]


@given(digraphs())
def test_rows_of_the_laplacian_sum_to_zero_and_weights_stand_off_the_diagonal(graph: Digraph) -> None:
    rows = laplacian(graph)
    assert all(sum(row) == 0 for row in rows)
    weights = {(edge.target, edge.source): edge.weight for edge in graph.edges}
    for i, row in enumerate(rows, 1):
        for j, entry in enumerate(row, 1):
            assert i == j or -entry == weights.get((i, j), 0)


@given(digraphs())
def test_components_agree_with_reachability(graph: Digraph) -> None:
    oracle = networkx.DiGraph((edge.source, edge.target) for edge in graph.edges)
    oracle.add_nodes_from(range(1, graph.agents + 1))
    home = {agent: part for part in strongly_connected_components(graph) for agent in part}
    for i in oracle:
        for j in oracle:
            both = networkx.has_path(oracle, i, j) and networkx.has_path(oracle, j, i)
            assert (home[i] == home[j]) is both


@given(digraphs())
def test_the_left_null_vector_is_positive_and_exact_or_a_cut_is_shown(graph: Digraph) -> None:
    found = cuts(graph)
    if not found:
        r = left_null_vector(graph)
        rows = laplacian(graph)
        assert sum(r) == 1
        assert min(r) > 0
        assert all(sum(r[i] * rows[i][j] for i in range(graph.agents)) == 0 for j in range(graph.agents))
        assert is_balanced(graph) is (len(set(r)) == 1)
        return
    assert len(strongly_connected_components(graph)) > 1
    assert {cut.hears_nobody for cut in found} == {True, False}
    for cut in found:
        inside = set(cut.component)
        assert inside < set(range(1, graph.agents + 1))
        for edge in graph.edges:
            entering, leaving = edge.target in inside, edge.source in inside
            assert entering == leaving or leaving is cut.hears_nobody
    with pytest.raises(ValueError, match="not strongly connected: no edge enters"):
        left_null_vector(graph)


def test_a_cut_names_the_agents() -> None:
    chain = digraph(4, (1, 2), (2, 1), (2, 3), (3, 4), (4, 3))
    assert [str(cut) for cut in cuts(chain)] == ["no edge enters the agents {1, 2}", "no edge leaves the agents {3, 4}"]


def test_one_agent_is_strongly_connected() -> None:
    assert list(left_null_vector(Digraph(1, ()))) == [1]
    assert is_balanced(Digraph(1, ()))


def test_balance_is_of_weights_not_of_edges() -> None:
    ring = digraph(3, (1, 2), (2, 3), (3, 1))
    assert is_balanced(ring)
    assert left_null_vector(ring) == (Fraction(1, 3),) * 3
    heavier = Digraph(3, (*ring.edges[:2], Edge(3, 1, Fraction(2))))
    assert not is_balanced(heavier)


def test_fifty_agents_are_quick_and_exact() -> None:
    size = 50
    edges = {(i, i % size + 1): Fraction(i, 7) for i in range(1, size + 1)}
    edges |= {(i, (3 * i + 5) % size + 1): Fraction(11, i) for i in range(1, size + 1) if (3 * i + 5) % size + 1 != i}
    graph = Digraph(size, tuple(Edge(i, j, weight) for (i, j), weight in edges.items()))
    with at_most(40_000):
        r = left_null_vector(graph)
    rows = laplacian(graph)
    assert all(sum(r[i] * rows[i][j] for i in range(size)) == 0 for j in range(size))
