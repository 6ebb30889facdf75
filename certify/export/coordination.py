"""The coordinator in discrete time: explicit Euler with messages that carry stamps (docs/export.md, coordinator)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil

import numpy as np
from flint import ctx

from certify.bounds.conversions import rational_ball
from certify.export.formats import DOUBLE, PRECISION, Constant, constant
from certify.export.gradient import gradient
from certify.export.statements import Let
from symbolic.controller import CoordinatorGains
from symbolic.errors import InputError
from symbolic.network import laplacian
from symbolic.plant import Plant

MIXED = 2.0**-46  # relative: nearer to its limit rounding does not let it come
MOST_ROUNDS = 2**40
LATE = 16  # rounds by which a message may be late, besides those by which the start spreads


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


def coordinator(plant: Plant, gains: CoordinatorGains, period: Fraction) -> Coordinator:
    """Where the references wait for ``ξ``, it mixes as fast as the period allows, and they wait for as long as that
    takes; else ``β`` is the claim's.

    Raises ``InputError`` if ``ξ`` could become zero or negative with this period.
    """
    L = laplacian(plant.digraph)
    degree = max(row[i] for i, row in enumerate(L))
    beta = min(gains.mixing_gain, 1 / (2 * period * degree)) if gains.held else gains.mixing_gain
    if not beta * period * degree < 1:
        limit = 1 / (beta * degree)
        raise InputError(f"coordinator.period: {period} is too long: xi stays positive for less than {limit}")
    mixing = _rounds(np.array(L, dtype=float) * float(beta * period))
    hold = max(ceil(gains.mixing_time / period), mixing) if gains.held else 0
    return Coordinator(period, replace(gains, mixing_gain=beta), hold, mixing)


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
        with ctx.workprec(PRECISION):
            decay = rational_ball(-shared.gains.softening * shared.period).exp()
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
    """The first ``k`` for which ``(I − βτ_c L)^k`` is its limit up to ``MIXED``, relative to its least entry."""
    powers = [np.eye(len(scaled)) - scaled]
    while not _mixed(powers[-1]):
        if 2 ** len(powers) > MOST_ROUNDS:
            raise InputError("coordinator.period: xi mixes too slowly in rounds of this length")
        powers.append(powers[-1] @ powers[-1])
    product, rounds = np.eye(len(scaled)), 0  # the largest number of rounds that is not enough, bit by bit
    for k in reversed(range(len(powers) - 1)):
        longer = product @ powers[k]
        if not _mixed(longer):
            product, rounds = longer, rounds + 2**k
    return rounds + 1


def _mixed(power: np.ndarray) -> bool:
    return bool(np.ptp(power, axis=0).max() <= MIXED * np.abs(power).min())
