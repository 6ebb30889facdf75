"""What the checker proves of a coordinator, as the agents' search and the report take it (docs/coordinator.md)."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache

from certify.checker.certificate import Claim, CoordinatorWitness, HeldWitness
from certify.checker.intervals import Interval as CheckedInterval
from certify.checker.intervals import between
from certify.checker.plant import Plant as CheckedPlant
from certify.checker.plant import read_plant
from certify.checker.rules import held, printed
from certify.checker.rules.assumptions import Facts
from certify.checker.rules.costs import Cost, prove_cost, prove_optimum
from certify.checker.rules.reference import AgentEnvelope as ProvedEnvelope
from certify.checker.verdict import Rejected, Undecided, allow_for, start_meter
from certify.coordinator.envelope import AgentEnvelope, Envelope
from symbolic.controller import CoordinatorGains
from symbolic.plant import Interval, Plant

UNIT = Fraction(1, 1 << 128)  # of the checker's steps of a reference


def proved_envelope(
    plant: Plant, gains: CoordinatorGains, witness: CoordinatorWitness, r: Sequence[Fraction], optimum: Interval
) -> Envelope | str:
    """The envelope by the rule of the checker, or the obligation that fails."""
    start_meter()
    try:
        allow_for(len(plant.agents))
        model, costs, slopes = _known(plant.source, optimum)
        claim = Claim(model.sha256, **gains.named, agents=())
        facts = Facts(tuple(r), costs, between(optimum.lo, optimum.hi), slopes, {}, {}, ())
        if isinstance(witness, HeldWitness):
            return _envelope(held.envelopes(model, claim, witness, facts))
        return _envelope(printed.envelopes(model, claim, witness, facts))
    except (Rejected, Undecided) as reason:
        return str(reason)
    finally:
        start_meter()


@lru_cache(maxsize=4)
def _known(source: bytes, optimum: Interval) -> tuple[CheckedPlant, tuple[Cost, ...], tuple[CheckedInterval, ...]]:
    """What no choice of the coordinator changes: the plant as the checker reads it, A1, and ``c_i'(s*)``."""
    model = read_plant(source)
    costs = tuple(prove_cost(agent) for agent in model.agents)
    return model, costs, prove_optimum(costs, optimum.lo, optimum.hi)


def _envelope(proved: Sequence[ProvedEnvelope]) -> Envelope:
    agents = []
    for agent in proved:
        reference = agent.reference
        tail_rate = reference.tail_speed.hi
        agents.append(
            AgentEnvelope(
                reference=tuple(Interval(step.low * UNIT, step.high * UNIT) for step in reference.steps),
                deviation=tuple(step.distance * UNIT for step in reference.steps),
                rate=tuple(step.speed * UNIT for step in reference.steps),
                tail_deviation=reference.tail_distance.hi,
                tail_rate=tail_rate,
                peak=agent.peak.hi,
                rate_peak=max([*(step.speed * UNIT for step in reference.steps), tail_rate]),
                energy=agent.energy.hi,
                rate_energy=agent.speed_energy.hi,
            )
        )
    first = proved[0].reference
    return Envelope(tuple(first.times), first.tail_rate, tuple(agents))
