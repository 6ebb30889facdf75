"""Route "direct", agent by agent (theory.md section 6)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from certify.bounds.rationals import round_down, round_up
from certify.certificate import Json
from certify.preparation import Prepared
from certify.results import AgentResult, Alternative
from certify.tube.balance import balanced
from certify.tube.certificate import BOX_BITS, tube_controller, tube_witness
from certify.tube.largest_box import largest_box
from certify.tube.performance import Performances
from certify.tube.requirements import Descent, Missed, Wanted, explained, largest_h, meet
from certify.tube.search import Choice, NoChoice, nearest_gains, search_gains
from certify.tube.trial import AgentTrials, Trial
from certify.tube.words import in_words, short
from symbolic.controller import AgentController
from symbolic.plant import Agent, RequestedGains, Requirements


def tube_agent(
    prepared: Prepared, index: int, report: Callable[[str], None] = lambda message: None
) -> tuple[AgentResult, AgentController | None, Json | None]:
    """The result, controller and witness of one agent; the latter two are ``None`` when nothing passed."""
    derived, model = prepared.derivation.agents[index], prepared.models[index]
    linear = prepared.linear.get(derived.id)
    if isinstance(model, str):
        return AgentResult(derived.id, "inconclusive", model, linear=linear), None, None
    trials = AgentTrials(model, prepared.coordinator.envelope, index)

    def redesigned(agent: Agent) -> AgentTrials | None:
        other = prepared.redesigned(index, agent)
        return None if isinstance(other, str) else AgentTrials(other, prepared.coordinator.envelope, index)

    requested = prepared.plant.gains_of(derived.id)
    found = search_gains(trials, requested, report, redesigned)
    if isinstance(found, NoChoice):
        reason = found.reason + _nearest(trials, requested, report)
        return AgentResult(derived.id, "inconclusive", reason, linear=linear), None, None
    asked = prepared.plant.requirements_of(derived.id)
    if replace(asked, region=None) != Requirements():
        met = _meeting(trials, found, prepared, index, asked, report)
        if isinstance(met, str):
            return AgentResult(derived.id, "inconclusive", met, linear=linear), None, None
        found = (met, *(choice for choice in found if choice.trial is not met.trial))
    elif requested.K is None and requested.h is None:
        own = _own(trials, found[0].trial, prepared, index)
        trial, reason = balanced(own, found[0].trial, requested, report)
        least = Choice("least gains", found[0].reason, found[0].trial)
        found = (Choice("balanced", reason, trial), *([least] if trial is not least.trial else []), *found[1:])
    if asked.region is not None:
        own = _own(trials, found[0].trial, prepared, index)
        largest = largest_box(own, found[0].trial, requested, asked, report)
        reason = f"the initial box may grow to {float(largest.factor):.3g} times its size with these gains"
        found = (Choice("largest region", reason, largest.trial), *found)
    default = _coarsened(trials, found[0].trial, prepared, index, asked)
    controller = tube_controller(default)
    peak = [round_up(Fraction(float(value)), BOX_BITS) for value in _peak(default)]
    names = [str(z) for z in model.agent.zero_states] + [str(x) for x in model.agent.chain] + ["vartheta", "input"]
    rate = round_down(Fraction(default.tube.tail_rate), BOX_BITS)
    thresholds = {"g": controller.g, "K": controller.K, "delta": controller.delta, "rate": rate}
    thresholds["T"] = Fraction(default.reached.duration)
    if controller.h is not None:
        thresholds["h"] = controller.h
    result = AgentResult(
        derived.id,
        "certified",
        found[0].reason,
        thresholds={**thresholds, "level": peak[len(names) - 2]},
        linear=linear,
        bounds=dict(zip(names, peak, strict=False)),
        alternatives=tuple(
            Alternative(choice.label, choice.reason, tube_controller(choice.trial)) for choice in found[1:]
        ),
    )
    return result, controller, tube_witness(default)


def _meeting(
    trials: AgentTrials,
    found: Sequence[Choice],
    prepared: Prepared,
    index: int,
    asked: Requirements,
    report: Callable[[str], None],
) -> Choice | str:
    """Gains that meet the requirements, or what stands in the way."""
    requested, descents = prepared.plant.gains_of(prepared.derivation.agents[index].id), list[tuple[Descent, Trial]]()
    for choice in found:
        own = _own(trials, choice.trial, prepared, index)
        performances = Performances(own.model, own.surroundings)
        cap = largest_h(performances, asked)
        descents.append((Descent(own, performances, requested, report, cap), choice.trial))
    result = meet(descents, asked, report)
    if isinstance(result, Missed):
        return explained(result, asked)
    return Choice("required", "meets the requirements", result.trial)


def _own(trials: AgentTrials, trial: Trial, prepared: Prepared, index: int) -> AgentTrials:
    """Those of the trial's design."""
    return trials if trial.model is trials.model else AgentTrials(trial.model, prepared.coordinator.envelope, index)


def _coarsened(trials: AgentTrials, trial: Trial, prepared: Prepared, index: int, asked: Requirements) -> Trial:
    own = _own(trials, trial, prepared, index)
    coarse = own.coarsened(trial)
    wanted = Wanted(asked)
    return trial if wanted.missed(Performances(own.model, own.surroundings).of(coarse)) else coarse


def _peak(trial: Trial) -> np.ndarray:
    """The largest bounds of ``z̄, x̄`` over both phases; of ``ϑ̃`` and ``υ`` from ``T1`` on, where they are outputs."""
    peak = trial.tube.peak.copy()
    states = len(peak) - 2
    for box in trial.reached.boxes:
        peak[:states] = np.maximum(peak[:states], box.flat[:states])
    return peak


def _nearest(trials: AgentTrials, requested: RequestedGains, report: Callable[[str], None]) -> str:
    """What would work instead of requested gains that do not pass."""
    if requested == RequestedGains():
        return ""
    near = nearest_gains(trials, requested, report)
    if near is None:
        return "; no other gains were found that pass"
    units = near.model.units
    return f"; the nearest gains that pass: {in_words(near.gains, units)}, delta = {short(near.delta * units.input)}"
