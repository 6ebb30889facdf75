"""One agent behind the coordinator, ready to be run many times: by the batch integrator or, one at a time, by LSODA."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np

from sims.batch import BatchOptions, BatchSolution, integrate_batch
from sims.coordinator import UpperLayer, estimated_optimum, integrate_upper_layer
from sims.equations import ClosedLoopEquations, closed_loop_equations, compile_agent
from sims.integration import Solution, integrate_agent
from sims.search_space import AgentPoint, SharedPoint
from sims.signal_pool import SignalPool, pool
from sims.signals import Array
from sims.stage_code import StageSources, stage_sources, state_order
from symbolic.controller import AgentController, Controller
from symbolic.plant import Agent, Plant


@dataclass(frozen=True)
class AgentLoop:
    """The loop of agent ``agent.id`` in ``plant`` under ``controller``.

    ``order`` maps the states of ``equations`` to the rows of ``sources``.
    """

    plant: Plant
    controller: Controller
    agent: Agent
    law: AgentController
    equations: ClosedLoopEquations
    sources: StageSources
    order: tuple[int, ...]
    optimum: float

    @property
    def plant_states(self) -> int:
        return len(self.equations.z) + len(self.equations.x)

    @property
    def output_row(self) -> int:
        """The row of ``y = x_1`` in samples."""
        return len(self.equations.z)

    def start(self, point: AgentPoint) -> list[float]:
        """``q(0)`` in the order of the equations; the observer's error is formed exactly."""
        h, n = self.law.h or Fraction(1), len(point.x)
        pairs = enumerate(zip(point.x, point.observer, strict=True), start=1) if point.observer else ()
        error = [h ** (n - k) * (x - estimate) for k, (x, estimate) in pairs]
        return [_float(value) for value in (*point.z, *point.x, *error, *point.eta)]

    def signals(self, layers: Sequence[UpperLayer]) -> SignalPool:
        """What the agent sees of the upper layers."""
        return pool([layer.signals for layer in layers], layers[0].inputs_of(self.agent.id))

    def run(
        self,
        signals: SignalPool,
        members: Sequence[int],
        points: Sequence[AgentPoint],
        horizon: float,
        times: Array,
        options: BatchOptions,
    ) -> BatchSolution:
        """All points at once; samples in the order ``(z, x, η, e)``."""
        start = np.array([self.start(point) for point in points]).T[list(self.order)]
        parameters = np.array([[float(value) for value in point.parameters] for point in points]).T
        return integrate_batch(
            self.sources, self.plant_states, signals, np.array(members), start, parameters, horizon, times, options
        )

    def reference_run(
        self, layer: UpperLayer, point: AgentPoint, times: Array, rtol: float, atol: float, max_steps: int = 2_000_000
    ) -> Solution:
        """One point by LSODA, an integrator of another family; states in the order of the equations."""
        return integrate_agent(
            compile_agent(self.agent, self.law, self.plant.exosystem),
            layer.signals.reader(layer.inputs_of(self.agent.id)),
            [float(value) for value in point.parameters],
            self.start(point),
            times,
            end=layer.signals.end,
            threshold=float(self.law.delta / self.law.K),
            rtol=rtol,
            atol=atol,
            escape_radius=BatchOptions().escape_radius,
            max_steps=max_steps,
        )


@lru_cache(maxsize=64)
def agent_loop(plant: Plant, controller: Controller, number: int) -> AgentLoop:
    """The loop of agent ``number`` (1 … N). Raises ``InputError`` as the equations and the costs do."""
    agent, law = plant.agents[number - 1], controller.agents[number - 1]
    equations = closed_loop_equations(agent, law, plant.exosystem)
    return AgentLoop(
        plant=plant,
        controller=controller,
        agent=agent,
        law=law,
        equations=equations,
        sources=stage_sources(equations),
        order=tuple(state_order(equations)),
        optimum=estimated_optimum(plant),
    )


def upper_layer(
    plant: Plant, controller: Controller, start: SharedPoint, horizon: float, rtol: float = 1e-8, atol: float = 1e-10
) -> UpperLayer:
    """Exosystem and coordinator from ``start``."""
    return integrate_upper_layer(
        plant, controller.coordinator, start.floats, horizon, rtol, atol, BatchOptions().escape_radius
    )


def _float(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf
