"""Trials of the direct route on the example plants, and simulated outputs to hold against their boxes."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import sympy
from numpy.typing import NDArray

from certify.assumptions.check import check_assumptions
from certify.preparation import Prepared, prepare
from certify.tube.certificate import tube_controller
from certify.tube.increments import Ranges
from certify.tube.loop import Loop, LoopGains, nominal_loop
from certify.tube.trial import AgentTrials, Trial, TrialFailure
from sims.agent_loop import AgentLoop, agent_loop, upper_layer
from sims.batch import COMPLETED, BatchOptions
from sims.coordinator import UpperLayer
from sims.search_space import AgentPoint, agent_box, agent_point, shared_points
from symbolic.controller import Controller
from symbolic.plant import COST_VARIABLE, Plant
from symbolic.plant_file import parse_plant

Array = NDArray[np.float64]

EXAMPLES = Path(__file__).parent.parent / "examples"
OPTIONS = BatchOptions(rtol=1e-7, atol=1e-9, max_steps=20_000)

# g, K, h per agent that is tried: about the least that the search finds, where the saturation acts for long; those of
# rooms and thermal_springs are generous
GAINS: dict[tuple[str, int], tuple[int, int, int | None]] = {
    ("first_order", 1): (1, 4, None),
    ("rooms", 2): (1, 60, None),
    ("pendulums", 3): (3, 4, 100),
    ("van_der_pol", 2): (3, 12, 300),
    ("mass_spring", 4): (3, 7, 175),
    ("thermal_springs", 1): (2, 60, 6000),
    ("third_order_actuator", 2): (3, 3, 300),
    ("fourth_order", 1): (3, 30, 750),
    ("five_agents", 1): (6, 145, 1015),
    ("five_agents", 2): (6, 110, 880),
    ("five_agents", 3): (6, 12, 360),
    ("five_agents", 4): (8, 12, 360),
    ("five_agents", 5): (8, 14, 420),
}
# g, K, h that all agents of a plant pass with
GENEROUS: dict[str, tuple[int, int, int | None]] = {
    "first_order": (1, 60, None),
    "rooms": (1, 60, None),
    "pendulums": (2, 60, 6000),
    "van_der_pol": (2, 60, 6000),
    "mass_spring": (2, 60, 6000),
    "thermal_springs": (2, 60, 6000),
    "third_order_actuator": (2, 60, 60_000),
    "fourth_order": (2, 60, 60_000),
}
TOLERANCE = 1e-6  # of a simulation, per unit of what the output multiplies
QUICK = [key for key in GAINS if key[0] not in ("five_agents", "mass_spring", "van_der_pol")]


@cache
def prepared(name: str) -> Prepared:
    """An example plant up to the choice of gains; α is given, which spares the search for it. The five agents have the
    paper's coordinator, the others one that waits."""
    text = (EXAMPLES / f"{name}.toml").read_text() + "\n[coordinator]\nalpha1 = 3\nalpha2 = 2\n"
    text += "mixing_time = 0\n" if name == "five_agents" else ""
    plant = parse_plant(text.encode(), name)
    ready = prepare(plant, check_assumptions(plant), lambda message: None)
    assert isinstance(ready, Prepared), ready
    return ready


@cache
def trials(name: str, number: int) -> AgentTrials:
    ready = prepared(name)
    model = ready.models[number - 1]
    assert not isinstance(model, str), model
    return AgentTrials(model, ready.coordinator.envelope, number - 1)


@cache
def passed(name: str, number: int) -> Trial:
    """The trial of the gains above, which succeeds."""
    result = trials(name, number).attempt(gains_of(name, number))
    assert not isinstance(result, TrialFailure), result.reason
    return result


def gains_of(name: str, number: int) -> LoopGains:
    g, K, h = GAINS[name, number]
    return LoopGains(Fraction(g), Fraction(K), None if h is None else Fraction(h))


def loop_of(name: str, number: int) -> Loop:
    return nominal_loop(trials(name, number).model, gains_of(name, number), trials(name, number).nominal)


@cache
def running(name: str, number: int) -> AgentLoop:
    """The closed loop of the agent under the gains above. The other agents have the same law: nothing depends on it."""
    ready, trial = prepared(name), passed(name, number)
    law = tube_controller(trial)
    laws = (law,) * len(ready.plant.agents)
    coordinator = ready.coordinator.gains
    return agent_loop(ready.plant, Controller(coordinator, laws), number)


