"""Whether the linearised sampled loop is stable, in floats: an estimate that refuses bad periods and proves nothing
(docs/export.md, periods)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice, product

import numpy as np
import sympy
from flint import arb, ctx
from scipy.linalg import expm

from certify.export.formats import PRECISION
from certify.export.modes import modes
from certify.export.observer import luenberger
from certify.gains.loop_matrix import PlantSlopes, plant_slopes
from certify.optimum import optimum
from symbolic.controller import AgentController, Controller
from symbolic.derivation import derive_agent
from symbolic.plant import COST_VARIABLE, Agent, Exosystem, Plant
from symbolic.steady_state import SteadyState

Array = np.ndarray
MOST_CORNERS = 16
HALVINGS = 14  # before it is said that no period helps
ROUNDING = 1e-10  # of an eigenvalue: nearer to 1 a radius says nothing


@dataclass(frozen=True)
class SampledLoop:
    """The plant of one agent at the corners of ``W``, linearised at ``s*`` and ``v = 0``, with its controller.

    ``plants`` are the pairs ``(A, B)`` of ``(z, x)``.
    """

    law: AgentController
    order: int
    zeros: int
    plants: tuple[tuple[Array, Array], ...]

    def radius(self, period: Fraction) -> float:
        """The largest spectral radius over the corners, for a delay of nothing and of one period."""
        controller = _controller(self.law, self.order, period)
        found = [
            float(np.abs(np.linalg.eigvals(_closed(A, B, self.zeros, *controller, float(period), delayed))).max())
            for A, B in self.plants
            for delayed in (False, True)
        ]
        return max(found)

    def looks_stable(self, period: Fraction) -> bool:
        """Whether the radius is below 1 by more than rounding."""
        return self.radius(period) < 1 - ROUNDING

    def shorter(self, period: Fraction) -> Fraction | None:
        """This period halved until it looks stable; ``None`` if that does not happen."""
        for _ in range(HALVINGS):
            period /= 2
            if self.looks_stable(period):
                return period
        return None


def sampled_loops(plant: Plant, controller: Controller) -> list[SampledLoop]:
    """One per agent, in order; the plant passes the assumptions, or there is no certificate."""
    side = optimum(plant).enclosure
    loops = []
    for agent, law in zip(plant.agents, controller.agents, strict=True):
        steady = derive_agent(agent, plant, COST_VARIABLE).steady_state
        assert isinstance(steady, SteadyState)
        loops.append(sampled_loop(agent, law, steady, plant.exosystem, (side.lo + side.hi) / 2))
    return loops


def sampled_loop(
    agent: Agent, law: AgentController, steady: SteadyState, exosystem: Exosystem, s_star: Fraction
) -> SampledLoop:
    """At up to 16 corners of the parameters that the linearisation depends on."""
    slopes = plant_slopes(agent, steady)
    at_rest = {COST_VARIABLE: sympy.Rational(s_star.numerator, s_star.denominator)}
    at_rest |= dict.fromkeys(exosystem.states, sympy.S.Zero)
    entries = [entry.subs(at_rest) for entry in slopes.entries]
    plants = []
    for corner in islice(_corners(agent, entries), MOST_CORNERS):
        values = [float(entry.subs(corner)) for entry in entries]
        plants.append(_plant(agent, slopes, values))
    return SampledLoop(law, agent.order, len(agent.zero_states), tuple(plants))


def _corners(agent: Agent, entries: Sequence[sympy.Expr]) -> Iterator[dict[sympy.Symbol, float]]:
    used = set().union(*(entry.free_symbols for entry in entries))
    names = [name for name in agent.parameters if name in used]
    sides = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    for values in product(*([float(sides[name].lo), float(sides[name].hi)] for name in names)):
        yield dict(zip(names, values, strict=True))


def _plant(agent: Agent, slopes: PlantSlopes, values: Sequence[float]) -> tuple[Array, Array]:
    nz, n = len(agent.zero_states), agent.order
    A = np.zeros((nz + n, nz + n))
    for i in range(nz):
        A[i, : nz + 1] = values[i * (nz + 1) : (i + 1) * (nz + 1)]
    for k in range(n - 1):
        A[nz + k, nz + k + 1] = 1.0
    A[nz + n - 1, :] = values[nz * (nz + 1) : -1]
    B = np.zeros(nz + n)
    B[-1] = values[-1]
    return A, B


def _controller(law: AgentController, n: int, period: Fraction) -> tuple[Array, Array, Array, float]:
    """``c⁺ = F c + G y``, ``u = H c + D y`` of the exported step with ``y^r = 0``; ``c = (x̃, m)``."""
    with ctx.workprec(PRECISION):
        found = modes(law, period, Fraction(0))
        observer = None if law.h is None else luenberger(law.observer, law.h, period)
    size = 0 if observer is None else n
    total = size + sum(len(mode.gain) for mode in found)
    weights = np.array([float(law.K * law.g ** (n - k) * c) for k, c in enumerate((*law.gamma, Fraction(1)), 1)])
    F, G, psi = np.zeros((total, total)), np.zeros(total), np.zeros(total)
    H, D = np.zeros(total), -float(weights[0])
    if observer is not None:
        E = np.array([[float(observer.transition[k - i]) if k >= i else 0.0 for k in range(n)] for i in range(n)])
        L = np.array(list(map(_middle, observer.gain)))
        E[:, 0] -= L
        F[:n, :n], G[:n] = E, L
        H[:n], D = -(weights @ E), -float(weights @ L)
    feedback, direct = H.copy(), D  # u − Ψη, which drives the model
    place = size
    for mode in found:
        psi[place] = 1.0
        gain = np.array(list(map(_middle, mode.gain)))
        c, s = _middle(mode.cosine), _middle(mode.sine)
        part = slice(place, place + len(gain))
        F[part, part] = [[1.0]] if mode.frequency is None else [[c, s], [-s, c]]
        F[part, :] += np.outer(gain, feedback)
        G[part] = gain * direct
        place += len(gain)
    return F, G, H + psi, D


def _middle(ball: arb) -> float:
    return float(ball.mid())


def _closed(
    A: Array, B: Array, output: int, F: Array, G: Array, H: Array, D: float, period: float, delayed: bool
) -> Array:
    """One period of ``(z, x, c)``, and of the input that is still to come where it is delayed by one period."""
    n, c = len(B), len(G)
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = A * period, B * period
    flow = expm(block)
    P, Q = flow[:n, :n], flow[:n, n]
    C = np.zeros(n)
    C[output] = 1.0
    loop = np.zeros((n + c + delayed, n + c + delayed))
    loop[:n, :n] = P
    loop[n : n + c, :n], loop[n : n + c, n : n + c] = np.outer(G, C), F
    if delayed:
        loop[:n, -1] = Q
        loop[-1, :n], loop[-1, n : n + c] = D * C, H
    else:
        loop[:n, :n] += np.outer(Q, D * C)
        loop[:n, n : n + c] = np.outer(Q, H)
    return loop
