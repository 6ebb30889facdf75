"""The largest gains that a simulation refutes: what tightness is measured from below.

Bisection on the logarithm of one gain, each value judged by the falsifier. Below the gain that is found there is a
confirmed counterexample; above it none was found with the same budget. Stability need not be monotone in a gain, so the
bracket says what was seen at its two ends and no more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

from sims.falsifier import Progress, falsify
from sims.witness import Witness
from symbolic.controller import AgentController, Controller
from symbolic.errors import InputError
from symbolic.plant import Plant


@dataclass(frozen=True)
class CriticalGain:
    """``falsified`` has the counterexample ``witness``; ``surviving`` (at most ``1 + accuracy`` times as large) has
    none among the ``trajectories`` tried in all. ``None`` where the range given had no such gain.
    """

    agent: int
    gain: str
    falsified: Fraction | None
    surviving: Fraction | None
    witness: Witness | None
    trajectories: int


def critical_K(
    plant: Plant,
    controller: Controller,
    agent: int,
    low: Fraction,
    high: Fraction,
    *,
    accuracy: Fraction = Fraction(1, 20),
    budget: int = 200,
    seed: int = 0,
    compiled: bool = False,
    progress: Progress | None = None,
) -> CriticalGain:
    """The largest falsified ``K`` of one agent between ``low`` and ``high`` at the controller's ratio ``h/K``.

    ``δ/K`` is kept too, so that the saturation stays where it is. ``compiled`` is as for ``falsify``. Raises
    ``InputError`` for a range that does not fit.
    """
    law = controller.agents[agent - 1]

    def at(K: Fraction) -> AgentController:
        factor = K / law.K
        return replace(law, K=K, h=None if law.h is None else law.h * factor, delta=law.delta * factor)

    return _bisect(plant, controller, agent, "K", at, (low, high), accuracy, budget, seed, compiled, progress)


def critical_h(
    plant: Plant,
    controller: Controller,
    agent: int,
    low: Fraction,
    high: Fraction,
    *,
    accuracy: Fraction = Fraction(1, 20),
    budget: int = 200,
    seed: int = 0,
    compiled: bool = False,
    progress: Progress | None = None,
) -> CriticalGain:
    """The largest falsified ``h`` of one agent between ``low`` and ``high``, the other gains fixed."""
    law = controller.agents[agent - 1]
    if law.h is None:
        raise InputError(f"agent {agent} has no observer, so no h")
    return _bisect(
        plant,
        controller,
        agent,
        "h",
        lambda h: replace(law, h=h),
        (low, high),
        accuracy,
        budget,
        seed,
        compiled,
        progress,
    )


def _bisect(
    plant: Plant,
    controller: Controller,
    agent: int,
    gain: str,
    at: Callable[[Fraction], AgentController],
    ends: tuple[Fraction, Fraction],
    accuracy: Fraction,
    budget: int,
    seed: int,
    compiled: bool,
    progress: Progress | None,
) -> CriticalGain:
    low, high = ends
    if not 0 < low < high or accuracy <= 0:
        raise InputError("a search for a gain needs 0 < low < high and an accuracy > 0")
    say = progress or (lambda message: None)
    spent = 0

    def broken(value: Fraction) -> Witness | None:
        nonlocal spent
        laws = (*controller.agents[: agent - 1], at(value), *controller.agents[agent:])
        changed = replace(controller, agents=laws)
        found = falsify(plant, changed, budget=budget, seed=seed, agents=[agent], compiled=compiled)
        spent += found.trajectories
        say(f"agent {agent}: {gain} = {float(value):.4g} {found.status}")
        return found.witness

    witness = broken(low)
    if witness is None:
        return CriticalGain(agent, gain, None, low, None, spent)
    at_high = broken(high)
    if at_high is not None:
        return CriticalGain(agent, gain, high, None, at_high, spent)
    while high > low * (1 + accuracy):
        middle = Fraction(math.sqrt(float(low) * float(high))).limit_denominator(1000)
        found = broken(middle)
        if found is None:
            high = middle
        else:
            low, witness = middle, found
    return CriticalGain(agent, gain, low, high, witness, spent)
