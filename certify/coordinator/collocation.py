"""The nominal curve of a coordinator that waited, in floats: Radau collocation in time, stiff or not.

``dy/dt = −(κ/r)(c'(y) − φ c'(y(t_mix))) − α1 L y − α2 ζ``, ``ζ' = α1 L y``. On a stretch ``y`` is a polynomial of
degree ``STAGES`` through its start that satisfies the equation at the Radau points. The stages are decoupled by the
eigenvectors of the differentiation matrix, and ``ζ`` is eliminated: one complex ``N × N`` factorisation per stage and
length of stretch, however stiff the mixing is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev, legendre

from certify.coordinator.structured import System

Array = np.ndarray[Any, np.dtype[np.float64]]

STAGES = 12  # order 23: the reference changes by its own size within a stretch, and the residual stays near rounding
ITERATIONS = 25  # of simplified Newton; a stretch that wants more is halved
CONVERGED = 1e-15  # relative to the largest value
FIRST = 1 / 4  # of the fastest time constant: the first stretch
MOST_STRETCHES = 1500
LONGEST_SOFT = 4  # of 1/ν: what the checker's series of the soft start takes
MOST_LEVELS = 60  # doublings from the first stretch on
ROUNDING = 2.0**-46  # of the fastest rate times the values: no residual in floats is less
DIFFERENTIATED = 2.0**-52 * 8 * STAGES**2  # of the values: what differentiating a polynomial adds, per stretch
GROWTH = 4.0**-1  # of the tolerance: a residual below doubles the stretch


@dataclass(frozen=True)
class Motion:
    """``gradient(y)`` and ``curvature(y)`` of ``κ c_i'/r_i`` for all agents, row by row; ``softening`` is ``ν``."""

    system: System
    gradient: Callable[[Array], Array]
    curvature: Callable[[Array], Array]
    softening: float


@dataclass(frozen=True)
class Piece:
    """Chebyshev coefficients, agents × (STAGES + 1), on a stretch of ``length``; ``defect ≈ ‖ρ‖_P``."""

    length: float
    coefficients: Array
    defect: float

    @property
    def spread(self) -> float:
        """How far an agent may be from its mean on the stretch, at most."""
        return float(np.max(np.sum(np.abs(self.coefficients[:, 1:]), axis=1)))


@cache
def _radau() -> tuple[Array, Array, Array]:
    """Points with −1 in front, differentiation matrix (points × points with the start), values → Chebyshev."""
    series = np.zeros(STAGES + 1)
    series[STAGES - 1], series[STAGES] = 1, -1
    inner = np.sort(legendre.legroots(series).real)
    points = np.concatenate([[-1.0], inner])
    points[-1] = 1.0
    to_coefficients = np.linalg.inv(chebyshev.chebvander(points, STAGES))
    derivative = np.array([chebyshev.chebder(row) for row in np.eye(STAGES + 1)])
    D = chebyshev.chebvander(points[1:], STAGES - 1) @ derivative.T @ to_coefficients
    return points, D, to_coefficients


@dataclass(frozen=True)
class _Solver:
    """The linearised stages of one length: factors per eigenvalue."""

    factors: tuple[Any, ...]
    values: Any
    vectors: Any
    inverse: Any


