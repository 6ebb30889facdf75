"""The coordinator's envelope once more, from the witness of a certificate: nothing is searched."""

from __future__ import annotations

from certify.coordinator.envelope import Envelope
from certify.coordinator.proved import proved_envelope
from certify.statement.claim import CertifiedGains
from symbolic.plant import Plant


def coordinator_envelope(plant: Plant, certified: CertifiedGains) -> Envelope | str:
    """``|y^r − s*|`` and ``|ẏ^r|`` over time (docs/coordinator.md), by the rule of the checker, or why not."""
    witness = certified.coordinator_witness
    return proved_envelope(plant, certified.coordinator, witness, certified.left_null_vector, certified.optimum)
