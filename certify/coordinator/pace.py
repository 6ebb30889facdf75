"""How fast the references shall move where the plant file leaves ``κ`` open: as fast as the plants themselves do.

A proposal only: the certificate is of whatever is chosen. On the consensus line ``ds/dt = −κ Σ c_i'(s)`` whatever ``α``
is, so ``C = κ Σ c_i''`` is the rate, and a plant's own rates are what it is compared with.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

import numpy as np
import sympy

from symbolic.plant import Agent, Plant

QUICKER = 6.0  # than the plants by themselves: their loops are faster too, and the references are not to be waited for
NEGLIGIBLE = 1e-9  # of the largest rate: a root at zero after rounding


def natural_pace(plant: Plant) -> float:
    """A rate per unit of time of the plant file: the median over the agents of the slowest rate of the chain of
    integrators, else of the exosystem, else of the zero dynamics; 1 if nothing in the file has a rate."""
    for rates in (
        [_chain(agent) for agent in plant.agents],
        [_spectrum(np.array(plant.exosystem.S.tolist(), dtype=float))],
        [_zero_dynamics(agent) for agent in plant.agents],
    ):
        found = [min(values) for values in rates if values]
        if found:
            return QUICKER * float(median(found))
    return 1.0


def _chain(agent: Agent) -> list[float]:
    """Moduli of the roots of ``λ^n = Σ ∂f/∂x_k λ^(k−1)`` at the origin, the parameters in the middle."""
    slopes = _slopes(agent, agent.f, agent.chain)
    return _moduli(np.roots([1.0, *(-slope for slope in reversed(slopes))]))


def _zero_dynamics(agent: Agent) -> list[float]:
    if not agent.zero_states:
        return []
    return _spectrum(np.array([_slopes(agent, rate, agent.zero_states) for rate in agent.zero_dynamics]))


def _spectrum(matrix: np.ndarray) -> list[float]:
    return _moduli(np.linalg.eigvals(matrix)) if matrix.size else []


def _moduli(roots: np.ndarray) -> list[float]:
    moduli = np.abs(roots[np.isfinite(roots)])
    return [float(value) for value in moduli if value > NEGLIGIBLE * max(moduli)]


def _slopes(agent: Agent, expression: sympy.Expr, states: Sequence[sympy.Symbol]) -> list[float]:
    """Partial derivatives at the origin in floats; 0 where there is none."""
    middle = {
        name: sympy.Rational(*(side.lo + side.hi).as_integer_ratio()) / 2
        for name, side in zip(agent.parameters, agent.parameter_box, strict=True)
    }
    found = []
    for state in states:
        derivative = sympy.diff(expression, state).xreplace(middle)
        value = derivative.xreplace({name: sympy.Integer(0) for name in derivative.free_symbols})
        found.append(float(value) if value.is_number and value.is_finite else 0.0)
    return found
