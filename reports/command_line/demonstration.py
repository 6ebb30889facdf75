"""A controller of moderate gains to look at a plant with. Nothing is certified about it."""

from __future__ import annotations

from fractions import Fraction

from certify.coordinator.design import proposed_gains
from certify.float_range import float_range
from certify.gains.requested import requested_controller
from symbolic.controller import Controller
from symbolic.derivation import Derivation
from symbolic.errors import InputError
from symbolic.plant import Plant, RequestedGains

# moderate gains that settle the example (theory.md section 7, scale of the recipe), where the plant file fixes none
MODERATE = RequestedGains(g=Fraction(5), K=Fraction(100), delta=Fraction(1000), h=Fraction(500))


def demonstration_controller(plant: Plant, derivation: Derivation) -> Controller:
    """The plant file's gains, and moderate ones where it fixes none. Nothing is proved about them."""
    laws = []
    for derived in derivation.agents:
        given = plant.gains_of(derived.id)
        gains = RequestedGains(
            given.g or MODERATE.g, given.K or MODERATE.K, given.delta or MODERATE.delta, given.h or MODERATE.h
        )
        law = requested_controller(derived, gains)
        if law is None:
            raise InputError(f"agent {derived.agent.id}: its internal model is not rational, so it cannot be simulated")
        laws.append(law)
    with float_range():
        return Controller(proposed_gains(plant), tuple(laws))
