"""The coordinator in discrete time: explicit Euler with messages that carry stamps (docs/export.md, coordinator)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Any

import numpy as np

from certify.export.formats import DOUBLE, Constant, constant
from certify.export.gradient import gradient
from certify.export.statements import Let
from symbolic.errors import InputError
from symbolic.network import laplacian
from symbolic.plant import Plant

MIXED = 2.0**-40  # relative; after as many rounds again it is the square of that, nearer than a double gets
MOST_ROUNDS = 2**40
LATE = 16  # rounds by which a message may be late, besides those by which the start spreads


@dataclass(frozen=True)
class CoordinatorGains:
    """``α1, α2, κ, β, t_mix, ν`` of a claim; those that it does not have are the paper's."""

    alpha1: Fraction
    alpha2: Fraction
    gradient_gain: Fraction
    mixing_gain: Fraction
    mixing_time: Fraction
    softening: Fraction


@dataclass(frozen=True)
class Coordinator:
    """What the coordinators of all agents share, in steps of ``period`` seconds.

    For ``hold`` rounds ``y^r`` and ``ω`` stay at their starts; after ``mixing`` rounds ``ξ`` is frozen.
    """

    period: Fraction
    gains: CoordinatorGains
    hold: int
    mixing: int


@dataclass(frozen=True)
class CoordinatorProgram:
    """The coordinator of one agent: ``neighbours`` are the agents that it hears, ``history`` the
    rounds that are remembered; ``slope`` ends with ``c'(s)``."""

    agents: int
    history: int
    hold: int
    mixing: int
    soft: bool
    neighbours: tuple[int, ...]
    weights: tuple[Constant, ...]
    constants: tuple[Constant, ...]
    slope_constants: tuple[Constant, ...]
    slope: tuple[Let, ...]


def coordinator_gains(claim: Mapping[str, Any]) -> CoordinatorGains:
    """Of a verified claim."""

    def read(key: str, default: int = 0) -> Fraction:
        return Fraction(claim.get(key) or default)

    return CoordinatorGains(
        read("alpha1"),
        read("alpha2"),
        read("gradient_gain", 1),
        read("mixing_gain", 1),
        read("mixing_time"),
        read("softening"),
    )


def coordinator(plant: Plant, gains: CoordinatorGains, period: Fraction) -> Coordinator:
    """Raises ``InputError`` if ``ξ`` could become zero or negative with this period."""
    beta = gains.mixing_gain
    L = laplacian(plant.digraph)
    degree = max(row[i] for i, row in enumerate(L))
    if not beta * period * degree < 1:
        limit = 1 / (beta * degree)
        raise InputError(f"coordinator.period: {period} is too long: xi stays positive for less than {limit}")
    return Coordinator(
        period,
        gains,
        hold=ceil(gains.mixing_time / period),
        mixing=_rounds(np.array(L, dtype=float) * float(beta * period)),
    )


def coordinator_program(plant: Plant, shared: Coordinator, number: int) -> CoordinatorProgram:
    """Of agent ``number`` (from 1)."""
    edges = sorted((edge.source, edge.weight) for edge in plant.digraph.edges if edge.target == number)
    named = {
        "ALPHA1": ("alpha1", shared.gains.alpha1),
        "ALPHA2": ("alpha2", shared.gains.alpha2),
        "KAPPA": ("gradient gain kappa", shared.gains.gradient_gain),
        "BETA": ("mixing gain beta", shared.gains.mixing_gain),
        "ROUND": ("period of the coordinator", shared.period),
    }
    constants = [constant(name, meaning, value, DOUBLE) for name, (meaning, value) in named.items()]
    if shared.gains.softening:
        decay = Fraction(float(np.exp(-float(shared.gains.softening * shared.period))))
        constants.append(constant("SOFTER", "decay of the soft start in one round", decay, DOUBLE))
    slope_constants, slope = gradient(plant.agents[number - 1].cost)
    return CoordinatorProgram(
        plant.digraph.agents,
        plant.digraph.agents + LATE,  # the start spreads in at most one round per agent
        shared.hold,
        shared.mixing,
        bool(shared.gains.softening),
        tuple(source for source, _ in edges),
        tuple(constant(f"A_{source}", f"weight of agent {source}", weight, DOUBLE) for source, weight in edges),
        tuple(constants),
        slope_constants,
        slope,
    )


def _rounds(scaled: np.ndarray) -> int:
    """Rounds after which ``(I − βτ_c L)^k`` is its limit ``1 rᵀ`` up to rounding: a power of two, by squaring."""
    power, rounds = np.eye(len(scaled)) - scaled, 1
    while rounds < MOST_ROUNDS:
        if np.ptp(power, axis=0).max() <= MIXED * np.abs(power).min():
            return 2 * rounds
        power, rounds = power @ power, 2 * rounds
    raise InputError("coordinator.period: xi mixes too slowly in rounds of this length")
