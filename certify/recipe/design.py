"""One agent through the recipe: level, constants, thresholds, gains (theory.md section 5)."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from certify.agent_model import AgentModel, LyapunovMatrices
from certify.recipe.levels import Level, NoLevel, find_level
from certify.recipe.thresholds import OutputFeedback, StateFeedback, output_feedback, state_feedback
from symbolic.controller import AgentController
from symbolic.plant import RequestedGains


@dataclass(frozen=True)
class AgentRecipe:
    """A certified agent: its controller, the level it lives on and everything that was bounded on the way."""

    controller: AgentController
    level: Level
    feedback: StateFeedback
    output: OutputFeedback
    matrices: LyapunovMatrices

    @property
    def constants(self) -> dict[str, Fraction]:
        """``ς1 … ς11``, the Jacobian bounds and the weights, by name."""
        found = self.level.found
        named = {f"varsigma{k}": value for k, value in found.varsigma.items()}
        named |= {"F_z": found.f_z, "F_x": found.f_x, "F_vartheta": found.f_vartheta, "F_reference": found.f_reference}
        return named | {"weight_eta": found.weight_eta, "weight_vartheta": found.weight_vartheta}


@dataclass(frozen=True)
class AgentInconclusive:
    """No certificate for this agent by this route; ``reason`` names what stands in the way."""

    id: int
    reason: str
    evidence: dict[str, str] = field(default_factory=dict)


SLACKS = (Fraction(1), Fraction(1, 4), Fraction(1, 16))


def design_agent(
    model: AgentModel, matrices: LyapunovMatrices, requested: RequestedGains
) -> AgentRecipe | AgentInconclusive:
    """Gains for one agent, or those requested, certified; the requested ones are kept exactly."""
    reasons = []
    for slack in SLACKS:
        level = find_level(model, matrices, g=requested.g, slack_ratio=slack)
        if isinstance(level, NoLevel):
            reasons.append(level.reason)
            continue
        feedback = state_feedback(model, matrices, level, requested.K)
        if isinstance(feedback, str):
            reasons.append(feedback)
            continue
        output = output_feedback(model, matrices, level, feedback, requested.delta, requested.h)
        if isinstance(output, str):
            reasons.append(output)
            continue
        return AgentRecipe(_controller(model, level, feedback, output), level, feedback, output, matrices)
    return AgentInconclusive(model.agent.id, reasons[0])


def _controller(model: AgentModel, level: Level, feedback: StateFeedback, output: OutputFeedback) -> AgentController:
    im = model.internal_model
    return AgentController(
        id=model.agent.id,
        gamma=model.gamma,
        observer=model.observer if model.order > 1 else (),
        M=im.M,
        N=im.N,
        psi=im.psi,
        g=level.found.g,
        K=feedback.K,
        delta=output.delta,
        h=output.h,
    )
