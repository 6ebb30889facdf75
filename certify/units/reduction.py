"""The search of one agent in its natural units, as a reduction: the network as that agent sees it in them, and what
comes out of the search in the units of the plant file again (docs/units.md)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

from certify.agent_model import AgentModel
from certify.certificate import Json
from certify.preparation import Prepared
from certify.results import AgentResult
from certify.units.apply import scaled_envelope, scaled_gains, scaled_model, scaled_pair, scaled_requirements
from certify.units.invert import controller_back, result_back, witness_back
from certify.units.natural import natural_scales
from certify.units.scales import Scales
from symbolic.controller import AgentController
from symbolic.design import companion_pair
from symbolic.plant import Agent

Outcome = tuple[AgentResult, AgentController | None, Json | None]
Search = Callable[[Prepared, int], Outcome]


def search_in_natural_units(prepared: Prepared, index: int, search: Search) -> Outcome:
    """What ``search`` finds for agent ``index`` when it is shown the network in that agent's units."""
    model = prepared.models[index]
    if isinstance(model, str):
        return search(prepared, index)
    scales = natural_scales(model, prepared.coordinator.envelope, index)
    if scales.is_trivial:
        return search(prepared, index)
    scaled = scaled_network(prepared, index, scales)
    return scaled.back(*search(scaled, index))


@dataclass(frozen=True)
class ScaledNetwork(Prepared):
    """A network in the units of its agent ``index``: that agent's part is transformed, nobody looks at the others'.
    ``user`` is the same network in the units of its file."""

    user: Prepared
    index: int
    scales: Scales

    def redesigned(self, index: int, agent: Agent) -> AgentModel | str:
        """As of any network; ``agent`` is in these units. A pair ``(M, N)`` that it leaves open gets the poles
        ``−1, −2, …`` in them."""
        own = self.user.models[self.index]
        assert index == self.index and isinstance(own, AgentModel)
        pair = agent.internal_model or companion_pair(own.internal_model.order)
        pair_back = scaled_pair(pair, self.scales.rate) if own.internal_model.order else None
        user_agent = replace(own.agent, observer=agent.observer, gamma=agent.gamma, internal_model=pair_back)
        found = self.user.redesigned(index, user_agent)
        if isinstance(found, str):
            return found
        scaled = scaled_model(found, self.scales)
        return replace(scaled, agent=replace(scaled.agent, internal_model=agent.internal_model))

    def back(self, result: AgentResult, controller: AgentController | None, witness: Json | None) -> Outcome:
        """The same in the user's units."""
        own = self.user.models[self.index]
        assert isinstance(own, AgentModel)
        return (
            result_back(result, self.scales),
            None if controller is None else controller_back(controller, self.scales),
            None if witness is None else witness_back(witness, own, self.scales),
        )


def scaled_network(user: Prepared, index: int, scales: Scales) -> ScaledNetwork:
    """``user.models[index]`` is a model."""
    model = user.models[index]
    assert isinstance(model, AgentModel)
    agents = range(1, len(user.models) + 1)
    plant = replace(
        user.plant,
        gains=tuple(scaled_gains(user.plant.gains_of(k), scales) for k in agents),
        requirements=tuple(scaled_requirements(user.plant.requirements_of(k), scales) for k in agents),
    )
    own = {field.name: getattr(user, field.name) for field in fields(Prepared)} | {
        "plant": plant,
        "coordinator": replace(user.coordinator, envelope=scaled_envelope(user.coordinator.envelope, index, scales)),
    }
    network = ScaledNetwork(**own, user=user, index=index, scales=scales)
    default = scaled_model(model, scales)
    if scales.time != 1 and model.internal_model.order and model.agent.internal_model is None:
        faster = network.redesigned(index, default.agent)
        default = default if isinstance(faster, str) else faster
    models = tuple(default if k == index else other for k, other in enumerate(user.models))
    return replace(network, models=models)
