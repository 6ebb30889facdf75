"""The communication digraph: Laplacian, strong connectivity, left null vector (theory.md section 1 and A2)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from flint import fmpq, fmpq_mat
from sympy.utilities import iterables

from symbolic.plant import Digraph


@dataclass(frozen=True)
class Cut:
    """A strongly connected component that is cut off: no edge enters it (``hears_nobody``) or none leaves it.

    A digraph that is not strongly connected has one of each kind.
    """

    component: tuple[int, ...]
    hears_nobody: bool

    def __str__(self) -> str:
        agents = ", ".join(map(str, self.component))
        return f"no edge {'enters' if self.hears_nobody else 'leaves'} the agents {{{agents}}}"


def laplacian(digraph: Digraph) -> tuple[tuple[Fraction, ...], ...]:
    """``L = diag(Σ_j a_ij) − A`` with ``a_ij`` the weight of the edge ``j -> i``; N×N, rows sum to zero."""
    rows = [[Fraction(0)] * digraph.agents for _ in range(digraph.agents)]
    for edge in digraph.edges:
        rows[edge.target - 1][edge.source - 1] -= edge.weight
        rows[edge.target - 1][edge.target - 1] += edge.weight
    return tuple(map(tuple, rows))


def strongly_connected_components(digraph: Digraph) -> tuple[tuple[int, ...], ...]:
    """The components, each sorted, ordered by their smallest agent."""
    agents, edges = list(range(1, digraph.agents + 1)), [(edge.source, edge.target) for edge in digraph.edges]
    return tuple(sorted(tuple(sorted(part)) for part in iterables.strongly_connected_components((agents, edges))))


def cuts(digraph: Digraph) -> tuple[Cut, ...]:
    """Witnesses that the digraph is not strongly connected: every component with no incoming or no outgoing edge.

    Empty exactly when it is strongly connected.
    """
    components = strongly_connected_components(digraph)
    if len(components) == 1:
        return ()
    home = {agent: part for part in components for agent in part}
    crossing = [edge for edge in digraph.edges if home[edge.source] != home[edge.target]]
    entered = {home[edge.target] for edge in crossing}
    left = {home[edge.source] for edge in crossing}
    return (
        *(Cut(part, True) for part in components if part not in entered),
        *(Cut(part, False) for part in components if part not in left),
    )


def left_null_vector(digraph: Digraph) -> tuple[Fraction, ...]:
    """The exact ``r > 0`` with ``rᵀL = 0`` and ``Σ r_i = 1``. Raises ``ValueError`` if not strongly connected."""
    found = cuts(digraph)
    if found:
        raise ValueError(f"the digraph is not strongly connected: {found[0]}")
    size = digraph.agents
    rows = laplacian(digraph)
    columns = [[fmpq(rows[j][i].numerator, rows[j][i].denominator) for j in range(size)] for i in range(size - 1)]
    system = fmpq_mat([*columns, [fmpq(1)] * size])
    solution = system.solve(fmpq_mat([[fmpq(0)]] * (size - 1) + [[fmpq(1)]]))
    return tuple(Fraction(int(solution[i, 0].p), int(solution[i, 0].q)) for i in range(size))


def is_balanced(digraph: Digraph) -> bool:
    """Whether every agent's weights of incoming and outgoing edges have equal sums (``1ᵀL = 0``)."""
    surplus = [Fraction(0)] * digraph.agents
    for edge in digraph.edges:
        surplus[edge.target - 1] += edge.weight
        surplus[edge.source - 1] -= edge.weight
    return not any(surplus)
