"""The rule for one agent of a certificate of the theorem direct/3 (docs/certificate-direct.md)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import pairwise

from certify.checker.certificate import MAX_STATES, AgentClaim, DirectAgentClaim, DirectAgentWitness
from certify.checker.linear import Row
from certify.checker.plant import Agent
from certify.checker.rules import kernels, loop, requirements, tube
from certify.checker.rules.assumptions import AgentFacts
from certify.checker.rules.first_phase import FirstPhase
from certify.checker.rules.increments import Increments
from certify.checker.rules.observer import Table
from certify.checker.rules.reference import Reference
from certify.checker.rules.surroundings import Exosystem, Outside
from certify.checker.rules.zero_ranges import ZeroRanges
from certify.checker.verdict import Malformed, obligation, require


def prove_design(agent: Agent, claim: AgentClaim, witness: DirectAgentWitness) -> None:
    """What can be decided from the design alone: sizes, signs and kernels. Raises ``Rejected``."""
    name = f"agent {agent.id}"
    _sizes(name, agent, claim, witness)
    require(claim.g > 0 and claim.K > 0 and claim.delta > 0, f"{name}: g, K, δ > 0", g=claim.g, K=claim.K)
    require(claim.h is None or claim.h > 0, f"{name}: h > 0", h=claim.h)
    require(all(gamma >= 0 for gamma in claim.gamma), f"{name}: γ ≥ 0", gamma=claim.gamma)
    require(witness.nominal.b > 0, f"{name}: nominal b > 0", b=witness.nominal.b)
    _order(name, witness)
    with obligation(name):
        kernels.prove(name, loop.build(agent, claim, witness), witness)


def prove_tube(
    agent: Agent,
    claim: DirectAgentClaim,
    witness: DirectAgentWitness,
    reference: Reference,
    exosystem: Exosystem,
    known: AgentFacts,
    tabulate: Callable[[Row], Table],
) -> None:
    """From the initial set on, for ever. Raises ``Rejected``."""
    name = f"agent {agent.id}"
    require(witness.grid[-1] >= reference.end, f"{name}: t_m ≥ T0", t_m=witness.grid[-1], T0=reference.end)
    with obligation(name):
        outside = Outside(exosystem, reference, known.steady_nodes, agent.parameters, known.roots)
        increments = Increments(agent, reference.optimum, known.w, ZeroRanges(name, agent, witness.ranges))
        phase = FirstPhase(name, agent, claim, witness, known, outside, increments, tabulate)
        start = phase.at_end()
        tube.prove(name, loop.build(agent, claim, witness), claim, witness, known.b, outside, increments, start)
        requirements.prove(name, agent, claim, witness, known, outside, phase.inputs)


def _sizes(name: str, agent: Agent, claim: AgentClaim, witness: DirectAgentWitness) -> None:
    """Every list is as long as the agent's order, its zero states and its internal model say. Raises ``Malformed``."""
    n, nz, s, m, phase = agent.order, len(agent.zero_states), len(witness.ell), len(witness.rates), witness.phase1
    size, outputs, steps = loop.size_of(agent, s), nz + n + 2, len(phase.boxes) + len(witness.boxes)
    if size > MAX_STATES:
        raise Malformed(f"{name}: at most {MAX_STATES} states")
    lengths = [
        (claim.gamma, n - 1),
        (claim.observer, n if n > 1 else 0),
        (claim.M, s),
        (claim.N, s),
        (claim.psi, s),
        *((row, s) for row in claim.M),
        (witness.steady_state, nz),
        (witness.nominal.f0, nz),
        *((row, nz + 1) for row in witness.nominal.f0),
        (witness.nominal.f1, nz + n),
        (witness.modes, size),
        *((row, size) for row in witness.modes),
        (witness.kernels, outputs),
        *((columns, nz + 2 + size) for columns in witness.kernels),
        *((entry, m) for columns in witness.kernels for entry in columns),
        (phase.boxes, len(phase.grid) - 1),
        *((box, nz + n + 1 + s) for box in phase.boxes),
        (phase.vartheta, len(phase.boxes)),
        *((ends, nz) for ends in witness.ranges),
        *((ends, 2) for step in witness.ranges for ends in step),
        (witness.boxes, len(witness.grid) - 1),
        *((box, outputs) for box in witness.boxes),
        (witness.tail.box, outputs),
    ]
    if any(len(entries) != length for entries, length in lengths) or not m or sum(witness.blocks) != size:
        raise Malformed(f"{name}: a matrix or a list has the wrong size")
    if len(witness.ranges) > (steps if nz else 0):
        raise Malformed(f"{name}: ranges of zero states, one entry per step at most")
    if (claim.h is None) != (n == 1):
        raise Malformed(f"{name}: h belongs to orders from 2 on, and to all of them")


def _order(name: str, witness: DirectAgentWitness) -> None:
    """Rates and times grow, boxes are not negative, ranges are not empty."""
    rates, grid, phase = witness.rates, witness.grid, witness.phase1
    require(rates[0] > 0 and _increases(rates), f"{name}: 0 < μ_1 < … < μ_m", rates=rates)
    require(phase.grid[0] == 0 and _increases(phase.grid), f"{name}: phase 1: 0 = t_0 < t_1 < …")
    require(grid[0] == phase.grid[-1], f"{name}: t_0 = T1", t_0=grid[0], T1=phase.grid[-1])
    require(_increases(grid), f"{name}: t_0 < t_1 < …")
    least = min(entry for box in (*witness.boxes, witness.tail.box, *phase.boxes, phase.vartheta) for entry in box)
    require(least >= 0, f"{name}: boxes ≥ 0", least=least)
    require(all(lo <= hi for step in witness.ranges for lo, hi in step), f"{name}: ranges: lo ≤ hi")


def _increases(entries: Sequence[Fraction]) -> bool:
    return all(a < b for a, b in pairwise(entries))
