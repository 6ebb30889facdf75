"""The network of plants as frozen, exact, hashable values (theory.md section 1)."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

import sympy

from symbolic.guards import NO_GUARDS, AgentGuards
from symbolic.interval import Interval
from symbolic.requested import NOTHING_FIXED, CoordinatorChoice, Implementation, RequestedGains, Requirements, Settling

__all__ = [
    "COST_VARIABLE",
    "Agent",
    "CoordinatorChoice",
    "Digraph",
    "Edge",
    "Exosystem",
    "Implementation",
    "InitialBox",
    "InternalModelChoice",
    "Interval",
    "Plant",
    "RequestedGains",
    "Requirements",
    "Settling",
    "symbol",
]


@dataclass(frozen=True)
class Edge:
    """``source -> target``: the target hears the source with ``weight = a_(target,source) > 0``."""

    source: int
    target: int
    weight: Fraction


@dataclass(frozen=True)
class Digraph:
    """Agents ``1 … agents`` and the edges between them."""

    agents: int
    edges: tuple[Edge, ...]


@dataclass(frozen=True)
class Exosystem:
    """``v' = S v`` with ``v(0)`` in the box ``initial``; no states when there is no disturbance."""

    states: tuple[sympy.Symbol, ...]
    S: sympy.ImmutableMatrix
    initial: tuple[Interval, ...]


@dataclass(frozen=True)
class InitialBox:
    """Initial set of one agent, one interval per component.

    ``observer is None`` means ``observer = "measured"``: ``x~_1(0) = y(0)`` and the other components 0.
    The internal model's dimension is not known yet, so ``eta`` is one interval for all its components.
    """

    z: tuple[Interval, ...]
    x: tuple[Interval, ...]
    observer: tuple[Interval, ...] | None
    eta: Interval
    reference: Interval


@dataclass(frozen=True)
class InternalModelChoice:
    """The user's Hurwitz ``M`` (rows) and ``N`` (column); a controllable pair."""

    M: tuple[tuple[Fraction, ...], ...]
    N: tuple[Fraction, ...]


@dataclass(frozen=True)
class Agent:
    """``z' = f0(z, x1, v, w)``, ``x_k' = x_(k+1)``, ``x_n' = f(z, x, v, w) + b(w) u``, ``y = x1``.

    ``cost`` is in the symbol ``s``. Answers of the user (steady state ``z*``, Lyapunov function ``V0``,
    internal model, ``gamma = (γ_1 … γ_(n-1))``, ``observer = (c_1 … c_n)``) are optional and never trusted.
    """

    id: int
    order: int
    zero_states: tuple[sympy.Symbol, ...]
    zero_dynamics: tuple[sympy.Expr, ...]
    f: sympy.Expr
    b: sympy.Expr
    cost: sympy.Expr
    parameters: tuple[sympy.Symbol, ...]
    parameter_box: tuple[Interval, ...]
    initial: InitialBox
    steady_state: tuple[sympy.Expr, ...] | None = None
    lyapunov: sympy.Expr | None = None
    internal_model: InternalModelChoice | None = None
    gamma: tuple[Fraction, ...] | None = None
    observer: tuple[Fraction, ...] | None = None
    guards: AgentGuards = NO_GUARDS

    @property
    def chain(self) -> tuple[sympy.Symbol, ...]:
        """The states ``x1 … xn``."""
        return tuple(sympy.Symbol(f"x{k}", real=True) for k in range(1, self.order + 1))


@dataclass(frozen=True, repr=False)
class Plant:
    """One plant file. ``sha256`` is the digest of its bytes ``source``, which a certificate is bound to.

    ``source`` is empty for a plant that was not read from a file; nothing can be certified about that one.
    ``gains``, ``requirements`` and ``implementations`` have one entry per agent, in order, or none at all if the file
    asks for nothing of the kind; ``gains_of`` and its like answer for one agent in either case.
    """

    name: str
    digraph: Digraph
    exosystem: Exosystem
    agents: tuple[Agent, ...]
    sha256: str
    coordinator: CoordinatorChoice = NOTHING_FIXED
    gains: tuple[RequestedGains, ...] = ()
    requirements: tuple[Requirements, ...] = ()
    implementations: tuple[Implementation, ...] = ()
    source: bytes = field(default=b"", repr=False, compare=False)

    def __post_init__(self) -> None:
        for entries in (self.gains, self.requirements, self.implementations):
            if len(entries) not in (0, len(self.agents)):
                raise ValueError("gains, requirements and implementations have one entry per agent, or none")

    def __repr__(self) -> str:
        """A line; ``write_plant`` says everything."""
        orders = sorted({agent.order for agent in self.agents})
        shown = ", ".join(map(str, orders))
        return (
            f"<Plant {self.name!r}: {len(self.agents)} agents of order {shown}, {len(self.digraph.edges)} edges, "
            f"{len(self.exosystem.states)} exosystem states, sha256 {self.sha256[:12]}…>"
        )

    def gains_of(self, number: int) -> RequestedGains:
        """What the user fixed of the gains of agent ``number`` (from 1)."""
        return self.gains[number - 1] if self.gains else RequestedGains()

    def requirements_of(self, number: int) -> Requirements:
        """What is asked of agent ``number``."""
        return self.requirements[number - 1] if self.requirements else Requirements()

    def implementation_of(self, number: int) -> Implementation | None:
        """How the controller of agent ``number`` is run; ``None`` in continuous time."""
        return self.implementations[number - 1] if self.implementations else None


def symbol(name: str) -> sympy.Symbol:
    """The one way to make a symbol: all of them are real, so that equal names are equal symbols."""
    return sympy.Symbol(name, real=True)


COST_VARIABLE = symbol("s")
