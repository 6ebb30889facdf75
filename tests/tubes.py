"""Trials of the direct route on the example plants, and simulated outputs to hold against their boxes."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import sympy
from numpy.typing import NDArray

from certify.assumptions.check import check_assumptions
from certify.preparation import Prepared, prepare
from certify.tube.certificate import tube_controller
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

# g, K, h per agent that is tried: what the search finds, rounded up generously
GAINS: dict[tuple[str, int], tuple[int, int, int | None]] = {
    ("first_order", 1): (1, 60, None),
    ("rooms", 2): (1, 60, None),
    ("pendulums", 3): (2, 60, 6000),
    ("van_der_pol", 2): (2, 60, 6000),
    ("mass_spring", 4): (2, 60, 6000),
    ("thermal_springs", 1): (2, 60, 6000),
    ("third_order_actuator", 2): (2, 60, 60_000),
    ("fourth_order", 1): (2, 60, 60_000),
    ("five_agents", 1): (2, 1000, 100_000),
    ("five_agents", 2): (2, 1000, 100_000),
    ("five_agents", 3): (2, 450, 90_000),
    ("five_agents", 4): (2, 450, 90_000),
    ("five_agents", 5): (2, 700, 140_000),
}
QUICK = [key for key in GAINS if key[0] not in ("five_agents", "mass_spring", "van_der_pol")]


@cache
def prepared(name: str) -> Prepared:
    """An example plant up to the choice of gains; α is given, which spares the search for it."""
    text = (EXAMPLES / f"{name}.toml").read_text() + "\n[coordinator]\nalpha1 = 3\nalpha2 = 2\n"
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
    law = tube_controller(trials(name, number).model, trial)
    laws = (law,) * len(ready.plant.agents)
    coordinator = ready.coordinator.model
    return agent_loop(ready.plant, Controller(coordinator.alpha1, coordinator.alpha2, laws), number)


@dataclass(frozen=True)
class Flight:
    """Outputs ``z̄, x̄, ϑ̃, Ψη̄`` of shape ``(starts, outputs, times)``, ``e`` and the plant's output error."""

    times: Array
    outputs: Array
    error: Array
    observer: Array
    cubes: Array
    members: NDArray[np.intp]

    @property
    def count(self) -> int:
        return len(self.outputs)


class Starts:
    """Points of ``W × box`` as cubes, behind a few starts of the upper layer (corners and inner points of ``V0``)."""

    def __init__(self, name: str, number: int, horizon: float, seed: int = 0) -> None:
        self.loop, self.model, self.horizon = running(name, number), trials(name, number).model, horizon
        self.generator = np.random.default_rng(seed)
        self.box = agent_box(self.loop.agent, self.loop.law)
        plant: Plant = self.loop.plant
        self.layers: list[UpperLayer] = [
            upper_layer(plant, self.loop.controller, start, horizon)
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
        weights = np.array([float(law.g ** (n - k)) * float(law.gamma[k - 1]) for k in range(1, n)] + [1.0])
        estimate = np.einsum("k,bkt->bt", weights, x_bar)
        if n > 1:
            assert law.h is not None
            estimate -= np.einsum("k,bkt->bt", weights / float(law.h) ** np.arange(n - 1, -1, -1), e)
        parts = [z_bar, x_bar, estimate[:, None]]
        if s:
            psi = np.array([float(entry) for entry in law.psi])
            parts.append((np.einsum("k,bkt->bt", psi, eta) - value(model.internal_model.tau[0]))[:, None])
        error = x[:, 0] - float(model.optimum.lo)
        return Flight(times, np.concatenate(parts, axis=1), error, e, cubes, members)
