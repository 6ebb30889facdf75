"""Periods where nobody names one: a rule of thumb on the safe side, about which nothing is proved (docs/export.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from certify.curvature import Curvature, cost_curvature
from certify.export.coordination import CoordinatorGains
from certify.export.sampled_stability import SampledLoop
from symbolic.controller import AgentController
from symbolic.errors import InputError
from symbolic.network import laplacian
from symbolic.plant import Agent, Plant

SAMPLES_PER_PERIOD = 20  # of the fastest pole: the usual rule asks for 10 to 20
MARGIN = 5  # between the period and one at which the linearised sampled loop looks stable
MOST_SHORTENINGS = 30  # ten decades
ROUNDS_PER_TIME_CONSTANT = 4  # of the fastest rate of the coordinator; Euler itself would bear one half


def sampling_period(agents: Sequence[Agent], laws: Sequence[AgentController], loops: Sequence[SampledLoop]) -> Fraction:
    """One period for all agents, in seconds: 1, 2 or 5 times a power of ten, whose quintuple still looks stable."""
    fastest = max(_fastest(agent, law) for agent, law in zip(agents, laws, strict=True))
    period = round_number(2 * math.pi / (SAMPLES_PER_PERIOD * fastest))
    for _ in range(MOST_SHORTENINGS):
        if all(loop.looks_stable(MARGIN * period) for loop in loops):
            return period
        period = round_number(0.99 * float(period))
    raise InputError("no sampling period was found for which the sampled loop looks stable; give one by --period")


def coordinator_period(plant: Plant, gains: CoordinatorGains, period: Fraction) -> Fraction:
    """A multiple of ``period``; ``gains`` are the claim's."""
    L = np.array(laplacian(plant.digraph), dtype=float)
    degree = float(L.diagonal().max())
    found = [cost_curvature(agent.cost) for agent in plant.agents]
    curvature = max(float(c.upper) for c in found if isinstance(c, Curvature))
    damping = float(gains.gradient_gain) * curvature / _least_share(L)
    fastest = 2 * float(gains.alpha1) * degree + float(gains.alpha2) + damping
    fastest = max(fastest, 2 * float(gains.mixing_gain) * degree)
    return max(1, int(1 / (ROUNDS_PER_TIME_CONSTANT * fastest) / float(period))) * period


def _least_share(L: np.ndarray) -> float:
    """About the least ``ξ_i^i`` on the way from 1 to ``r_i``."""
    step = np.eye(len(L)) - L / (8 * L.diagonal().max())
    X, least = np.eye(len(L)), 1.0
    for _ in range(64 * len(L)):
        X = step @ X
        least = min(least, float(X.diagonal().min()))
    return least


def _fastest(agent: Agent, law: AgentController) -> float:
    """In rad/s: poles of the observer, ``bK``, ``g``, and the poles of the internal model with its input open and
    closed."""
    rates = [float(law.g), float(law.K) * _largest_gain(agent)]
    if law.h is not None:
        roots = np.roots([1.0, *(float(c) for c in reversed(law.observer))])
        rates.append(float(law.h) * float(np.abs(roots).max()))
    if law.N:
        M, N, psi = (np.array(part, dtype=float) for part in (law.M, law.N, law.psi))
        rates += [float(np.abs(np.linalg.eigvals(A)).max()) for A in (M, M + np.outer(N, psi))]
    return max(rates)


def _largest_gain(agent: Agent) -> float:
    """``b(w)`` at the corners of ``W``, in floats; all of at most 2^10 corners."""
    names = [p for p in agent.parameters if p in agent.b.free_symbols][:10]
    sides = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    values = []
    for corner in range(2 ** len(names)):
        at = {p: (sides[p].hi if corner >> k & 1 else sides[p].lo) for k, p in enumerate(names)}
        rest = {p: (sides[p].lo + sides[p].hi) / 2 for p in agent.parameters if p not in at}
        values.append(float(agent.b.subs({p: float(value) for p, value in (at | rest).items()})))
    return max(values)


def round_number(value: float) -> Fraction:
    """The largest of 1, 2 and 5 times a power of ten that is not above ``value``."""
    power = math.floor(math.log10(value))
    digit = next(d for d in (5, 2, 1) if d * 10.0**power <= value * (1 + 1e-12))
    return digit * Fraction(10) ** power
