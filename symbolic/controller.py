"""The controller as frozen values: coordinator, observers, internal models, saturated feedback."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

Row = tuple[Fraction, ...]


@dataclass(frozen=True)
class AgentController:
    """``u = −sat_δ(K ϑ̃) + Ψ η``, ``η' = M η + N u``, ``Ψ = Γ T⁻¹``, ``ϑ̃ = Σ_k g^(n−k) γ_k (x̃_k − [k = 1] y^r)``.

    ``γ_n = 1``; ``gamma = (γ_1 … γ_(n−1))``; ``observer = (c_1 … c_n)`` of ``λⁿ + c_n λ^(n−1) + … + c_1``; without an
    internal model ``M = ()``, ``N = ()`` and ``psi = ()``. For ``n = 1`` there is no observer: ``h is None`` and
    ``ϑ̃ = y − y^r``.
    """

    id: int
    gamma: Row
    observer: Row
    M: tuple[Row, ...]
    N: Row
    psi: Row
    g: Fraction
    K: Fraction
    delta: Fraction
    h: Fraction | None


@dataclass(frozen=True)
class Controller:
    """Coordinator gains ``α1, α2`` and one decentralised controller per agent, in the order of the agents."""

    alpha1: Fraction
    alpha2: Fraction
    agents: tuple[AgentController, ...]
