"""What a verified certificate of the theorem direct/3 says in the user's coordinates, exact and on the safe side.

The tube's boxes hold from ``T1`` on and say nothing about the time before, so a bound of ``z̄`` or ``x̄`` for all time is
the largest over the boxes of phase 1, each of which holds on its step, the boxes of the tube and its tail
(docs/certificate-direct.md sections 4 to 6). Where the certificate knows a range of ``z`` itself on a step, ``z`` is in
both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Literal

import sympy

from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds
from certify.bounds.roots import root_brackets
from certify.bounds.suprema import range_bound
from certify.coordinator.envelope import AgentEnvelope, Envelope
from certify.statement.claim import CertifiedGains
from certify.statement.error_envelope import ErrorEnvelope, error_envelope
from certify.statement.input_bound import InputBound, input_bound
from certify.statement.tube import Tube
from symbolic.derivation import Derivation
from symbolic.plant import COST_VARIABLE, Agent, Interval, Plant
from symbolic.steady_state import SteadyState, root_symbol

Target = Literal["steady state", "reference", "origin"]
Box = Mapping[sympy.Symbol, Interval]


@dataclass(frozen=True)
class StateBound:
    """``state ∈ whole`` for all ``t ≥ 0``; its distance from its target is at most ``distance`` and, after the grid,
    ``later`` and decaying. The target of a zero state is ``z*``, of the output ``y^r``, of other states the origin."""

    state: sympy.Symbol
    target: Target
    whole: Interval
    distance: Fraction
    later: Fraction


@dataclass(frozen=True)
class AgentBounds:
    """One agent: its plant states, ``|y − s*|`` over time, its input, and the length ``T1`` of phase 1, in which
    the saturated feedback brings ``ϑ`` down (0 when nothing ever saturates)."""

    id: int
    states: tuple[StateBound, ...]
    error: ErrorEnvelope
    input: InputBound
    reaching: Fraction


@dataclass(frozen=True)
class ProvedBounds:
    """Bounds that hold for every start in the boxes of the plant file, every ``w`` and ``v(0)``."""

    agents: tuple[AgentBounds, ...]


def proved_bounds(
    plant: Plant, derivation: Derivation, certified: CertifiedGains, envelope: Envelope
) -> ProvedBounds | str:
    """The bounds that the certificate's boxes prove, or why they cannot be stated. The certificate must be verified."""
    disturbance = exosystem_bounds(plant.exosystem)
    if not isinstance(disturbance, ExosystemBounds):
        return f"no bounds of the exosystem: {disturbance.reason}"
    outside: dict[sympy.Symbol, Interval] = dict(zip(plant.exosystem.states, disturbance.sharp, strict=True))
    agents = []
    for agent, derived, claim, reference in zip(
        plant.agents, derivation.agents, certified.agents, envelope.agents, strict=True
    ):
        if claim.tube is None or not isinstance(derived.steady_state, SteadyState):
            return f"agent {agent.id} has no tube or no steady state"
        box = (
            outside | {COST_VARIABLE: certified.optimum} | dict(zip(agent.parameters, agent.parameter_box, strict=True))
        )
        roots = root_brackets(agent, derived.steady_state, certified.optimum)
        if isinstance(roots, str):
            return f"agent {agent.id}: {roots}"
        box |= {root_symbol(z): side for z, side in roots.items()}
        input_ = input_bound(agent, claim, claim.tube, derived.steady_state.u_star, box)
        if isinstance(input_, str):
            return input_
        agents.append(_agent(agent, derived.steady_state, input_, claim.tube, reference, envelope, box))
    return ProvedBounds(tuple(agents))


def _agent(
    agent: Agent,
    steady: SteadyState,
    input_: InputBound,
    tube: Tube,
    reference: AgentEnvelope,
    envelope: Envelope,
    box: Box,
) -> AgentBounds:
    zeros = len(agent.zero_states)
    error = error_envelope(tube, zeros, reference, envelope)
    states = [
        _zero_state(state, k, range_bound(value, box).interval, agent.initial.z, tube)
        for k, (state, value) in enumerate(zip(agent.zero_states, steady.z_star, strict=True))
    ]
    output, origin = agent.chain[0], Interval(Fraction(0), Fraction(0))
    states.append(_state(output, "reference", _around(box[COST_VARIABLE], error.peak), tube, zeros))
    for k, state in enumerate(agent.chain[1:], zeros + 1):
        states.append(_state(state, "origin", _around(origin, tube.furthest(k)), tube, k))
    return AgentBounds(agent.id, tuple(states), error, input_, reaching=tube.reaching.grid[-1])


def _zero_state(state: sympy.Symbol, k: int, steady: Interval, initial: Sequence[Interval], tube: Tube) -> StateBound:
    """``z_k ∈ z*_k ± ẑ_k`` on every step, and between its ranges at the two ends of the step where they are known."""
    around = [_around(steady, row[k]) for row in tube.states]
    ends = [initial[k], *(known[k] for known in tube.ranges)]
    for step, (before, after) in enumerate(pairwise(ends)):
        lo, hi = min(before.lo, after.lo), max(before.hi, after.hi)
        around[step] = Interval(max(around[step].lo, lo), min(around[step].hi, hi))
    whole = Interval(min(side.lo for side in around), max(side.hi for side in around))
    away = max(whole.hi - steady.lo, steady.hi - whole.lo)
    return StateBound(state, "steady state", whole, min(tube.furthest(k), away), tube.tail[k])


def _state(state: sympy.Symbol, target: Target, whole: Interval, tube: Tube, k: int) -> StateBound:
    return StateBound(state, target, whole, tube.furthest(k), tube.tail[k])


def _around(middle: Interval, radius: Fraction) -> Interval:
    return Interval(middle.lo - radius, middle.hi + radius)