class Collocation:
    """Walks along the curve from ``y`` and ``ζ = 0``."""

    def __init__(self, motion: Motion, start: Array, scale: float) -> None:
        self.motion, self.system = motion, motion.system
        self.y, self.integral, self.time = start.copy(), np.zeros(len(start)), 0.0
        self.first_gradient = motion.gradient(start)
        self.scale = max(float(np.max(np.abs(start))), scale)
        self.solvers: dict[tuple[float, bytes], _Solver] = {}

    @cached_property
    def checks(self) -> tuple[Any, Any, Any]:
        """Between the collocation points: values, derivative and integral of the coefficients there."""
        points = np.cos(np.pi * np.arange(2 * STAGES + 2) / (2 * STAGES + 1))
        derivative = np.array([chebyshev.chebder(row) for row in np.eye(STAGES + 1)])
        integral = np.array([chebyshev.chebint(row, lbnd=-1) for row in np.eye(STAGES + 1)])
        return (
            chebyshev.chebvander(points, STAGES),
            chebyshev.chebvander(points, STAGES - 1) @ derivative.T,
            chebyshev.chebvander(points, STAGES + 1) @ integral.T,
        )

    def attempt(self, length: float) -> Piece | None:
        """One stretch; ``None`` if the iteration does not converge."""
        points, D, to_coefficients = _radau()
        half, s = length / 2, self.system
        slope = self.motion.curvature(self.y)
        solver = self._solver(length, slope)
        phi = self._softness(half * (1 + points[1:]))
        values = np.tile(self.y, (STAGES, 1))
        integrate = np.linalg.inv(D[:, 1:])
        for _ in range(ITERATIONS):
            force = np.multiply.outer(phi, self.first_gradient) - self.motion.gradient(values)
            travelled = half * (integrate @ (values))
            flow = s.alpha1 * (values + s.alpha2 * (self.integral + travelled)) @ s.laplacian.T
            residual = half * (force - flow) - (D[:, 1:] @ values + np.outer(D[:, 0], self.y))
            update = self._solve(solver, residual)
            values = values + update
            size = float(np.max(np.abs(update)))
            self.scale = max(self.scale, float(np.max(np.abs(values))))
            if not np.isfinite(size) or size > 1e6 * self.scale:
                return None
            if size <= CONVERGED * self.scale:
                break
        else:
            if size > 1e3 * CONVERGED * self.scale:
                return None
        coefficients = (to_coefficients @ np.vstack([self.y, values])).T
        return Piece(length, coefficients, self._defect(length, coefficients))

    def _softness(self, later: Array) -> Array:
        """``φ`` at times after the start of the stretch."""
        if not self.motion.softening:
            return np.zeros(len(later))
        return np.asarray(np.exp(-self.motion.softening * (self.time + later)))

    def accept(self, piece: Piece) -> None:
        half = piece.length / 2
        integral = np.array([chebyshev.chebint(row, lbnd=-1) for row in np.eye(STAGES + 1)]).sum(axis=1)
        self.integral = self.integral + half * piece.coefficients @ integral
        self.y = piece.coefficients.sum(axis=1)
        self.time += piece.length

    def zeta(self) -> Array:
        return self.system.alpha1 * self.system.laplacian @ self.integral

    def _defect(self, length: float, coefficients: Array) -> float:
        """``sup ‖ρ‖_P`` at the points between."""
        values, derivative, integral = self.checks
        half, s = length / 2, self.system
        points = np.cos(np.pi * np.arange(2 * STAGES + 2) / (2 * STAGES + 1))
        y = (coefficients @ values.T).T
        memory = self.integral + half * (coefficients @ integral.T).T
        force = self.motion.gradient(y) - np.multiply.outer(self._softness(half * (1 + points)), self.first_gradient)
        rate = (coefficients @ derivative.T).T / half
        rho = rate + force + s.alpha1 * (y + s.alpha2 * memory) @ s.laplacian.T
        return float(np.max(np.sqrt((rho**2) @ s.r)))

    def _solver(self, length: float, slope: Array) -> _Solver:
        from scipy.linalg import lu_factor

        key = (length, slope.tobytes())
        if key not in self.solvers:
            _, D, _ = _radau()
            values, vectors = np.linalg.eig(D[:, 1:])
            half, s = length / 2, self.system
            local = half * (np.diag(slope) + s.alpha1 * s.laplacian)
            memory = half**2 * s.alpha1 * s.alpha2 * s.laplacian
            identity = np.eye(len(self.y))
            factors = tuple(
                lu_factor(value * identity + local + memory / value) if value.imag >= 0 else None for value in values
            )
            if len(self.solvers) > 40:
                self.solvers.clear()
            self.solvers[key] = _Solver(factors, values, vectors, np.linalg.inv(vectors))
        return self.solvers[key]

    def _solve(self, solver: _Solver, residual: Array) -> Array:
        from scipy.linalg import lu_solve

        right = solver.inverse @ residual
        found = np.zeros_like(right)
        for k, factor in enumerate(solver.factors):
            if factor is not None:
                found[k] = lu_solve(factor, right[k])
        for k, value in enumerate(solver.values):
            if value.imag < 0:
                twin = int(np.argmin(np.abs(solver.values - value.conjugate())))
                found[k] = found[twin].conj()
        return (solver.vectors @ found).real


def walk(
    motion: Motion,
    start: Array,
    scale: float,
    base: float,
    tolerance: float,
    done: Callable[[Collocation], bool],
    most_spread: float = np.inf,
) -> list[Piece] | None:
    """Stretches of ``base·2^k``, each with a residual below the tolerance and no agent moving by more
    than about ``most_spread``, until ``done``; ``None`` if it never is."""
    collocation, pieces = Collocation(motion, start, scale), list[Piece]()
    s = motion.system
    fastest = float(np.max(2 * s.alpha1 * np.diag(s.laplacian) + s.high)) + motion.softening
    level = int(np.floor(np.log2(FIRST / fastest / base)))
    highest = (
        int(np.floor(np.log2(LONGEST_SOFT / motion.softening / base))) if motion.softening else level + MOST_LEVELS
    )
    while not done(collocation):
        if len(pieces) >= MOST_STRETCHES:
            return None
        length = base * 2.0**level
        piece = collocation.attempt(length)
        allowed = max(tolerance, collocation.scale * (ROUNDING * fastest + DIFFERENTIATED / length))
        if piece is None or piece.defect > allowed or piece.spread > most_spread:
            level -= 1
            if level < highest - 2 * MOST_LEVELS:
                return None
            continue
        collocation.accept(piece)
        pieces.append(piece)
        if piece.defect < GROWTH * allowed:
            level = min(level + 1, highest)
    return pieces


def stacked(rows: Sequence[Callable[[Array], Array]]) -> Callable[[Array], Array]:
    """Row functions, one per agent, on arrays whose last axis is the agents."""
    return lambda y: np.stack([row(y[..., i]) for i, row in enumerate(rows)], axis=-1)
