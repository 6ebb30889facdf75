"""What a verified certificate of the theorem direct/1 says in the user's coordinates, exact and on the safe side.

The tube's boxes hold from ``t = 0`` on for ``z̄``, ``x̄`` and ``Ψη̄``: in phase 1 their magnitudes only grow, and the
kernels' majorants at their start are at least 1, so the first box of the tube bounds the end of phase 1 and with it
all of it (docs/certificate-direct.md sections 4, 5). ``ϑ̃`` is bounded from ``T1`` on; before, ``|ū| ≤ δ`` is all there
is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

import sympy

from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds
from certify.bounds.suprema import magnitude_bound, range_bound
from certify.coordinator.envelope import AgentEnvelope, Envelope
from reports.certificate_view import AgentClaim, CertifiedGains
from reports.error_envelope import ErrorEnvelope, error_envelope
from reports.tube_view import Tube
from symbolic.derivation import Derivation
from symbolic.plant import COST_VARIABLE, Agent, Interval, Plant
from symbolic.steady_state import SteadyState

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
class InputBound:
    """``|u| ≤ saturation + internal + steady`` for all time: ``|ū| ≤ δ``, ``|Ψη̄|``, ``|u*(s*, v, w)|``.

    ``after`` bounds ``|u|`` from ``T1`` on, where ``|ū| = |Kϑ̃|`` follows the tube.
    """

    saturation: Fraction
    internal: Fraction
    steady: Fraction
    after: Fraction

    @property
    def peak(self) -> Fraction:
        return self.saturation + self.internal + self.steady


@dataclass(frozen=True)
class AgentRegion:
    """One agent: its plant states, ``|y − s*|`` over time, its input, the length ``T1`` of the peaking phase."""

    id: int
    states: tuple[StateBound, ...]
    error: ErrorEnvelope
    input: InputBound
    peaking: Fraction


@dataclass(frozen=True)
class Region:
    """Bounds that hold for every start in the boxes of the plant file, every ``w`` and ``v(0)``."""

    agents: tuple[AgentRegion, ...]


def region(plant: Plant, derivation: Derivation, certified: CertifiedGains, envelope: Envelope) -> Region | str:
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
        agents.append(_agent(agent, derived.steady_state, claim, claim.tube, reference, envelope, box))
    return Region(tuple(agents))


def _agent(
    agent: Agent,
    steady: SteadyState,
    claim: AgentClaim,
    tube: Tube,
    reference: AgentEnvelope,
    envelope: Envelope,
    box: Box,
) -> AgentRegion:
    zeros, outputs = len(agent.zero_states), tube.outputs
    error = error_envelope(tube, zeros, reference, envelope)
    states = [
        _around(state, "steady state", range_bound(value, box).interval, tube, k)
        for k, (state, value) in enumerate(zip(agent.zero_states, steady.z_star, strict=True))
    ]
    states.append(_around(agent.chain[0], "reference", box[COST_VARIABLE], tube, zeros, error.peak))
    for k, state in enumerate(agent.chain[1:], 1):
        states.append(_around(state, "origin", Interval(Fraction(0), Fraction(0)), tube, zeros + k))
    estimate = zeros + agent.order
    internal = tube.peak(estimate + 1) if outputs > estimate + 1 else Fraction(0)
    target_input = magnitude_bound(steady.u_star, box).value
    after = max(
        claim.K * row[estimate] + (row[estimate + 1] if outputs > estimate + 1 else 0)
        for row in (*tube.boxes, tube.tail)
    )
    return AgentRegion(
        id=agent.id,
        states=tuple(states),
        error=error,
        input=InputBound(claim.delta, internal, target_input, after + target_input),
        peaking=tube.duration,
    )


def _around(
    state: sympy.Symbol, target: Target, middle: Interval, tube: Tube, output: int, radius: Fraction | None = None
) -> StateBound:
    distance = tube.peak(output)
    reach = distance if radius is None else radius
    return StateBound(state, target, Interval(middle.lo - reach, middle.hi + reach), distance, tube.tail[output])
