"""What a verified certificate of the theorem direct/3 says about an agent's input, exact and on the safe side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import sympy

from certify.bounds.suprema import lower_bound, magnitude_bound
from certify.statement.claim import AgentClaim
from certify.statement.tube import Tube
from symbolic.plant import Agent, Interval


@dataclass(frozen=True)
class InputBound:
    """``u = ū + Ψη̄ + u*``. Until ``T1``: ``|ū| ≤ saturation``, ``|Ψη̄| ≤ internal`` (``None`` when ``T1 = 0``); always
    ``|u*(s*, v, w)| ≤ steady``; from ``T1`` on ``|ū + Ψη̄| ≤ tracking``. ``|u| ≤ claimed`` is what the checker proves
    where the claim says so, by sharper bounds than these."""

    saturation: Fraction
    internal: Fraction | None
    steady: Fraction
    tracking: Fraction
    claimed: Fraction | None = None

    @property
    def after(self) -> Fraction:
        """Bounds ``|u|`` from ``T1`` on."""
        return self._at_most(self.tracking + self.steady)

    @property
    def peak(self) -> Fraction:
        """Bounds ``|u|`` for all time."""
        if self.internal is None:
            return self.after
        return self._at_most(max(self.saturation + self.internal + self.steady, self.after))

    def _at_most(self, bound: Fraction) -> Fraction:
        return bound if self.claimed is None else min(bound, self.claimed)


def input_bound(
    agent: Agent, claim: AgentClaim, tube: Tube, u_star: sympy.Expr, box: Mapping[sympy.Symbol, Interval]
) -> InputBound | str:
    """The bounds that the boxes prove, or why there are none; ``box`` encloses ``s*``, ``v`` and the parameters.

    In phase 1 the boxes bound ``ζ = η̄ − N x̄_n/b`` with the true ``b``, so that ``Ψη̄ = Ψζ + ΨN x̄_n/b`` is at most
    ``|Ψ| ζ̂ + |ΨN| x̂_n/b_min``, and the saturation lets no more than ``δ`` pass. From ``T1`` on ``K|ϑ̃| ≤ δ``: nothing
    saturates, ``ū = −Kϑ̃``, and ``ū + Ψη̄`` is the last output of the tube.
    """
    least = lower_bound(agent.b, box).value
    if least <= 0:
        return f"agent {agent.id}: the input gain is not bounded away from 0"
    through = abs(sum((p * n for p, n in zip(claim.psi, claim.N, strict=True)), Fraction(0)))
    first = tube.plant_states
    internal = [
        sum((abs(p) * size for p, size in zip(claim.psi, row[first + 1 :], strict=True)), Fraction(0))
        + through * row[first - 1] / least
        for row in tube.reaching.boxes
    ]
    return InputBound(
        saturation=claim.delta,
        internal=max(internal, default=None),
        steady=magnitude_bound(u_star, box).value,
        tracking=tube.peak(first + 1),
        claimed=claim.requirements.input,
    )
