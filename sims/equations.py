"""The closed loop of one agent as SymPy expressions and as compiled right-hand sides (theory.md section 1).

With ``y^r(t)`` and ``v(t)`` as inputs an agent does not see the others, so the network's closed loop is a cascade:
exosystem and coordinator first (``sims.coordinator``), then each agent alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import sympy

from sims.codegen import CompiledFunction, Saturation, compile_function
from symbolic.controller import AgentController
from symbolic.errors import InputError
from symbolic.exact_field import as_expression
from symbolic.plant import Agent, Exosystem

Symbols = tuple[sympy.Symbol, ...]


@dataclass(frozen=True)
class ClosedLoopEquations:
    """``q' = derivative(q, y^r, v, w)`` with ``q = (z, x, e, η)``; no ``e`` when ``n = 1``, no ``η`` without internal
    model.

    ``e_k = h^(n−k) (x_k − x̃_k)`` (theory.md section 3) stands for the observer: in ``x̃`` itself the innovation ``y
    − x̃_1`` is a difference of nearly equal numbers times ``h^n``, whose rounding noise (5e-2 for ``h = 6e4, n = 3``)
    stalls any step control. ``estimate`` gives ``x̃`` back. ``vartheta`` is ``ϑ`` of the true state,
    ``vartheta_estimate`` is ``ϑ̃``, which is fed back.
    """

    z: Symbols
    x: Symbols
    e: Symbols
    eta: Symbols
    reference: sympy.Symbol
    exogenous: Symbols
    parameters: Symbols
    derivative: tuple[sympy.Expr, ...]
    estimate: tuple[sympy.Expr, ...]
    u: sympy.Expr
    vartheta: sympy.Expr
    vartheta_estimate: sympy.Expr

    @property
    def states(self) -> Symbols:
        return self.z + self.x + self.e + self.eta


@dataclass(frozen=True)
class CompiledAgent:
    """Functions of ``(q, (y^r, v…), w)``: ``derivative`` (dim q values), ``jacobian`` (∂/∂q row by row), ``signals``
    (u, ϑ, ϑ̃, x̃…).
    """

    equations: ClosedLoopEquations
    derivative: CompiledFunction
    jacobian: CompiledFunction
    signals: CompiledFunction


def closed_loop_equations(agent: Agent, controller: AgentController, exosystem: Exosystem) -> ClosedLoopEquations:
    """Plant, high-gain observer, internal model and saturated feedback of one agent, exact.

    ``ż = f0``, ``ẋ_k = x_(k+1)``, ``ẋ_n = f + b u``;  ``e_k' = h (e_(k+1) − c_(n−k+1) e_1)``, ``e_n' = ẋ_n − h c_1
    e_1``, which is ``x̃_k' = x̃_(k+1) + h^k c_(n−k+1) (y − x̃_1)`` with ``x̃_(n+1) = 0``;  ``η' = M η + N u``;  ``u =
    −sat_δ(K ϑ̃) + Ψ η``. Raises ``InputError`` when ``n > 1`` and the controller has no ``h``.
    """
    n = agent.order
    x = agent.chain
    h = _observer_gain(agent, controller)
    e = tuple(sympy.Dummy(f"e{k}", real=True) for k in range(1, n + 1)) if n > 1 else ()
    eta = tuple(sympy.Dummy(f"eta{k}", real=True) for k in range(1, len(controller.N) + 1))
    reference = sympy.Dummy("reference", real=True)
    gamma = (*controller.gamma, Fraction(1))
    weights = [as_expression(controller.g ** (n - k) * gamma_k) for k, gamma_k in enumerate(gamma, start=1)]
    error = [e_k / h ** (n - k) for k, e_k in enumerate(e, start=1)]
    vartheta = sympy.Add(*map(sympy.Mul, weights, x), -weights[0] * reference)
    vartheta_estimate = vartheta - sympy.Add(*map(sympy.Mul, weights, error))
    model_output = sympy.Add(*(as_expression(p) * eta_k for p, eta_k in zip(controller.psi, eta, strict=True)))
    u = model_output - Saturation(as_expression(controller.K) * vartheta_estimate, as_expression(controller.delta))
    last = agent.f + agent.b * u
    observer = []
    if e:
        chain = (*(h * upper for upper in e[1:]), last)
        gains = [h * as_expression(c) for c in reversed(controller.observer)]
        observer = [upper - gain * e[0] for upper, gain in zip(chain, gains, strict=True)]
    internal_model = [
        sympy.Add(*(as_expression(m) * eta_k for m, eta_k in zip(row, eta, strict=True)), as_expression(n_k) * u)
        for row, n_k in zip(controller.M, controller.N, strict=True)
    ]
    return ClosedLoopEquations(
        z=agent.zero_states,
        x=x,
        e=e,
        eta=eta,
        reference=reference,
        exogenous=exosystem.states,
        parameters=agent.parameters,
        derivative=(*agent.zero_dynamics, *x[1:], last, *observer, *internal_model),
        estimate=tuple(x_k - error_k for x_k, error_k in zip(x, error, strict=True)) if e else (),
        u=u,
        vartheta=vartheta,
        vartheta_estimate=vartheta_estimate,
    )


@lru_cache(maxsize=1024)
def compile_agent(agent: Agent, controller: AgentController, exosystem: Exosystem) -> CompiledAgent:
    """Compiled right-hand side, its analytic Jacobian (zero slope where saturated) and the signals to record."""
    equations = closed_loop_equations(agent, controller, exosystem)
    groups = (equations.states, (equations.reference, *equations.exogenous), equations.parameters)
    jacobian = [sympy.diff(row, state) for row in equations.derivative for state in equations.states]
    signals = (equations.u, equations.vartheta, equations.vartheta_estimate, *equations.estimate)
    return CompiledAgent(
        equations=equations,
        derivative=compile_function(groups, equations.derivative),
        jacobian=compile_function(groups, jacobian),
        signals=compile_function(groups, signals),
    )


def _observer_gain(agent: Agent, controller: AgentController) -> sympy.Rational:
    if agent.order == 1:
        return sympy.Integer(1)
    if controller.h is None:
        raise InputError(f"agent {agent.id} has order {agent.order} and needs an observer gain h")
    return as_expression(controller.h)
