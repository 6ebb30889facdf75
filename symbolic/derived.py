"""What is derived from a plant before any gain is chosen, as frozen values."""

from __future__ import annotations

import re
from dataclasses import dataclass

import sympy

from symbolic.answers import Answer
from symbolic.coordinates import ErrorSystem
from symbolic.design import DesignPolynomials
from symbolic.internal_model import InternalModel, NoInternalModel
from symbolic.named_equations import NamedEquations
from symbolic.plant import Agent, Exosystem
from symbolic.steady_state import NoSteadyState, SteadyState


@dataclass(frozen=True)
class AgentDerivation:
    """What was derived for one agent; without a steady state or internal model the later parts are ``None``.

    ``equations`` is the error system for a reader, ``coordinates`` the one for computing.
    """

    agent: Agent
    steady_state: SteadyState | NoSteadyState
    internal_model: InternalModel | NoInternalModel | None
    design: DesignPolynomials
    coordinates: ErrorSystem | None
    equations: NamedEquations | None

    @property
    def id(self) -> int:
        return self.agent.id

    @property
    def verdict(self) -> str:
        """``holds``, or that of the first step that did not succeed."""
        for part in (self.steady_state, self.internal_model):
            if isinstance(part, NoSteadyState | NoInternalModel):
                return part.verdict
        return "holds"


@dataclass(frozen=True, repr=False)
class Derivation(Answer):
    """``types``: ids of agents whose derived equations coincide (their parameter boxes may differ)."""

    plant: str
    s_star: sympy.Expr
    exosystem: Exosystem
    agents: tuple[AgentDerivation, ...]
    types: tuple[tuple[int, ...], ...]

    @property
    def verdict(self) -> str:
        verdicts = {agent.verdict for agent in self.agents}
        return next((verdict for verdict in ("fails", "unknown") if verdict in verdicts), "holds")

    @property
    def status(self) -> str:
        """The verdict, as every answer calls it."""
        return self.verdict

    def said(self) -> list[str]:
        from symbolic.derivation_text import as_text  # which knows this module

        return [f"derivation: {self.verdict}", *as_text(self).splitlines()]

    def _repr_latex_(self) -> str:
        """For notebooks, whose mathematics has no paragraphs."""
        from symbolic.derivation_text import as_latex

        return re.sub(r"(?m)^\\paragraph\{(.*?)\}", r"\1:", as_latex(self))

    def representative(self, ids: tuple[int, ...]) -> AgentDerivation:
        return next(agent for agent in self.agents if agent.id == ids[0])
