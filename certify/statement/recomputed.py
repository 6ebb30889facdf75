"""The coordinator's envelope once more, from the witness of a verified certificate: nothing is searched."""

from __future__ import annotations

from certify.coordinator.design import gradients_at
from certify.coordinator.envelope import Comparison, Envelope, envelope
from certify.coordinator.mixing import mixing
from certify.coordinator.nominal import CoordinatorModel, cost_gradient
from certify.coordinator.stability import damping_ranges
from certify.curvature import Curvature, cost_curvature
from certify.statement.claim import CertifiedGains
from symbolic.network import laplacian, left_null_vector
from symbolic.plant import Interval, Plant


def coordinator_envelope(plant: Plant, certified: CertifiedGains) -> Envelope | str:
    """``|y^r − s*|`` and ``|ẏ^r|`` over time (docs/certificate.md section 2), or why not.

    The inequalities behind ``P``, the multiplier and the rates are the checker's to prove; they are taken as proved.
    """
    L, r = laplacian(plant.digraph), left_null_vector(plant.digraph)
    costs = tuple(cost_gradient(agent.cost) for agent in plant.agents)
    curvatures = []
    for agent in plant.agents:
        found = cost_curvature(agent.cost)
        if not isinstance(found, Curvature):
            return f"agent {agent.id}: the curvature of its cost is not bounded"
        curvatures.append(Interval(found.lower, found.upper))
    witness = certified.coordinator
    grid = mixing(L, r, witness["step"], int(witness["steps"]))
    return envelope(
        CoordinatorModel(L, r, certified.alpha1, certified.alpha2, costs),
        grid,
        Comparison(
            certified.P, certified.multiplier, witness["rate"], witness["mixing_rate"], damping_ranges(grid, curvatures)
        ),
        certified.optimum,
        gradients_at(costs, certified.optimum),
        [agent.initial.reference for agent in plant.agents],
    )
