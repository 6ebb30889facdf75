"""Section 1 of docs/certificate-direct.md: the closed loop of one agent around its nominal linear part.

``X = (z̄, x̄, η̄, e)``; while the saturation is inactive ``X' = A X + Σ_j B_j q_j``, and the outputs are ``C X``.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from certify.checker import linear
from certify.checker.certificate import AgentClaim, DirectAgentWitness
from certify.checker.linear import Matrix
from certify.checker.plant import Agent

Vector = list[Fraction]


@dataclass(frozen=True)
class Loop:
    """``inputs`` are the columns ``B_j`` of ``q_1 … q_nz, q_f, q_y``.

    The outputs are ``z̄``, ``x̄``, ``ϑ̃`` and, if ``s > 0``, ``Ψη̄``.
    """

    nz: int
    n: int
    s: int
    A: Matrix
    inputs: Matrix
    outputs: Matrix

    @property
    def size(self) -> int:
        return len(self.A)


def size_of(agent: Agent, s: int) -> int:
    return len(agent.zero_states) + agent.order * (1 if agent.order == 1 else 2) + s


def observer_matrix(claim: AgentClaim) -> Matrix:
    """``E3``: the companion matrix with ``−c_n … −c_1`` in its first column."""
    n = len(claim.observer)
    shift = [*linear.identity(n)[1:], [Fraction(0)] * n]
    return [[-c, *row[1:]] for c, row in zip(reversed(claim.observer), shift, strict=True)]


def build(agent: Agent, claim: AgentClaim, witness: DirectAgentWitness) -> Loop:
    """The exact nominal matrices; the sizes of the claim and the witness are already known to fit."""
    nz, n, s, size = len(agent.zero_states), agent.order, len(witness.ell), size_of(agent, len(witness.ell))
    unit = linear.identity(size)
    x, eta, e = nz, nz + n, nz + n + s
    theta = _theta(agent, claim, size, x, e)
    feedback = [-claim.K * entry for entry in theta]
    psi = [Fraction(0)] * size
    psi[eta:e] = claim.psi
    push = [*witness.nominal.f1, *[Fraction(0)] * (size - nz - n)]
    push = _plus(push, witness.nominal.b, _plus(feedback, Fraction(1), psi))

    rows: list[Vector] = [[*row, *[Fraction(0)] * (size - nz - 1)] for row in witness.nominal.f0]
    rows += [list(unit[x + k]) for k in range(1, n)] + [push]
    for j in range(s):
        own = [Fraction(0)] * size
        own[eta:e] = claim.M[j]
        rows.append(_plus(own, claim.N[j], _plus(feedback, Fraction(1), psi)))
    if claim.h is not None:
        for j, own_row in enumerate(observer_matrix(claim)):
            own = [Fraction(0)] * size
            own[e:] = [claim.h * entry for entry in own_row]
            rows.append(_plus(own, Fraction(int(j == n - 1)), push))

    forced = list(unit[x + n - 1])
    if claim.h is not None:
        forced[e + n - 1] = Fraction(1)
    columns = [*unit[:nz], forced, [-entry for entry in unit[x]]]
    outputs = [*unit[: nz + n], theta] + ([psi] if s else [])
    return Loop(nz, n, s, rows, linear.transpose(columns), outputs)


def _theta(agent: Agent, claim: AgentClaim, size: int, x: int, e: int) -> Vector:
    """``ϑ̃ = Σ g^(n−k) γ_k (x̄_k − e_k/h^(n−k))`` with ``γ_n = 1``; without ``e`` for ``n = 1``."""
    n, theta = agent.order, [Fraction(0)] * size
    for k, gamma in enumerate((*claim.gamma, Fraction(1)), 1):
        theta[x + k - 1] = claim.g ** (n - k) * gamma
        if claim.h is not None:
            theta[e + k - 1] = -((claim.g / claim.h) ** (n - k)) * gamma
    return theta


def _plus(x: Vector, factor: Fraction, y: Vector) -> Vector:
    return [a + factor * b for a, b in zip(x, y, strict=True)]
