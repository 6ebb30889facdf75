"""The error coordinates as maps, both ways, and the equations they are applied to (theory.md sections 1, 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import sympy

from symbolic.error_symbols import ErrorSymbols
from symbolic.exact_field import as_expression
from symbolic.internal_model import InternalModel
from symbolic.plant import Agent, Exosystem
from symbolic.steady_internal_state import steady_internal_state

Exprs = tuple[sympy.Expr, ...]
Equations = tuple[tuple[sympy.Symbol, sympy.Expr], ...]


@dataclass(frozen=True)
class CoordinateMaps:
    """``z_star`` and ``u_star`` are taken at s = s*; everything is a function of the names in ``symbols``."""

    agent: Agent
    exosystem: Exosystem
    model: InternalModel
    symbols: ErrorSymbols
    z_star: Exprs
    u_star: sympy.Expr

    @cached_property
    def weights(self) -> Exprs:
        """``g^(n−k) γ_k`` for k = 1 … n, ``γ_n = 1``: ``ϑ = Σ_k g^(n−k) γ_k x̄_k``."""
        gains, n = self.symbols.gains, self.agent.order
        return (*(gains.g ** (n - k) * gamma for k, gamma in enumerate(gains.gamma, 1)), sympy.Integer(1))

    @cached_property
    def xbar(self) -> Exprs:
        """``x̄_k = g^(k−1) x̂_k`` for k < n and ``x̄_n = ϑ − Σ_(k<n) g^(n−k) γ_k x̄_k``."""
        lower = tuple(self.symbols.gains.g**k * x for k, x in enumerate(self.symbols.xhat))
        return (*lower, self.symbols.vartheta - dot(self.weights[:-1], lower))

    @cached_property
    def N(self) -> Exprs:
        return tuple(as_expression(entry) for entry in self.model.N)

    @cached_property
    def psi(self) -> Exprs:
        return tuple(as_expression(entry) for entry in self.model.psi)

    @cached_property
    def velocity(self) -> Exprs:
        """``S v``."""
        return tuple(self.exosystem.S * sympy.Matrix(self.exosystem.states)) if self.exosystem.states else ()

    @cached_property
    def eta_bar(self) -> Exprs:
        """``η̄ = η̃ + b⁻¹ N ϑ``."""
        return tuple(
            tilde + N * self.symbols.vartheta / self.agent.b
            for tilde, N in zip(self.symbols.etatilde, self.N, strict=True)
        )

    @cached_property
    def steady_eta(self) -> Exprs:
        """``T τ(s*, v, w)`` with ``τ = col(u*, du*/dt, …)`` along v' = S v."""
        rows = tuple(tuple(as_expression(entry) for entry in row) for row in self.model.T)
        return steady_internal_state(self.u_star, rows, self.exosystem)

    def from_original(self) -> Equations:
        """Each new coordinate in z, x, η, x̃, y^r, v, w."""
        x, sym = self.agent.chain, self.symbols
        xbar = (x[0] - sym.reference, *x[1:])
        vartheta = dot(self.weights, xbar)
        return (
            *((bar, z - star) for bar, z, star in zip(sym.zbar, self.agent.zero_states, self.z_star, strict=True)),
            *((hat, xbar[k] / sym.gains.g**k) for k, hat in enumerate(sym.xhat)),
            *(
                (tilde, eta - steady - N * vartheta / self.agent.b)
                for tilde, eta, steady, N in zip(sym.etatilde, sym.eta, self.steady_eta, self.N, strict=True)
            ),
            (sym.vartheta, vartheta),
            *(
                (e, sym.gains.h ** (self.agent.order - k) * (state - estimate))
                for k, (e, state, estimate) in enumerate(zip(sym.e, x, sym.observer, strict=True), 1)
            ),
        )

    def to_original(self) -> Equations:
        """Each of z, x, η, x̃ in the new coordinates, y^r, v, w."""
        sym = self.symbols
        states = (self.xbar[0] + sym.reference, *self.xbar[1:])
        return (
            *((z, bar + star) for bar, z, star in zip(sym.zbar, self.agent.zero_states, self.z_star, strict=True)),
            *zip(self.agent.chain, states, strict=True),
            *((eta, bar + steady) for eta, bar, steady in zip(sym.eta, self.eta_bar, self.steady_eta, strict=True)),
            *(
                (estimate, state - e / sym.gains.h ** (self.agent.order - k))
                for k, (estimate, state, e) in enumerate(zip(sym.observer, states, sym.e, strict=True), 1)
            ),
        )

    def original(self) -> Equations:
        """The rates of z, x, η, x̃, v, y^r in the original states, with ``u = ū + Ψ η``."""
        x, sym, gains, n = self.agent.chain, self.symbols, self.symbols.gains, self.agent.order
        u = sym.ubar + dot(self.psi, sym.eta)
        error = x[0] - sym.observer[0]
        rows = [[as_expression(entry) for entry in row] for row in self.model.M]
        return (
            *zip(self.agent.zero_states, self.agent.zero_dynamics, strict=True),
            *zip(x, (*x[1:], self.agent.f + self.agent.b * u), strict=True),
            *((eta, dot(row, sym.eta) + N * u) for eta, row, N in zip(sym.eta, rows, self.N, strict=True)),
            *(
                (state, following + gains.h**k * gains.c[n - k] * error)
                for k, (state, following) in enumerate(
                    zip(sym.observer, (*sym.observer[1:], sympy.Integer(0)), strict=True), 1
                )
            ),
            *zip(self.exosystem.states, self.velocity, strict=True),
            (sym.reference, sym.reference_rate),
        )


def dot(left: Sequence[sympy.Expr], right: Sequence[sympy.Expr]) -> sympy.Expr:
    return sympy.Add(*(a * b for a, b in zip(left, right, strict=True)))
