"""How long a run lasts and what it has to have reached by then: in the plant's own units, never a fixed time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from certify.statement.bounds import ProvedBounds
from sims.agent_loop import upper_layer
from sims.closed_loop import Trajectory, simulate
from sims.coordinator import estimated_optimum
from sims.fate import longest_period
from sims.scenario import Scenario, nominal
from sims.search_space import SharedPoint
from sims.signals import Array
from symbolic.controller import Controller
from symbolic.plant import Plant

SETTLED = Fraction(1, 1000)  # of the largest initial distance: three decades, well above what integrators leave
LAST_WINDOW = 0.2  # of the horizon, as sims.fate cuts it
_DOUBLINGS = 40  # of the first guess at the references' time: twelve decades
_PATIENCE = 4.0  # the five agents with (2, 40, 150) settle at 10 s from the centre of W and escape at 36 s elsewhere
_LONGER = 6  # doublings of the references' time until the agents have settled too


@dataclass(frozen=True)
class Deadline:
    """Runs of an agent last ``horizon`` seconds; throughout their last window ``|y − s*| ≤ tolerance`` is due."""

    horizon: float
    tolerance: Fraction


def deadline(plant: Plant, settled: float, tolerance: Fraction) -> Deadline:
    """For an agent whose error is at most ``tolerance`` from ``settled`` seconds on: the last window begins then."""
    return Deadline(max(settled / (1.0 - LAST_WINDOW), settled + longest_period(plant)), tolerance)


def certified_deadlines(plant: Plant, bounds: ProvedBounds) -> Mapping[int, Deadline]:
    """What a verified certificate promises: when the error of each agent is a thousandth of its largest bound."""
    due = {}
    for agent in bounds.agents:
        tolerance = SETTLED * agent.error.peak
        if tolerance > 0:
            due[agent.id] = deadline(plant, float(agent.error.settled(tolerance)), tolerance)
    return due


def nominal_deadlines(plant: Plant, controller: Controller) -> Mapping[int, Deadline]:
    """For a controller of which nothing is proved: four times what the run from the centre of the boxes takes."""
    horizon = _PATIENCE * float(settled_run(plant, controller).t[-1])
    tolerance = SETTLED * Fraction(_distance(plant)).limit_denominator(10**12)
    return {agent.id: Deadline(horizon, tolerance) for agent in plant.agents} if tolerance > 0 else {}


def settled_run(
    plant: Plant, controller: Controller, samples: Callable[[float], int | Array] = lambda horizon: 1001
) -> Trajectory:
    """The run from the centre of the boxes until the outputs have settled, or 64 times as long as the references take.

    ``samples`` chooses those of :func:`sims.closed_loop.simulate` for a horizon.
    """
    start = nominal(plant, controller)
    horizon, near = _reference_time(plant, controller, start), float(SETTLED) * _distance(plant)
    for _ in range(_LONGER):
        run = simulate(plant, controller, horizon=horizon, scenario=start, samples=samples(horizon))
        if run.status != "completed" or run.final_error(LAST_WINDOW * horizon) <= near:
            return run
        horizon *= 2.0
    return simulate(plant, controller, horizon=horizon, scenario=start, samples=samples(horizon))


def _reference_time(plant: Plant, controller: Controller, start: Scenario) -> float:
    """When the references have settled: found by doubling from a time that is short for the network."""
    optimum, near = estimated_optimum(plant), float(SETTLED) * _distance(plant)
    shared = SharedPoint(tuple(map(Fraction, start.v)), tuple(map(Fraction, start.reference)))
    rows = len(start.v) + np.arange(len(plant.agents))
    weight = max((float(edge.weight) for edge in plant.digraph.edges), default=1.0)
    constants = controller.coordinator
    fastest = max(weight * float(constants.alpha1), float(constants.alpha2))  # both are rates
    horizon = 1.0 / fastest + float(constants.mixing_time)
    for _ in range(_DOUBLINGS):
        layer = upper_layer(plant, controller, shared, horizon)
        late = layer.signals.sample(np.linspace((1.0 - LAST_WINDOW) * horizon, horizon, 50))[rows]
        if layer.status != "completed" or np.abs(late - optimum).max() <= near:
            break
        horizon *= 2.0
    return max(horizon, longest_period(plant))


def _distance(plant: Plant) -> float:
    """The largest distance from ``s*`` at which an output or a reference may start; the unit where all start there."""
    optimum = estimated_optimum(plant)
    sides = [side for agent in plant.agents for side in (agent.initial.x[0], agent.initial.reference)]
    return max(abs(float(end) - optimum) for side in sides for end in (side.lo, side.hi)) or 1.0
