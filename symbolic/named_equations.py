"""The error coordinates and equations as a reader wants them: short, with z*, x̄ and the functions by name."""

from __future__ import annotations

from dataclasses import dataclass

import sympy

from symbolic.coordinate_maps import CoordinateMaps, dot
from symbolic.coordinates import error_matrices
from symbolic.error_symbols import ErrorSymbols, error_symbols
from symbolic.exact_field import as_expression
from symbolic.increments import increments
from symbolic.internal_model import InternalModel
from symbolic.plant import COST_VARIABLE, Agent, Exosystem
from symbolic.point_parameters import without_point_parameters
from symbolic.steady_state import SteadyState

SATURATION = sympy.Function("sat_delta")


@dataclass(frozen=True)
class NamedEquation:
    """``left = right``, or ``left' = right`` when ``rate``."""

    left: sympy.Symbol
    right: sympy.Expr
    rate: bool = False


@dataclass(frozen=True)
class NamedEquations:
    """Definitions of the coordinates, of the functions, and the equations; ``symbols`` names what occurs."""

    symbols: ErrorSymbols
    coordinates: tuple[NamedEquation, ...]
    functions: tuple[NamedEquation, ...]
    rates: tuple[NamedEquation, ...]


def named_equations(
    agent: Agent, exosystem: Exosystem, steady_state: SteadyState, internal_model: InternalModel, s_star: sympy.Expr
) -> NamedEquations:
    """The error system of ``coordinates.error_system`` in the form of theory.md section 3, for printing.

    For n = 1 the controller needs no observer: e is left out and ``ū = −sat_δ(K ϑ)``.
    """
    agent = without_point_parameters(agent)
    taken = {*agent.zero_states, *agent.chain, *agent.parameters, *exosystem.states, COST_VARIABLE}
    sym = error_symbols(len(agent.zero_states), agent.order, internal_model.order, taken)
    optimum = {COST_VARIABLE: s_star}
    z_star = tuple(z.xreplace(optimum) for z in steady_state.z_star)
    maps = CoordinateMaps(agent, exosystem, internal_model, sym, z_star, steady_state.u_star.xreplace(optimum))
    return NamedEquations(sym, _coordinates(maps), _functions(maps, s_star), _rates(maps))


def _coordinates(maps: CoordinateMaps) -> tuple[NamedEquation, ...]:
    sym, agent = maps.symbols, maps.agent
    xbar = (agent.chain[0] - sym.reference, *agent.chain[1:])
    return (
        *(NamedEquation(star, value) for star, value in zip(sym.zstar, maps.z_star, strict=True)),
        *(NamedEquation(bar, z - star) for bar, z, star in zip(sym.zbar, agent.zero_states, sym.zstar, strict=True)),
        *(NamedEquation(bar, value) for bar, value in zip(sym.xbar, xbar, strict=True)),
        *(NamedEquation(hat, sym.xbar[k] / sym.gains.g**k) for k, hat in enumerate(sym.xhat)),
        NamedEquation(sym.vartheta, dot(maps.weights, sym.xbar)),
        *(
            NamedEquation(tilde, eta - steady - N * sym.vartheta / agent.b)
            for tilde, eta, steady, N in zip(sym.etatilde, sym.eta, maps.steady_eta, maps.N, strict=True)
        ),
        *(
            NamedEquation(e, sym.gains.h ** (agent.order - k) * (x - estimate))
            for k, (e, x, estimate) in enumerate(zip(sym.e, agent.chain, sym.observer, strict=True), 1)
            if agent.order > 1
        ),
    )


def _functions(maps: CoordinateMaps, s_star: sympy.Expr) -> tuple[NamedEquation, ...]:
    sym, agent = maps.symbols, maps.agent
    (*f0_bar, f1_bar), (*f0_hat, f2_bar) = increments(agent, (*agent.zero_dynamics, agent.f), sym, s_star)
    return (
        *(NamedEquation(name, expr) for name, expr in zip(sym.f0_bar, f0_bar, strict=True)),
        *(NamedEquation(name, expr) for name, expr in zip(sym.f0_hat, f0_hat, strict=True)),
        NamedEquation(sym.f1_bar, f1_bar),
        NamedEquation(sym.f2_bar, f2_bar),
        NamedEquation(sym.f_hat, sym.f1_bar + dot(maps.weights[:-1], sym.xbar[1:])),
        NamedEquation(sym.epsilon, sym.f2_bar - maps.weights[0] * sym.reference_rate),
    )


def _rates(maps: CoordinateMaps) -> tuple[NamedEquation, ...]:
    sym, agent, b = maps.symbols, maps.agent, maps.agent.b
    matrices = error_matrices(agent.order, sym.gains)
    xhat = (
        sym.gains.g * matrices.Ac * sympy.Matrix(len(sym.xhat), 1, list(sym.xhat))
        + matrices.Bc * sym.vartheta
        - matrices.E * sym.reference_rate
    )
    rows = [[as_expression(entry) for entry in row] for row in maps.model.M]
    etatilde = [
        dot(row, sym.etatilde) + dot(row, maps.N) * sym.vartheta / b - N * (sym.f_hat + sym.epsilon) / b
        for row, N in zip(rows, maps.N, strict=True)
    ]
    generated = b * dot(maps.psi, sym.etatilde) + dot(maps.psi, maps.N) * sym.vartheta
    pairs = [
        *((name, bar + hat) for name, bar, hat in zip(sym.zbar, sym.f0_bar, sym.f0_hat, strict=True)),
        *zip(sym.xhat, xhat, strict=True),
        *zip(sym.etatilde, etatilde, strict=True),
        (sym.vartheta, sym.f_hat + generated + b * sym.ubar + sym.epsilon),
    ]
    estimate = sym.vartheta
    if agent.order > 1:
        e = list(sym.gains.h * matrices.E3 * sympy.Matrix(sym.e))
        e[-1] += sym.f1_bar + sym.f2_bar + sympy.expand(b * (sym.ubar + dot(maps.psi, maps.eta_bar)))
        pairs += zip(sym.e, e, strict=True)
        estimate -= dot(tuple(matrices.E2), sym.e)
    return (
        *(NamedEquation(name, expr, rate=True) for name, expr in pairs),
        NamedEquation(sym.ubar, -SATURATION(sym.gains.K * estimate)),
    )
