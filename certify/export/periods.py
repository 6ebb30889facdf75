"""Periods where nobody names one: a rule of thumb on the safe side, about which nothing is proved (docs/export.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from certify.curvature import Curvature, cost_curvature
from certify.export.sampled_stability import SampledLoop
from symbolic.controller import AgentController, CoordinatorGains
from symbolic.errors import InputError
from symbolic.network import laplacian, left_null_vector
from symbolic.plant import Agent, Plant

SAMPLES_PER_PERIOD = 20  # of the fastest rate: the usual rule asks for 10 to 20
MARGIN = 5  # between the period and one at which the linearised sampled loop looks stable
MOST_SHORTENINGS = 30  # ten decades
ROUNDS_PER_TIME_CONSTANT = 2  # of a bound on the fastest rate of the coordinator; Euler itself would bear one half


def sampling_period(agents: Sequence[Agent], laws: Sequence[AgentController], loops: Sequence[SampledLoop]) -> Fraction:
    """One period for all agents, in seconds: 1, 2 or 5 times a power of ten, whose quintuple still looks stable."""
    fastest = max(_fastest(agent, law) for agent, law in zip(agents, laws, strict=True))
    period = round_number(2 * math.pi / (SAMPLES_PER_PERIOD * fastest))
    for _ in range(MOST_SHORTENINGS):
        if all(loop.looks_stable(MARGIN * period) for loop in loops):
            return period
        period = round_number(0.99 * float(period))
    raise InputError("no sampling period was found for which the sampled loop looks stable; give one by --period")


def longest_round(plant: Plant, gains: CoordinatorGains) -> float:
    """A period of the coordinator on the safe side, in seconds; ``gains`` are the claim's."""
    L = np.array(laplacian(plant.digraph), dtype=float)
    degree = float(L.diagonal().max())
    found = [cost_curvature(agent.cost) for agent in plant.agents]
    curvature = max(float(c.upper) for c in found if isinstance(c, Curvature))
    damping = float(gains.gradient_gain) * curvature / _least_share(plant, L, gains.held)
    fastest = 2 * float(gains.alpha1) * degree + float(gains.alpha2) + damping
    if not gains.held:  # else the mixing layer takes the time that it needs
        fastest = max(fastest, 2 * float(gains.mixing_gain) * degree)
    return 1 / (ROUNDS_PER_TIME_CONSTANT * fastest)


def coordinator_period(longest: float, period: Fraction) -> Fraction:
    """The largest multiple of ``period`` that is not above ``longest``, and ``period`` itself if there is none."""
    return max(1, int(longest / float(period))) * period


def _least_share(plant: Plant, L: np.ndarray, held: bool) -> float:
    """About the least ``ξ_i^i`` while the references move: ``r_i`` where they wait for it, else on the way from 1."""
    if held:
        return float(min(left_null_vector(plant.digraph)))
    step = np.eye(len(L)) - L / (8 * L.diagonal().max())
    X, least = np.eye(len(L)), 1.0
    for _ in range(64 * len(L)):
        X = step @ X
        least = min(least, float(X.diagonal().min()))
    return least


def _fastest(agent: Agent, law: AgentController) -> float:
    """In rad/s: ``bK``, ``g``, and the poles of the internal model with its input open and closed.

    Not those of the observer: in discrete time it has them at any period, and the faster they are the nearer to 0.
    """
    rates = [float(law.g), float(law.K) * _largest_gain(agent)]
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
