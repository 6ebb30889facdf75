"""How far the references are from the optimum, for all time: docs/certificate.md section 2, docs/coordinator.md."""

from __future__ import annotations

from certify.checker.certificate import Certificate, HeldWitness
from certify.checker.plant import Plant
from certify.checker.rules import held, printed
from certify.checker.rules.assumptions import Facts
from certify.checker.rules.reference import AgentEnvelope
from certify.checker.verdict import obligation, require


def prove(plant: Plant, certificate: Certificate, facts: Facts) -> tuple[AgentEnvelope, ...]:
    """The envelopes of all agents. Raises ``Rejected``."""
    claim, witness = certificate.claim, certificate.witness.coordinator
    gains = (claim.alpha1, claim.alpha2, claim.gradient_gain, claim.mixing_gain)
    require(min(gains) > 0, "coordinator: α1, α2, κ, β > 0", gains=gains)
    times = (claim.mixing_time, claim.softening)
    require(min(times) >= 0, "coordinator: t_mix, ν ≥ 0", times=times)
    require((claim.mixing_time > 0) == isinstance(witness, HeldWitness), "coordinator: held exactly if t_mix > 0")
    with obligation("coordinator"):
        if isinstance(witness, HeldWitness):
            return held.envelopes(plant, claim, witness, facts)
        return printed.envelopes(plant, claim, witness, facts)
