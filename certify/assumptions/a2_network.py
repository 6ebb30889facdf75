"""A2: the digraph is strongly connected (paper, Assumption 2)."""

from __future__ import annotations

from certify.assumptions.findings import Finding
from symbolic.network import cuts, left_null_vector, strongly_connected_components
from symbolic.plant import Digraph

LARGEST_EXACT_NETWORK = 300


def check_network(digraph: Digraph) -> Finding:
    """Decide strong connectivity. Evidence: the left null vector ``r`` (``rᵀL = 0``, ``Σ r_i = 1``), or the cuts.

    ``r`` is left out for more than ``LARGEST_EXACT_NETWORK`` agents, where its exact entries outgrow any page.
    """
    found = cuts(digraph)
    if found:
        components = strongly_connected_components(digraph)
        return Finding(
            "A2",
            None,
            "fails",
            f"the digraph is not strongly connected, it has {len(components)} components: {found[0]}",
            {
                "components": [list(component) for component in components],
                "cuts": [{"agents": list(cut.component), "hears_nobody": cut.hears_nobody} for cut in found],
            },
        )
    evidence = {}
    if digraph.agents <= LARGEST_EXACT_NETWORK:
        evidence["r"] = [str(entry) for entry in left_null_vector(digraph)]
    return Finding("A2", None, "holds", "the digraph is strongly connected", evidence)
