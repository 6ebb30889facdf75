"""Phase 1: the observer peaks and only ``|ū| ≤ δ`` is used (docs/certificate-direct.md section 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import cvxpy as cp
import numpy as np

from certify.agent_model import AgentModel, Matrix
from certify.bounds.rationals import round_down
from certify.inequalities.lyapunov import why_not_lyapunov
from certify.inequalities.matrices import scale, to_float
from certify.inequalities.rounding import roundings
from certify.inequalities.semidefinite import solve
from certify.tube.increments import Increments, residuals
from certify.tube.surroundings import Moment, Surroundings, steady_trajectory_range

STEPS = 8
INFLATION = 1.05
MARGIN = 1.002
RATE_SHARE = 0.99
NORM_SHARES = (0.4, 0.6, 0.8, 0.9, 0.95)


@dataclass(frozen=True)
class InitialMagnitudes:
    """``|z̄(0)|, |x̄(0)|, |η̄(0)|`` and ``|x_k(0) − x̃_k(0)|`` over the initial set."""

    z: np.ndarray
    x: np.ndarray
    eta: np.ndarray
    estimate: np.ndarray


@dataclass(frozen=True)
class ObserverNorm:
    """``E3ᵀP + PE3 + 2κP ⪯ 0``, proved for the exact values; ``√(P⁻¹)_ii`` and ``√P_nn`` are what the error bound
    needs."""

    exact: Matrix
    exact_rate: Fraction

    @property
    def P(self) -> np.ndarray:
        return to_float(self.exact)

    @property
    def rate(self) -> float:
        return float(self.exact_rate)

    @property
    def dual(self) -> np.ndarray:
        return np.sqrt(np.diag(np.linalg.inv(self.P)))


def initial_magnitudes(model: AgentModel, surroundings: Surroundings) -> InitialMagnitudes:
    start, agent = surroundings.at_start(), model.agent
    z = [
        max(abs(float(side.hi) - steady[0]), abs(float(side.lo) - steady[1]))
        for side, steady in zip(agent.initial.z, start.steady, strict=True)
    ]
    x = [float(side.magnitude) for side in agent.initial.x]
    first, reference = agent.initial.x[0], agent.initial.reference
    x[0] = float(max(abs(first.hi - reference.lo), abs(first.lo - reference.hi)))
    if agent.initial.observer is None:
        estimate = [0.0, *(float(side.magnitude) for side in agent.initial.x[1:])]
    else:
        pairs = zip(agent.initial.x, agent.initial.observer, strict=True)
        estimate = [float(max(abs(a.hi - o.lo), abs(a.lo - o.hi))) for a, o in pairs]
    return InitialMagnitudes(np.array(z), np.array(x), steady_trajectory_range(model), np.array(estimate))


def observer_norms(observer: Matrix) -> tuple[ObserverNorm, ...]:
    """For several decay rates the norm with the least bound of the last component driven by ``e_n``.

    A fast norm forgets the initial error sooner, a slow one bounds what the plant stirs up better.
    """
    slowest = -float(np.linalg.eigvals(to_float(observer)).real.max())
    found = (_observer_norm(observer, share * slowest) for share in NORM_SHARES)
    return tuple(norm for norm in found if norm is not None)


def _observer_norm(observer: Matrix, rate: float) -> ObserverNorm | None:
    size, E3 = len(observer), to_float(observer)
    B, C = np.eye(size)[:, [-1]], np.eye(size)[-1]
    Q = cp.Variable((size, size), symmetric=True)
    constraints = [
        E3 @ Q + Q @ E3.T + 2 * rate * Q << -1e-6 * np.eye(size),
        cp.bmat([[np.ones((1, 1)), B.T], [B, Q]]) >> 0,
    ]
    outcome = solve(cp.Problem(cp.Minimize(cp.sum(C @ Q @ C) + 1e-3 * cp.trace(Q)), constraints))
    if not outcome.has_values or Q.value is None:
        return None
    P = np.linalg.inv(Q.value)
    exact_rate, zero = round_down(Fraction(RATE_SHARE * rate), 12), scale(0, observer)
    for exact in roundings((P + P.T) / 2):
        if why_not_lyapunov([observer], exact, zero, exact_rate) is None:
            return ObserverNorm(exact, exact_rate)
    return None


@dataclass(frozen=True)
class Peaked:
    """Magnitudes of ``X = (z̄, x̄, η̄, e)`` at ``T1``, and the norm of the observer error that gave them."""

    duration: float
    state: np.ndarray
    norm: ObserverNorm | None = None


def peaking(
    increments: Increments,
    surroundings: Surroundings,
    start: InitialMagnitudes,
    norms: Sequence[ObserverNorm],
    h: float,
    delta: float,
    duration: float,
) -> tuple[Peaked, ...]:
    """Follow the magnitudes over ``[0, duration]``, one result for each norm; none if a step has no box."""
    model = increments.model
    im, n = model.internal_model, model.order
    psi, N = np.array([float(x) for x in im.psi]), np.array([float(x) for x in im.N])
    drift = np.abs(np.array([[float(x) for x in row] for row in im.M]).reshape(len(N), len(N)) + np.outer(N, psi))
    nz = increments.zeros
    none0, none1 = np.zeros((nz, nz + 1)), np.zeros(nz + n)
    state = np.concatenate([start.z, start.x, start.eta])
    length = duration / STEPS
    fastest = 0.0
    b = max(abs(side) for side in increments.b)

    def rate_at(moment: Moment, box: np.ndarray) -> np.ndarray:
        z, x, eta = box[:nz], box[nz : nz + n], box[nz + n :]
        S, s = residuals(increments.slopes(z, x, moment), none0, none1, nz)
        q = S @ box[: nz + n] + s * moment.deviation
        speed = np.concatenate(
            [q[:nz], x[1:], [q[nz] + b * (delta + np.abs(psi) @ eta)], drift @ eta + np.abs(N) * delta]
        )
        speed[nz] += moment.rate if n > 1 else 0.0
        return speed * MARGIN

    moment = surroundings.during(0.0, 2.0 ** np.ceil(np.log2(duration))) if duration > 0 else surroundings.at_start()
    for _ in range(STEPS if duration > 0 else 0):
        box = state * INFLATION + 1e-9
        for _ in range(40):
            speed = rate_at(moment, box)
            following = state + length * speed
            if np.all(following <= box):
                break
            box = np.maximum(box, following * INFLATION)
            if not np.all(np.isfinite(box)) or box.max() > 1e9:
                return ()
        else:
            return ()
        fastest = max(fastest, float(speed[nz + n - 1]))
        state = following
    initial = start.estimate * h ** np.arange(n - 1, -1, -1)
    if duration == 0:
        return (Peaked(0.0, np.concatenate([state, initial]), norms[0]),)
    return tuple(
        Peaked(duration, np.concatenate([state, _estimation_error(norm, initial, fastest, h, duration)]), norm)
        for norm in norms
    )


def _estimation_error(norm: ObserverNorm, initial: np.ndarray, fastest: float, h: float, duration: float) -> np.ndarray:
    """``|e_i(T1)|`` when ``|ẋ_n| ≤ fastest``."""
    energy = float(np.sqrt(initial @ np.abs(norm.P) @ initial))
    size = np.exp(-norm.rate * h * duration) * energy + np.sqrt(norm.P[-1, -1]) * fastest / (norm.rate * h)
    return norm.dual * size * MARGIN
