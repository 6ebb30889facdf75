"""The equations of one agent in the error coordinates (theory.md section 3), for every n ≥ 1."""

from __future__ import annotations

from dataclasses import dataclass

import sympy

from symbolic.coordinate_maps import CoordinateMaps, Equations, Exprs, dot
from symbolic.error_symbols import DesignSymbols, ErrorSymbols, error_symbols
from symbolic.exact_field import as_expression
from symbolic.increments import increments
from symbolic.internal_model import InternalModel
from symbolic.plant import COST_VARIABLE, Agent, Exosystem
from symbolic.point_parameters import without_point_parameters
from symbolic.steady_state import SteadyState


@dataclass(frozen=True)
class ErrorMatrices:
    """``Ac`` (n−1 × n−1), ``Bc`` and ``E`` (n−1 × 1), ``E2`` (1 × n), ``E3`` (n × n) in the design symbols."""

    Ac: sympy.ImmutableMatrix
    Bc: sympy.ImmutableMatrix
    E: sympy.ImmutableMatrix
    E2: sympy.ImmutableMatrix
    E3: sympy.ImmutableMatrix


@dataclass(frozen=True)
class ErrorSystem:
    """Error coordinates, both ways, and the equations in them.

    ``from_original``: each new coordinate in the original states; ``to_original``: the inverse; ``original``: the rates
    of plant, observer, internal model, exosystem and reference with ``u = ū + Ψη``. ``equations``: the structured
    rates of z̄, x̂, η̃, ϑ, e. ``ū`` is a free input; the controller sets ``ū = −sat_δ(K ϑ̃)``, where ϑ̃ is ``observed``
    in the original states and ``estimate = ϑ − E2(h) e`` in the new ones.

    The functions are in the new coordinates: ``f0_bar, f0_hat`` (one entry per zero state), ``f1_bar, f2_bar, f_hat,
    epsilon``, and ``xn_dot`` = ẋ_n. For n = 1 there is no x̂, f̄0 and f̄1 see x̄_1 = ϑ, and the controller measures ϑ, so
    it needs no observer; e_1 is kept for those who run one. Parameters whose interval is a point are replaced by their
    value.
    """

    agent: Agent
    symbols: ErrorSymbols
    from_original: Equations
    to_original: Equations
    original: Equations
    equations: Equations
    f0_bar: Exprs
    f0_hat: Exprs
    f1_bar: sympy.Expr
    f2_bar: sympy.Expr
    f_hat: sympy.Expr
    epsilon: sympy.Expr
    xn_dot: sympy.Expr
    observed: sympy.Expr
    estimate: sympy.Expr
    matrices: ErrorMatrices

    def rate(self, state: sympy.Symbol) -> sympy.Expr:
        """The structured right-hand side of one new coordinate."""
        return dict(self.equations)[state]


def error_system(
    agent: Agent, exosystem: Exosystem, steady_state: SteadyState, internal_model: InternalModel, s_star: sympy.Expr
) -> ErrorSystem:
    """The error system of an agent at the consensus value ``s_star`` (exact, or the symbol ``s``)."""
    agent = without_point_parameters(agent)
    taken = {*agent.zero_states, *agent.chain, *agent.parameters, *exosystem.states, COST_VARIABLE}
    sym = error_symbols(len(agent.zero_states), agent.order, internal_model.order, taken)
    optimum = {COST_VARIABLE: s_star}
    z_star = tuple(z.xreplace(optimum) for z in steady_state.z_star)
    maps = CoordinateMaps(agent, exosystem, internal_model, sym, z_star, steady_state.u_star.xreplace(optimum))
    values = dict(zip((*sym.xbar, *sym.zstar), (*maps.xbar, *maps.z_star), strict=True))
    bar, hat = increments(agent, (*agent.zero_dynamics, agent.f), sym, s_star)
    *f0_bar, f1_bar = (expr.xreplace(values) for expr in bar)
    *f0_hat, f2_bar = (expr.xreplace(values) for expr in hat)
    f_hat = f1_bar + dot(maps.weights[:-1], maps.xbar[1:])
    epsilon = f2_bar - maps.weights[0] * sym.reference_rate
    xn_dot = f1_bar + f2_bar + agent.b * (sym.ubar + dot(maps.psi, maps.eta_bar))
    matrices = error_matrices(agent.order, sym.gains)
    equations = (
        *((name, tracked + moved) for name, tracked, moved in zip(sym.zbar, f0_bar, f0_hat, strict=True)),
        *_driven(maps, matrices, f_hat, epsilon),
        *_observer_errors(maps, matrices, xn_dot),
    )
    observed = dot(maps.weights, sym.observer) - maps.weights[0] * sym.reference
    estimate = sym.vartheta - dot(tuple(matrices.E2), sym.e)
    return ErrorSystem(
        agent,
        sym,
        maps.from_original(),
        maps.to_original(),
        maps.original(),
        equations,
        tuple(f0_bar),
        tuple(f0_hat),
        f1_bar,
        f2_bar,
        f_hat,
        epsilon,
        xn_dot,
        observed,
        estimate,
        matrices,
    )


