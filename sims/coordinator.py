"""The upper layer alone: exosystem and optimal coordinator, which no agent influences (theory.md sections 1 and
3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy
from numpy.typing import NDArray
from scipy.integrate import DOP853, DenseOutput
from scipy.optimize import brentq

from sims.codegen import ARITHMETIC_ERRORS, CompiledFunction, compile_function
from sims.held_coordinator import Status, held_layer
from sims.signals import Array, PiecewisePolynomial, fit_piece
from symbolic.controller import CoordinatorGains
from symbolic.errors import InputError
from symbolic.network import laplacian
from symbolic.plant import COST_VARIABLE, Plant

MAX_STEPS = 20_000  # the five agents need 45 for 30 s; a coordinator that rings or is stiff would go on for hours


@dataclass(frozen=True)
class UpperLayer:
    """``v, y^r, ζ`` and the diagonal ``ξ_i^i`` over time, in that order in ``signals``.

    ``status`` and ``reason`` say whether the coordinator reached the horizon; ``signals.end`` is how far it came, in
    seconds.
    """

    signals: PiecewisePolynomial
    exosystem_states: int
    agents: int
    status: Status
    reason: str

    def inputs_of(self, number: int) -> list[int]:
        """Rows of ``signals`` that agent ``number`` (1 … N) sees: its ``y^r``, then ``v``."""
        return [self.exosystem_states + number - 1, *range(self.exosystem_states)]


@lru_cache(maxsize=16)
def estimated_optimum(plant: Plant) -> float:
    """``s* = argmin Σ c_i``: the root of ``Σ c_i'``, to 1e-12 relative. Raises ``InputError`` if no sign change is
    found.
    """
    slope = compile_function(
        [[COST_VARIABLE]], [sympy.Add(*(sympy.diff(agent.cost, COST_VARIABLE) for agent in plant.agents))]
    )

    def value(s: float) -> float:
        return slope((s,))[0]

    radius = 1.0
    try:
        while not value(-radius) <= 0.0 <= value(radius) and radius < 1e12:
            radius *= 2
        if value(-radius) <= 0.0 <= value(radius):
            return float(brentq(value, -radius, radius, xtol=1e-15, rtol=1e-13))
    except ARITHMETIC_ERRORS as error:
        raise InputError(f"the slope of the costs cannot be evaluated for |s| <= {radius:g}: {error}") from error
    raise InputError("the sum of the costs has no minimum between -1e12 and 1e12")


@lru_cache(maxsize=8)
def integrate_upper_layer(
    plant: Plant,
    gains: CoordinatorGains,
    start: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]],
    horizon: float,
    rtol: float,
    atol: float,
    escape_radius: float,
) -> UpperLayer:
    """Solve ``v' = S v``, ``ξ' = −L ξ`` and the coordinator from ``start = (v(0), y^r(0), ζ(0))``, ``ξ(0) = I``:

        y^r_i' = −κ c_i'(y^r_i)/ξ_i^i − α1 (L y^r)_i − α2 ζ_i,     ζ' = α1 L y^r,     ξ' = −β L ξ

    (references that wait for the mixing layer: ``sims.held_coordinator``).

    The layer is smooth and not stiff for the gains of practice, and the agents need it between the steps: DOP853 has
    order 8 and an interpolant of order 7, which is kept as a piecewise polynomial. The state has ``n_v + 2N + N²``
    entries. After ``MAX_STEPS`` steps it ends as ``failed``.
    """
    N, nv = plant.digraph.agents, len(plant.exosystem.states)
    if gains.held:
        found = held_layer(plant, gains, start, horizon, rtol, escape_radius)
        return UpperLayer(found.signals, nv, N, found.status, found.reason)
    L = np.array(laplacian(plant.digraph), dtype=float)
    S = np.array(plant.exosystem.S.tolist(), dtype=float).reshape(nv, nv)
    slopes = _cost_slopes(plant)
    alpha1, alpha2 = float(gains.alpha1), float(gains.alpha2)
    kappa, beta = float(gains.gradient_gain), float(gains.mixing_gain)
    diagonal = nv + 2 * N + (N + 1) * np.arange(N)
    kept = np.concatenate([np.arange(nv + 2 * N), diagonal])

    def derivative(t: float, q: Array) -> Array:
        reference, zeta, xi = q[nv : nv + N], q[nv + N : nv + 2 * N], q[nv + 2 * N :].reshape(N, N)
        exchange = alpha1 * (L @ reference)
        descent = kappa * np.array(slopes(reference.tolist())) / np.diagonal(xi)
        return np.concatenate([S @ q[:nv], -descent - exchange - alpha2 * zeta, exchange, -beta * (L @ xi).ravel()])

    initial = np.concatenate([*map(np.array, start), np.eye(N).ravel()])
    breaks: list[float] = [0.0]
    pieces: list[Array] = []
    status: Status = "completed"
    reason = ""
    with np.errstate(all="ignore"):
        try:
            solver = DOP853(derivative, 0.0, initial, horizon, rtol=max(rtol, 1e-13), atol=atol)
            while solver.status == "running" and status == "completed":
                if len(pieces) >= MAX_STEPS:
                    status, reason = (
                        "failed",
                        f"the coordinator does not settle: {MAX_STEPS} steps reach only t = {breaks[-1]:.6g} s "
                        f"of {horizon:g} s",
                    )
                    break
                message = solver.step()
                if solver.status == "failed" or not np.all(np.isfinite(solver.y)):
                    status, reason = (
                        "failed",
                        f"the coordinator's integration stops at t = {breaks[-1]:.6g} s: {message}",
                    )
                    break
                pieces.append(fit_piece(solver.t_old, solver.t, _rows_of(solver.dense_output(), kept)))
                breaks.append(float(solver.t))
                if np.abs(solver.y[nv : nv + 2 * N]).max() > escape_radius:
                    status, reason = "escaped", f"the coordinator exceeds {escape_radius:g} at t = {solver.t:.6g} s"
        except ARITHMETIC_ERRORS as error:
            status, reason = "failed", f"the coordinator cannot be evaluated beyond t = {breaks[-1]:.6g} s: {error}"
    if not pieces:
        breaks, pieces = [0.0, horizon], [np.vstack([initial[kept], np.full((7, len(kept)), np.nan)])]
    return UpperLayer(PiecewisePolynomial(np.array(breaks), np.array(pieces)), nv, N, status, reason)


def _rows_of(dense: DenseOutput, rows: NDArray[np.int_]) -> Callable[[Array], Array]:
    return lambda times: dense(times)[rows]


def _cost_slopes(plant: Plant) -> CompiledFunction:
    symbols = [sympy.Dummy(f"s{agent.id}", real=True) for agent in plant.agents]
    slopes = [
        sympy.diff(agent.cost, COST_VARIABLE).xreplace({COST_VARIABLE: symbol})
        for agent, symbol in zip(plant.agents, symbols, strict=True)
    ]
    return compile_function([symbols], slopes)
