"""A2: strong connectivity, with the null vector or a cut as evidence."""

from __future__ import annotations

from fractions import Fraction

from certify.assumptions.a2_network import check_network
from symbolic.network import laplacian
from symbolic.plant import Digraph, Edge


def graph(agents: int, *edges: tuple[int, int]) -> Digraph:
    return Digraph(agents, tuple(Edge(source, target, Fraction(1)) for source, target in edges))


def test_the_null_vector_of_a_strongly_connected_digraph() -> None:
    digraph = graph(5, (3, 1), (1, 2), (2, 3), (3, 4), (4, 5), (2, 5), (5, 1))
    finding = check_network(digraph)
    assert finding.verdict == "holds"
    r = [Fraction(entry) for entry in finding.evidence["r"]]
    assert r == [Fraction(k, 11) for k in (2, 4, 3, 1, 1)]
    assert all(sum(r[i] * laplacian(digraph)[i][j] for i in range(5)) == 0 for j in range(5))


def test_a_chain_is_cut() -> None:
    finding = check_network(graph(3, (1, 2), (2, 1), (2, 3)))
    assert finding.verdict == "fails"
    assert "no edge enters the agents {1, 2}" in finding.reason
    assert finding.evidence["components"] == [[1, 2], [3]]
    assert finding.evidence["cuts"] == [
        {"agents": [1, 2], "hears_nobody": True},
        {"agents": [3], "hears_nobody": False},
    ]


def test_two_islands_are_cut() -> None:
    assert check_network(graph(4, (1, 2), (2, 1), (3, 4), (4, 3))).verdict == "fails"


def test_one_agent_is_strongly_connected() -> None:
    finding = check_network(graph(1))
    assert (finding.verdict, finding.evidence["r"]) == ("holds", ["1"])


def test_a_large_ring_holds_without_its_null_vector() -> None:
    finding = check_network(graph(1000, *((k, k % 1000 + 1) for k in range(1, 1001))))
    assert finding.verdict == "holds"
    assert "r" not in finding.evidence