def identity_residuals(system: ErrorSystem) -> tuple[sympy.Expr, ...]:
    """What must vanish identically for the transformed equations to be the original ones.

    One entry per new coordinate: (chain rule along ``original``) − (structured rate); one per original state: (inverse
    after map) − identity; last ``ϑ̃ − (ϑ − E2(h) e)``. ``identity.zero_test`` decides each.
    """
    forward, back = dict(system.from_original), dict(system.to_original)
    residuals = []
    for state, expr in system.from_original:
        chain = sympy.Add(*(expr.diff(name) * rate for name, rate in system.original if expr.has(name)))
        residuals.append(chain.xreplace(back) - system.rate(state))
    residuals += [expr.xreplace(forward) - name for name, expr in system.to_original]
    return (*residuals, system.observed.xreplace(back) - system.estimate)


def error_matrices(order: int, gains: DesignSymbols) -> ErrorMatrices:
    """The constant matrices of section 3. E has n−1 rows: the printed ``E ∈ Rⁿ`` does not fit x̂."""
    n = order
    Ac, Bc, E, E3 = sympy.zeros(n - 1, n - 1), sympy.zeros(n - 1, 1), sympy.zeros(n - 1, 1), sympy.zeros(n, n)
    for k in range(n - 2):
        Ac[k, k + 1] = 1
    for k, gamma in enumerate(gains.gamma):
        Ac[n - 2, k] = -gamma
    if n > 1:
        Bc[n - 2], E[0] = gains.g ** (2 - n), 1
    for k in range(n):
        E3[k, 0] = -gains.c[n - 1 - k]
    for k in range(n - 1):
        E3[k, k + 1] = 1
    E2 = sympy.Matrix([[(gains.g / gains.h) ** (n - k) * gamma for k, gamma in enumerate((*gains.gamma, 1), 1)]])
    return ErrorMatrices(*(sympy.ImmutableMatrix(matrix) for matrix in (Ac, Bc, E, E2, E3)))


def _driven(maps: CoordinateMaps, matrices: ErrorMatrices, f_hat: sympy.Expr, epsilon: sympy.Expr) -> Equations:
    """``x̂' = g Ac x̂ + Bc ϑ − E ẏ^r``, ``η̃' = Mη̃ + b⁻¹(MNϑ − Nf̂ − Nε)``, ``ϑ' = f̂ + bΨη̃ + ΨNϑ + bū + ε``."""
    sym, b = maps.symbols, maps.agent.b
    xhat_rates = (
        sym.gains.g * matrices.Ac * sympy.Matrix(len(sym.xhat), 1, list(sym.xhat))
        + matrices.Bc * sym.vartheta
        - matrices.E * sym.reference_rate
    )
    rows = [[as_expression(entry) for entry in row] for row in maps.model.M]
    eta_rates = (
        dot(row, sym.etatilde) + (dot(row, maps.N) * sym.vartheta - N * f_hat - N * epsilon) / b
        for row, N in zip(rows, maps.N, strict=True)
    )
    generated = b * dot(maps.psi, sym.etatilde) + dot(maps.psi, maps.N) * sym.vartheta
    vartheta_rate = f_hat + generated + b * sym.ubar + epsilon
    return (
        *zip(sym.xhat, xhat_rates, strict=True),
        *zip(sym.etatilde, eta_rates, strict=True),
        (sym.vartheta, vartheta_rate),
    )


def _observer_errors(maps: CoordinateMaps, matrices: ErrorMatrices, xn_dot: sympy.Expr) -> Equations:
    """``e' = h E3 e + e_n ẋ_n``; for n = 1, ``ẋ_1 = ϑ' + ẏ^r``."""
    sym = maps.symbols
    rates = list(sym.gains.h * matrices.E3 * sympy.Matrix(sym.e))
    rates[-1] += xn_dot
    return tuple(zip(sym.e, rates, strict=True))
