"""Exported controllers against the simulated plant, in floats: samples for a replay, and runs of the sampled loop.

A controller is anything with the methods of the exported Python; the plant moves between two samples by the classical
Runge-Kutta method with the input held.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
import sympy

from sims.codegen import compile_function
from sims.signals import Array
from symbolic.plant import Plant

LARGEST = 1e9  # a state beyond it has escaped


class Controlled(Protocol):
    """The exported controller of one agent."""

    def message(self) -> Any: ...
    def receive(self, message: Any) -> bool: ...
    def coordinate(self) -> bool: ...
    def step(self, y: float) -> float: ...


@dataclass(frozen=True)
class Start:
    """Of one agent: plant states ``(z, x)`` and parameters."""

    states: tuple[float, ...]
    parameters: tuple[float, ...]


@dataclass(frozen=True)
class Run:
    """``lines`` as the replay reads them; ``outputs[i]`` are the samples of agent ``i + 1``; ``escaped`` is its number
    or 0."""

    lines: tuple[str, ...]
    outputs: tuple[Array, ...]
    inputs: tuple[Array, ...]
    escaped: int


def centre(plant: Plant) -> list[Start]:
    """The middle of all boxes."""

    def mid(sides: Sequence[Any]) -> tuple[float, ...]:
        return tuple(float((side.lo + side.hi) / 2) for side in sides)

    return [Start((*mid(a.initial.z), *mid(a.initial.x)), mid(a.parameter_box)) for a in plant.agents]


def run_network(
    plant: Plant,
    make: Mapping[int, Callable[[float], Controlled]],
    periods: Mapping[int, Fraction],
    coordinator_period: Fraction,
    starts: Sequence[Start],
    rounds: int,
    *,
    substeps: int = 4,
    noise: Callable[[int, int], float] = lambda agent, sample: 0.0,
    late: Mapping[int, int] | None = None,
    lost: Callable[[int, int, int], bool] = lambda receiver, sender, stamp: False,
) -> Run:
    """``rounds`` rounds of the coordinator from ``starts`` and the middle of ``V0``.

    ``noise(agent, k)`` is added to sample ``k``; ``late[agent]`` says after how many of the ``substeps`` parts of a
    period a new input reaches the plant; ``lost(receiver, sender, stamp)`` whether a message is lost.
    """
    fields = [_field(plant, k) for k in range(len(plant.agents))]
    size = len(plant.exosystem.states)
    S = np.array(plant.exosystem.S.tolist(), dtype=float).reshape(size, size)
    v0 = np.array([float((side.lo + side.hi) / 2) for side in plant.exosystem.initial])
    q = [np.array(start.states) for start in starts]
    offset = [len(agent.zero_states) for agent in plant.agents]
    devices: dict[int, Controlled] = {}
    lines, outputs = [], [[] for _ in q]  # type: list[str], list[list[float]]
    inputs: list[list[float]] = [[] for _ in q]
    held = [0.0] * len(q)
    v_at = _Exosystem(S, v0)
    for k, agent in enumerate(plant.agents):
        y = float(q[k][offset[k]]) + noise(agent.id, 0)
        devices[agent.id] = make[agent.id](y)
        lines.append(f"{agent.id} {y.hex()} 0x0p+0")
    for number in range(rounds):
        lines.append("0 0 0")
        messages = {agent.id: devices[agent.id].message() for agent in plant.agents}
        for edge in plant.digraph.edges:
            if not lost(edge.target, edge.source, number):
                devices[edge.target].receive(messages[edge.source])
        for agent in plant.agents:
            devices[agent.id].coordinate()
        for k, agent in enumerate(plant.agents):
            count = int(coordinator_period / periods[agent.id])
            step = float(periods[agent.id]) / substeps
            for i in range(count):
                sample = number * count + i
                y = float(q[k][offset[k]]) + noise(agent.id, sample)
                u = devices[agent.id].step(y)
                lines.append(f"{agent.id} {y.hex()} {u.hex()}")
                outputs[k].append(float(q[k][offset[k]]))
                inputs[k].append(u)
                t = number * float(coordinator_period) + i * float(periods[agent.id])
                wait = 0 if late is None else late.get(agent.id, 0)
                for part in range(substeps):
                    applied = held[k] if part < wait else u
                    q[k] = _runge_kutta(fields[k], q[k], starts[k].parameters, applied, v_at, t + part * step, step)
                held[k] = u
                if not np.abs(q[k]).max() < LARGEST:
                    return _run(lines, outputs, inputs, agent.id)
    return _run(lines, outputs, inputs, 0)


def _run(lines: list[str], outputs: list[list[float]], inputs: list[list[float]], escaped: int) -> Run:
    return Run(tuple(lines), tuple(map(np.array, outputs)), tuple(map(np.array, inputs)), escaped)


Field = Callable[[Array, Sequence[float], float, Array], Array]


def _field(plant: Plant, index: int) -> Field:
    agent = plant.agents[index]
    u = sympy.Dummy("u", real=True)
    states = (*agent.zero_states, *agent.chain)
    rows = (*agent.zero_dynamics, *agent.chain[1:], agent.f + agent.b * u)
    compiled = compile_function((states, plant.exosystem.states, agent.parameters, (u,)), rows)
    return lambda q, w, given, v: np.array(compiled(q.tolist(), v.tolist(), w, (given,)))


class _Exosystem:
    """``v(t) = e^(St) v(0)`` by its eigenvectors, which exist (A4)."""

    def __init__(self, S: Array, start: Array) -> None:
        self.size = len(start)
        if self.size:
            self.values, self.vectors = np.linalg.eig(S)
            self.weights = np.linalg.solve(self.vectors, start.astype(complex))

    def __call__(self, t: float) -> Array:
        if not self.size:
            return np.zeros(0)
        found: Array = (self.vectors @ (np.exp(self.values * t) * self.weights)).real
        return found


def _runge_kutta(field: Field, q: Array, w: Sequence[float], u: float, v: _Exosystem, t: float, step: float) -> Array:
    before, middle, after = v(t), v(t + step / 2), v(t + step)
    k1 = field(q, w, u, before)
    k2 = field(q + step / 2 * k1, w, u, middle)
    k3 = field(q + step / 2 * k2, w, u, middle)
    k4 = field(q + step * k3, w, u, after)
    result: Array = q + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return result
