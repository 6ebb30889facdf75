"""Section 1 of docs/certificate-direct.md: the closed loop of one agent around its nominal linear part.

``X = (z̄, x̄, η̄, e)``; while the saturation is inactive ``X' = A X + Σ_j B_j q_j``, and the outputs are ``C X``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from certify.checker import linear
from certify.checker.certificate import AgentClaim, DirectAgentWitness
from certify.checker.linear import Matrix, Row
from certify.checker.plant import Agent

Vector = list[Fraction]


@dataclass(frozen=True)
class Loop:
    """``inputs`` are the columns ``B_j`` of ``q_1 … q_nz, q_f, q_y``, ``starts`` the ``S_l`` with ``X = Σ_l S_l Y_l``.

    The outputs are ``z̄``, ``x̄``, ``ϑ̃`` and ``υ = Ψη̄ − Kϑ̃``.
    """

    nz: int
    n: int
    A: Matrix
    inputs: Matrix
    starts: Matrix
    outputs: Matrix

    @property
    def size(self) -> int:
        return len(self.A)


def size_of(agent: Agent, s: int) -> int:
    return len(agent.zero_states) + agent.order * (1 if agent.order == 1 else 2) + s


def observer_matrix(observer: Row) -> Matrix:
    """``E3``: the companion matrix with ``−c_n … −c_1`` in its first column."""
    n = len(observer)
    shift = [*linear.identity(n)[1:], [Fraction(0)] * n]
    return [[-c, *row[1:]] for c, row in zip(reversed(observer), shift, strict=True)]


def theta(claim: AgentClaim) -> Vector:
    """``θ = (g^(n−1)γ_1 … gγ_(n−1), 1)``"""
    n = len(claim.gamma) + 1
    return [claim.g ** (n - k) * gamma for k, gamma in enumerate((*claim.gamma, Fraction(1)), 1)]


def observer_gain(claim: AgentClaim) -> Vector:
    """``E2 = θ_k/h^(n−k)``, empty without an observer."""
    h = claim.h
    return [] if h is None else [entry / h**k for k, entry in enumerate(reversed(theta(claim)))][::-1]


def build(agent: Agent, claim: AgentClaim, witness: DirectAgentWitness) -> Loop:
    """The exact nominal matrices; the sizes of the claim and the witness are already known to fit."""
    nz, n, s, size = len(agent.zero_states), agent.order, len(witness.ell), size_of(agent, len(witness.ell))
    unit, b = linear.identity(size), witness.nominal.b
    x, eta, e = nz, nz + n, nz + n + s

    def placed(at: int, entries: Sequence[Fraction]) -> Vector:
        return [*[Fraction(0)] * at, *entries, *[Fraction(0)] * (size - at - len(entries))]

    steered = _plus(placed(x, theta(claim)), -1, placed(e, observer_gain(claim)))
    v = _plus(placed(eta, claim.psi), -claim.K, steered)
    push = _plus(placed(0, witness.nominal.f1), b, v)
    rows = [placed(0, row) for row in witness.nominal.f0]
    rows += [list(unit[x + k]) for k in range(1, n)] + [push]
    rows += [_plus(placed(eta, row), N, v) for row, N in zip(claim.M, claim.N, strict=True)]
    if claim.h is not None:
        own = [placed(e, [claim.h * entry for entry in row]) for row in observer_matrix(claim.observer)]
        rows += [*own[:-1], _plus(own[-1], 1, push)]

    forced = list(unit[x + n - 1])
    if claim.h is not None:
        forced[e + n - 1] = Fraction(1)
    inputs = [*unit[:nz], forced, [-entry for entry in unit[x]]]
    by_theta = _plus(unit[x + n - 1], 1 / b, placed(eta, claim.N))
    starts = [
        *unit[:nz],
        *(_plus(unit[x + k], -entry, by_theta) for k, entry in enumerate(theta(claim)[:-1])),
        by_theta,
        *unit[eta:],
    ]
    outputs = [*unit[: nz + n], steered, v]
    return Loop(nz, n, rows, linear.transpose(inputs), linear.transpose(starts), outputs)


def _plus(x: Sequence[Fraction], factor: Fraction | int, y: Sequence[Fraction]) -> Vector:
    return [a + factor * b for a, b in zip(x, y, strict=True)]