def largest_vartheta(name: str, number: int) -> float:
    """The bound of ``|ϑ(0)|`` that phase 1 begins with."""
    model, gains, initial = trials(name, number).model, gains_of(name, number), trials(name, number).initial
    powers = [gains.g ** (model.order - k) * model.gamma[k - 1] for k in range(1, model.order)]
    return float(_floats((*powers, Fraction(1))) @ initial.x)


@dataclass(frozen=True)
class Flight:
    """Outputs ``z̄, x̄, ϑ̃, υ`` of shape ``(starts, outputs, times)``; ``z̄, x̄, ϑ, ζ`` with the true ``b``; ``Y``, which
    ends with ``e``; ``z`` itself and the plant's output error."""

    times: Array
    outputs: Array
    reaching: Array
    Y: Array
    z: Array
    error: Array
    cubes: Array
    members: NDArray[np.intp]

    @property
    def count(self) -> int:
        return len(self.outputs)


class Starts:
    """Points of ``W × box`` as cubes, behind a few starts of the upper layer (corners and inner points of ``V0``)."""

    def __init__(self, name: str, number: int, horizon: float, seed: int = 0) -> None:
        self.key = (name, number)
        self.loop, self.model, self.horizon = running(name, number), trials(name, number).model, horizon
        self.generator = np.random.default_rng(seed)
        self.box = agent_box(self.loop.agent, self.loop.law)
        plant: Plant = self.loop.plant
        self.layers: list[UpperLayer] = [
            upper_layer(plant, self.loop.controller, start, horizon, rtol=1e-12, atol=1e-14)
            for start in shared_points(plant, self.generator, 4, 4)
        ]

    def corners_and_inner(self, corners: int, inner: int) -> Array:
        free = len(self.box.free)
        chosen = self.box.corners(corners, self.generator)
        return np.vstack([np.array(chosen).reshape(len(chosen), free), self.generator.random((inner, free))])

    def fly(self, cubes: Array, times: Array) -> Flight:
        """Simulate; every trajectory has to complete."""
        points = [agent_point(self.loop.agent, self.loop.law, self.box.point(cube)) for cube in cubes]
        members = np.arange(len(cubes)) % len(self.layers)
        self.generator.shuffle(members)
        found = self.loop.run(self.loop.signals(self.layers), members.tolist(), points, self.horizon, times, OPTIONS)
        assert np.all(found.status == COMPLETED)
        return self._outputs(found.samples, points, members, times, cubes)

    def fly_alone(self, cubes: Array, times: Array) -> Flight:
        """The same by LSODA, one by one, which follows a feedback that crosses its bounds within 1e-12 s."""
        points = [agent_point(self.loop.agent, self.loop.law, self.box.point(cube)) for cube in cubes]
        members = np.arange(len(cubes)) % len(self.layers)
        found = [
            self.loop.reference_run(self.layers[member], point, times, 1e-8, 1e-10)
            for member, point in zip(members, points, strict=True)
        ]
        assert all(run.status == "completed" for run in found)
        samples = np.array([run.states[list(self.loop.order)] for run in found])
        return self._outputs(samples, points, members, times, cubes)

    def _outputs(
        self, samples: Array, points: list[AgentPoint], members: NDArray[np.intp], times: Array, cubes: Array
    ) -> Flight:
        model, law = self.model, self.loop.law
        nz, n, s = len(model.agent.zero_states), model.order, len(law.N)
        seen = np.array([layer.signals.sample(times)[layer.inputs_of(model.agent.id)] for layer in self.layers])
        reference, v = seen[members, 0], seen[members, 1:]
        w = np.array([[float(value) for value in point.parameters] for point in points])
        exogenous = [float(model.optimum.lo), *np.moveaxis(v, 1, 0), *w.T[:, :, None]]
        symbols = (COST_VARIABLE, *model.exosystem.states, *model.agent.parameters)

        def value(expression: sympy.Expr) -> Array:
            return np.broadcast_to(sympy.lambdify(symbols, expression, "numpy")(*exogenous), reference.shape)

        z, x, eta, e = np.split(samples, np.cumsum([nz, n, s]), axis=1)
        z_bar = z - np.array([value(part) for part in model.steady_state]).reshape(nz, *reference.shape).swapaxes(0, 1)
        x_bar = x.copy()
        x_bar[:, 0] -= reference
        theta = np.array([float(law.g ** (n - k)) * float(law.gamma[k - 1]) for k in range(1, n)] + [1.0])
        vartheta = np.einsum("k,bkt->bt", theta, x_bar)
        estimate = vartheta
        if n > 1:
            assert law.h is not None
            estimate = vartheta - np.einsum("k,bkt->bt", theta / float(law.h) ** np.arange(n - 1, -1, -1), e)
        tau = np.array([value(part) for part in model.internal_model.tau]).reshape(s, *reference.shape)
        T = np.array([[float(entry) for entry in row] for row in model.internal_model.T]).reshape(s, s)
        eta_bar = eta - np.einsum("jk,kbt->bjt", T, tau)
        applied = np.einsum("k,bkt->bt", _floats(law.psi), eta_bar) - float(law.K) * estimate
        along = _floats(law.N)[None, :, None] * x_bar[:, -1:]
        zeta = eta_bar - along / value(model.agent.b)[:, None]
        zeta_nominal = eta_bar - along / float(passed(*self.key).nominal.b)
        return Flight(
            times,
            np.concatenate([z_bar, x_bar, estimate[:, None], applied[:, None]], axis=1),
            np.concatenate([z_bar, x_bar, vartheta[:, None], zeta], axis=1),
            np.concatenate([z_bar, x_bar[:, :-1], vartheta[:, None], zeta_nominal, e], axis=1),
            z,
            x[:, 0] - float(model.optimum.lo),
            cubes,
            members,
        )


