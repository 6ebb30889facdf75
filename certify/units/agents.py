"""One agent in its natural units, to try gains that are given: the trials, and the way back to the user's units
(docs/units.md)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from certify.agent_model import AgentModel
from certify.certificate import Json
from certify.preparation import Prepared
from certify.tube.certificate import tube_controller, tube_witness
from certify.tube.loop import LoopGains
from certify.tube.trial import AgentTrials, Trial
from certify.units.apply import scaled_gains
from certify.units.invert import controller_back, witness_back
from certify.units.natural import natural_scales
from certify.units.reduction import scaled_network
from certify.units.scales import Scales
from symbolic.controller import AgentController
from symbolic.plant import RequestedGains, Requirements


@dataclass(frozen=True)
class NaturalAgent:
    """``trials``, ``requested`` and ``asked`` are in the natural units, ``user`` is the model in those of the file."""

    trials: AgentTrials
    requested: RequestedGains
    asked: Requirements
    scales: Scales
    user: AgentModel

    def gains(self, given: RequestedGains) -> tuple[LoopGains, Fraction]:
        """Of the user's gains, of which ``K`` and ``delta`` are there."""
        own = scaled_gains(given, self.scales)
        assert own.K is not None and own.delta is not None
        return LoopGains(own.g or Fraction(1), own.K, own.h), own.delta

    def parts(self, trial: Trial) -> tuple[AgentController, Json]:
        """Controller and witness of a trial in the user's units."""
        witness = witness_back(tube_witness(trial), self.user, self.scales)
        return controller_back(tube_controller(trial), self.scales), witness


def natural_agent(prepared: Prepared, index: int) -> NaturalAgent | str:
    """Agent ``index`` (from 0), or why it has no model."""
    model = prepared.models[index]
    if isinstance(model, str):
        return model
    scales = natural_scales(model, prepared.coordinator.envelope, index)
    network = scaled_network(prepared, index, scales)
    own = network.models[index]
    assert isinstance(own, AgentModel)
    trials = AgentTrials(own, network.coordinator.envelope, index)
    plant = network.plant
    return NaturalAgent(trials, plant.gains_of(index + 1), plant.requirements_of(index + 1), scales, model)
