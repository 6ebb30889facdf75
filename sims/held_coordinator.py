"""References that wait for the mixing layer: held until ``t_mix``, then by collocation (docs/coordinator.md).

The mixing layer has settled to ``2^−40`` by ``t_mix``, so that ``ξ_i^i`` is ``r_i`` in floats from then on. What this
costs does not depend on how much faster the messages are than the references.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import sympy
from numpy.polynomial import chebyshev
from scipy.linalg import expm

from certify.bounds.float_values import float_function
from certify.coordinator.collocation import Collocation, Motion, Piece, stacked, walk
from certify.coordinator.structured import System
from sims.signals import Array, PiecewisePolynomial, fit_piece
from symbolic.controller import CoordinatorGains
from symbolic.network import laplacian
from symbolic.plant import COST_VARIABLE, Plant

Status = Literal["completed", "escaped", "failed"]

PARTS = 4  # of a stretch, each a polynomial of degree 7: as accurate as one of degree 12 on the whole
TURN = 0.5  # radians of the fastest sine of the exosystem per part
FIRST_MIXED = 1 / 8  # of the fastest time constant of the mixing layer: its first part; the next are twice as long
DEFECT = 1e-2  # of rtol: the residual, relative to how fast the references can move


@dataclass(frozen=True)
class HeldLayer:
    """``v, y^r, ζ`` and the diagonal of ``ξ``, and whether the horizon was reached."""

    signals: PiecewisePolynomial
    status: Status
    reason: str


def held_layer(
    plant: Plant,
    gains: CoordinatorGains,
    start: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]],
    horizon: float,
    rtol: float,
    escape_radius: float,
) -> HeldLayer:
    """From ``start = (v(0), y^r(0), ζ(0))`` to the horizon. A ``ζ(0)`` that is not zero stays as an offset."""
    L = np.array(laplacian(plant.digraph), dtype=float)
    flow = _Exosystem(plant, np.array(start[0]))
    y0, offset = np.array(start[1]), np.array(start[2])
    wait, beta = float(gains.mixing_time), float(gains.mixing_gain)
    breaks, pieces = [0.0], list[Array]()

    def extend(end: float, rest: Callable[[Array], Array]) -> None:
        begin = breaks[-1]
        parts = max(1, int(np.ceil((end - begin) * flow.fastest / TURN)))
        for k in range(parts):
            left, right = begin + (end - begin) * k / parts, begin + (end - begin) * (k + 1) / parts
            pieces.append(fit_piece(left, right, lambda t: np.vstack([flow(t), rest(t)])))
            breaks.append(right)

    def held(t: Array) -> Array:
        mixed = np.array([np.diagonal(expm(-beta * time * L)) for time in t]).T
        still = np.repeat(np.concatenate([y0, offset])[:, None], len(t), axis=1)
        return np.vstack([still, mixed])

    length = FIRST_MIXED / (2 * beta * float(np.max(np.diag(L))))
    while breaks[-1] < min(wait, horizon):
        extend(min(breaks[-1] + length, wait, horizon), held)
        length *= 2
    if horizon <= wait:
        return HeldLayer(PiecewisePolynomial(np.array(breaks), np.array(pieces)), "completed", "")
    r = np.diagonal(expm(-beta * wait * L)).copy()
    motion = _motion(plant, gains, L, r, offset)
    escaped = False

    def done(at: Collocation) -> bool:
        nonlocal escaped
        escaped = bool(np.max(np.abs(at.y)) > escape_radius)
        return escaped or wait + at.time >= horizon

    pace = motion.system.pace
    way = float(np.max(np.abs(motion.gradient(y0)))) / float(np.max(motion.system.high))  # to where the pull ends
    scale = max(float(np.max(np.abs(y0))), way) or 1.0
    found = walk(motion, y0, scale, 1 / pace, DEFECT * rtol * pace * scale, done)
    for piece, zeta in _with_memory(found or [], motion.system, offset):
        left = breaks[-1]
        for k in range(PARTS):
            extend(left + piece.length * (k + 1) / PARTS, _Along(piece, zeta, left, r))
    if found is None:
        reason = f"the coordinator could not be followed beyond t = {breaks[-1]:.6g}"
        return HeldLayer(PiecewisePolynomial(np.array(breaks), np.array(pieces)), "failed", reason)
    status: Status = "escaped" if escaped else "completed"
    reason = f"the coordinator exceeds {escape_radius:g} at t = {breaks[-1]:.6g}" if escaped else ""
    return HeldLayer(PiecewisePolynomial(np.array(breaks), np.array(pieces)), status, reason)


class _Exosystem:
    """``v(t) = e^(St) v(0)``."""

    def __init__(self, plant: Plant, v0: Array) -> None:
        n = len(plant.exosystem.states)
        self.S, self.v0 = np.array(plant.exosystem.S.tolist(), dtype=float).reshape(n, n), v0
        self.fastest = float(np.max(np.abs(np.linalg.eigvals(self.S)))) if n else 0.0

    def __call__(self, t: Array) -> Array:
        if not len(self.v0):
            return np.zeros((0, len(t)))
        return np.array([expm(self.S * time) @ self.v0 for time in t]).T


@dataclass(frozen=True)
class _Along:
    """``y, ζ, ξ`` on one stretch that begins at ``start``."""

    piece: Piece
    zeta: Array
    start: float
    r: Array

    def __call__(self, t: Array) -> Array:
        sigma = 2 * (t - self.start) / self.piece.length - 1
        y = chebyshev.chebval(sigma, self.piece.coefficients.T)
        zeta = chebyshev.chebval(sigma, self.zeta.T)
        return np.vstack([y, zeta, np.repeat(self.r[:, None], len(t), axis=1)])


def _with_memory(pieces: list[Piece], system: System, offset: Array) -> list[tuple[Piece, Array]]:
    """Every stretch with the Chebyshev coefficients of ``ζ = ζ(0) + α1 L ∫y``."""
    found, integral = [], np.zeros(len(offset))
    for piece in pieces:
        antiderivative = piece.length / 2 * chebyshev.chebint(piece.coefficients.T, lbnd=-1).T
        zeta = system.alpha1 * system.laplacian @ antiderivative
        zeta[:, 0] += offset + system.alpha1 * system.laplacian @ integral
        integral = integral + antiderivative.sum(axis=1)
        found.append((piece, zeta))
    return found


def _motion(plant: Plant, gains: CoordinatorGains, L: Array, r: Array, offset: Array) -> Motion:
    """The coordinator after ``t_mix``; an offset of ``ζ`` acts as a constant force."""
    kappa, alpha2 = float(gains.gradient_gain), float(gains.alpha2)
    first = [sympy.diff(agent.cost, COST_VARIABLE) for agent in plant.agents]
    slopes = stacked([float_function(slope, COST_VARIABLE) for slope in first])
    bends = stacked([float_function(sympy.diff(slope, COST_VARIABLE), COST_VARIABLE) for slope in first])
    damping = kappa * bends(np.zeros(len(r))) / r
    system = System(L, r, damping, damping, float(gains.alpha1), alpha2)
    return Motion(
        system,
        lambda y: kappa * slopes(y) / r + alpha2 * offset,
        lambda y: kappa * bends(y) / r,
        float(gains.softening),
    )