def _floats(row: tuple[Fraction, ...]) -> Array:
    return np.array([float(entry) for entry in row])


def usage(trial: Trial, flight: Flight) -> Array:
    """``max_t |output|/box`` per start and output, from ``T1`` on; ``boxes[k]`` holds on step ``k``."""
    step = np.searchsorted(trial.tube.grid, flight.times, side="right") - 1
    inside = step >= 0
    boxes = np.array([*trial.tube.boxes, trial.tube.tail])[np.minimum(step[inside], len(trial.tube.boxes))].T
    unit = np.append(np.ones(len(boxes) - 1), float(trial.gains.K))[:, None]
    share: Array = (np.abs(flight.outputs[:, :, inside]) - TOLERANCE * unit) / boxes
    return share.max(axis=2)


def reaching_usage(trial: Trial, flight: Flight, initial_vartheta: float) -> Array:
    """The same before ``T1``: ``z̄, x̄, ϑ, ζ`` in the boxes of phase 1, and last ``ϑ`` below the line of ``vartheta``."""
    reached = trial.reached
    during = flight.times < reached.duration
    if not during.any():
        return np.zeros((flight.count, flight.reaching.shape[1] + 1))
    step = np.searchsorted(reached.grid, flight.times[during], side="right") - 1
    boxes = np.array([box.flat for box in reached.boxes])[step].T
    line = np.interp(flight.times[during], reached.grid, [initial_vartheta, *reached.vartheta])
    held = np.abs(flight.reaching[:, :, during])
    place = len(trial.nominal.f1)
    found = np.concatenate([held, held[:, place : place + 1]], axis=1) - TOLERANCE
    share: Array = found / np.vstack([boxes, line])
    return share.max(axis=2)


def leaves_ranges(trial: Trial, flight: Flight, initial: Ranges) -> float:
    """By how much ``z`` leaves what is known of it, at most, in both phases; ``−∞`` where nothing is known."""
    grid = np.array([*trial.reached.grid, *trial.tube.grid[1:]])
    ends = np.array([initial, *trial.reached.ranges, *trial.tube.ranges])
    worst = -np.inf
    for k, (a, b) in enumerate(pairwise(ends)):
        during = (grid[k] <= flight.times) & (flight.times <= grid[k + 1])
        z = flight.z[:, :, during]
        low, high = np.minimum(a, b)[:, 0], np.maximum(a, b)[:, 1]
        worst = max(worst, float(np.max(np.maximum(low[:, None] - z, z - high[:, None]), initial=-np.inf)))
    return worst
