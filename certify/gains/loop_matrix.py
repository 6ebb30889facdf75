"""The closed loop of one agent, linearised at its steady state with ``y^r = s*`` and the saturation inactive.

The states are ``(z, x, x̃, η)``; for ``n = 1`` there is no observer and ``x̃`` is left out. With ``u = −K Σ g^(n−k)
γ_k x̃_k + Ψη``

    ẋ_n = ∂f/∂z z + ∂f/∂x x + b u,   x̃_k' = x̃_(k+1) + h^k c_(n+1−k) (x_1 − x̃_1),   η' = Mη + Nu.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import sympy

from certify.inequalities.matrices import Matrix, add, scale
from symbolic.controller import AgentController
from symbolic.plant import COST_VARIABLE, Agent
from symbolic.steady_state import SteadyState


@dataclass(frozen=True)
class PlantSlopes:
    """Partial derivatives at the steady state, in ``s, v, w``: ``∂f0/∂(z, x1)``, ``∂f/∂(z, x)`` and ``b``."""

    zero_dynamics: tuple[tuple[sympy.Expr, ...], ...]
    output_chain: tuple[sympy.Expr, ...]
    b: sympy.Expr

    @property
    def entries(self) -> tuple[sympy.Expr, ...]:
        """All of them in one row, in the order ``assemble`` takes their values."""
        return (*(entry for row in self.zero_dynamics for entry in row), *self.output_chain, self.b)


def plant_slopes(agent: Agent, steady_state: SteadyState) -> PlantSlopes:
    """Slopes of the plant along ``z = z*(s, v, w)``, ``x = (s, 0, …, 0)``."""
    chain, zeros = agent.chain, agent.zero_states
    at_rest: Mapping[sympy.Symbol, sympy.Expr] = {
        **dict(zip(zeros, steady_state.z_star, strict=True)),
        **dict.fromkeys(chain, sympy.S.Zero),
        chain[0]: COST_VARIABLE,
    }

    def slopes(expression: sympy.Expr, names: Sequence[sympy.Symbol]) -> tuple[sympy.Expr, ...]:
        return tuple(sympy.diff(expression, name).xreplace(at_rest) for name in names)

    return PlantSlopes(
        tuple(slopes(rate, (*zeros, chain[0])) for rate in agent.zero_dynamics),
        slopes(agent.f, (*zeros, *chain)),
        agent.b,
    )


@dataclass(frozen=True)
class LoopMatrix:
    """``A(h) = Σ_k h^k powers[k]``; for an agent without observer there is one power."""

    powers: tuple[Matrix, ...]

    def at(self, h: Fraction | None) -> Matrix:
        """The matrix at the observer gain ``h`` (ignored, and allowed to be ``None``, without observer)."""
        total, factor = self.powers[0], Fraction(1)
        for power in self.powers[1:]:
            factor *= Fraction(0) if h is None else h
            total = add(total, scale(factor, power))
        return total


def assemble(agent: Agent, controller: AgentController, slopes: Sequence[Fraction]) -> LoopMatrix:
    """The closed loop from the values of ``PlantSlopes.entries``."""
    nz, n, model = len(agent.zero_states), agent.order, len(controller.N)
    measured = nz if n == 1 else nz + n
    eta = measured + n
    size = eta + model
    *plant, b = slopes
    rows = [[Fraction(0)] * size for _ in range(size)]
    feedback = [Fraction(0)] * size
    for k, weight in enumerate((*controller.gamma, Fraction(1))):
        feedback[measured + k] = -controller.K * controller.g ** (n - 1 - k) * weight
    feedback[eta:] = controller.psi

    for i in range(nz):
        rows[i][: nz + 1] = plant[i * (nz + 1) : (i + 1) * (nz + 1)]
    for k in range(n - 1):
        rows[nz + k][nz + k + 1] = Fraction(1)
    rows[nz + n - 1][: nz + n] = plant[nz * (nz + 1) :]
    _add_multiple(rows[nz + n - 1], b, feedback)
    for i, (row, gain) in enumerate(zip(controller.M, controller.N, strict=True)):
        rows[eta + i][eta:] = row
        _add_multiple(rows[eta + i], gain, feedback)
    if n == 1:
        return LoopMatrix((tuple(map(tuple, rows)),))

    for k in range(n - 1):
        rows[measured + k][measured + k + 1] = Fraction(1)
    powers = [tuple(map(tuple, rows))]
    for k in range(n):
        injection = [[Fraction(0)] * size for _ in range(size)]
        injection[measured + k][nz] = controller.observer[n - 1 - k]
        injection[measured + k][measured] = -controller.observer[n - 1 - k]
        powers.append(tuple(map(tuple, injection)))
    return LoopMatrix(tuple(powers))


def _add_multiple(row: list[Fraction], factor: Fraction, other: Sequence[Fraction]) -> None:
    for j, entry in enumerate(other):
        row[j] += factor * entry
