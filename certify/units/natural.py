"""Units in which an agent's loop looks like any other: rates near one, an input gain near one, states near one
(docs/units.md section 4). Estimates throughout: any units are right, these are good."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

import numpy as np

from certify.agent_model import AgentModel
from certify.coordinator.envelope import Envelope
from certify.inequalities.rounding import power_of_two
from certify.tube.increments import Increments, Slopes
from certify.tube.ranges import Range, magnitude
from certify.tube.reaching import InitialMagnitudes, initial_magnitudes
from certify.tube.surroundings import Surroundings
from certify.units.scales import ONE, Scales

EASY = 64  # growth or friction this much faster than what is followed leaves the ladder of gains where it is
STANDING = 1e-9  # of where output and optimum are: references with less of a way are at rest, but for rounding
LONGEST = 200  # binary orders of magnitude: beyond them floats are near their ends


def natural_scales(model: AgentModel, envelope: Envelope, index: int) -> Scales:
    """Time from what is to be followed (references, exosystem) or, if that is faster by far, from what grows by
    itself; the output from its way; the input from ``b`` and from
    what the plant opposes to it; zero states from where the output takes them."""
    surroundings, increments = Surroundings(model, envelope, index), Increments(model)
    initial = initial_magnitudes(model, surroundings)
    slopes = increments.slopes(np.zeros(increments.zeros), np.zeros(model.order), surroundings.later())
    way = float(model.references.peak)
    if way <= STANDING * max(float(initial.x[0]), magnitude(surroundings.optimum)):
        way = 0.0
    speed = max(_following(envelope, surroundings, way > 0), _growth(slopes, increments) / EASY)
    if not speed > 0:
        speed = _settling(slopes, increments)
    time = 1 / _near(speed)
    way = max(float(initial.x[0]), way)
    pushed = max(
        *(x * float(time) ** k for k, x in enumerate(initial.x)), _push(model, initial, increments, float(time))
    )
    output = _near(way or pushed)
    b = _near(float(np.sqrt(increments.b[0] * increments.b[1])))
    resistance = _near(max(1.0, _resistance(slopes, float(time)) / EASY))
    zeros = tuple(_near(size) for size in _zero_sizes(slopes, initial, float(output)))
    return Scales(time, output, zeros, resistance * output / time**model.order / b, model.order)


def _following(envelope: Envelope, surroundings: Surroundings, moving: bool) -> float:
    """The rate at which the references approach the optimum, all agents together, or the fastest of the exosystem's
    frequencies if that is more. A reference that decays like ``e^(−at)`` has ``peak²/(2 energy) = a``."""
    peaks = sum(float(agent.peak) ** 2 for agent in envelope.agents)
    energy = sum(float(agent.energy) for agent in envelope.agents)
    references = peaks / (2 * energy) if moving and energy > 0 else 0.0
    return max([references, *np.abs(surroundings.spectrum).tolist()])


def _push(model: AgentModel, initial: InitialMagnitudes, increments: Increments, time: float) -> float:
    """How far an input that the internal model has yet to find moves the output in a unit of time."""
    psi = np.array([float(entry) for entry in model.internal_model.psi])
    return float(increments.b[1] * np.abs(psi) @ initial.eta) * time**model.order if len(psi) else 0.0


def _growth(slopes: Slopes, increments: Increments) -> float:
    """``x^(n) = D_k x^(k−1)`` with ``D_k > 0`` grows at the rate ``D_k^(1/(n−k+1))``."""
    n = increments.order
    return max(max(side[1], 0.0) ** (1 / (n - k)) for k, side in enumerate(slopes.f1[increments.zeros :]))


def _resistance(slopes: Slopes, time: float) -> float:
    """What friction takes of the input before ``x_n`` moves: the slope in ``x_n`` against the rate that is wanted."""
    return magnitude(slopes.f1[-1]) * time


def _settling(slopes: Slopes, increments: Increments) -> float:
    """The slowest rate of a plant that has nothing to follow."""
    n = increments.order
    chain = (magnitude(side) ** (1 / (n - k)) for k, side in enumerate(slopes.f1[increments.zeros :]))
    zeros = (magnitude(row[k]) for k, row in enumerate(slopes.f0))
    return min((rate for rate in (*chain, *zeros) if rate > 0), default=1.0)


def _zero_sizes(slopes: Slopes, initial: InitialMagnitudes, output: float) -> Iterable[float]:
    """Where an output of size one takes the zero states at last, or where they start, if that is further."""
    zeros = len(slopes.f0)
    if not zeros:
        return []
    F = np.array([[_middle(side) for side in row] for row in slopes.f0])
    try:
        gains = np.abs(np.linalg.solve(F[:, :zeros], F[:, zeros]))
    except np.linalg.LinAlgError:
        gains = np.zeros(zeros)
    sizes = np.maximum(gains * output, initial.z)
    return [float(size) if np.isfinite(size) and size > 0 else output for size in sizes]


def _middle(side: Range) -> float:
    return (side[0] + side[1]) / 2


def _near(value: float) -> Fraction:
    """The nearest power of two; one for what is not positive and finite."""
    if not (value > 0 and np.isfinite(value)):
        return ONE
    return min(max(power_of_two(value), Fraction(1, 2**LONGEST)), Fraction(2**LONGEST))
