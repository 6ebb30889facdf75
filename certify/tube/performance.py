"""How well a trial's loop does, as far as its tube proves: settling, peak of the input, fastest pole of the observer.

In floats and by the bounds of docs/certificate-direct.md section 7, a little on the safe side: the checker decides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import exp, log, sqrt

import numpy as np
import sympy
from scipy.linalg import expm

from certify.agent_model import AgentModel
from certify.bounds.suprema import magnitude_bound
from certify.tube.surroundings import Surroundings
from certify.tube.trial import Trial

SAFETY = 1 + 1e-4  # the witness is rounded up, and the checker encloses |u*| in its own way


@dataclass(frozen=True)
class Step:
    """``|y − s*| ≤ error`` and ``|u| ≤ input`` from ``start`` to ``end``."""

    start: float
    end: float
    error: float
    input: float


@dataclass(frozen=True)
class Performance:
    """What is proved of one agent: step by step, and from ``steps[-1].end`` on.

    There ``|y − s*|`` is at most the sum of the ``size·e^(−rate·time)`` in ``tail`` and ``|u| ≤ tail_input``. ``pole``
    is the size of the fastest observer pole in rad/s, 0 without one.
    """

    steps: tuple[Step, ...]
    tail: tuple[tuple[float, float], ...]
    tail_input: float
    pole: float

    @property
    def peak(self) -> float:
        """Of ``|u|`` for all time."""
        return max(self.tail_input, *(step.input for step in self.steps))

    @property
    def first_error(self) -> float:
        """Bound of ``|y − s*|`` at the start."""
        return self.steps[0].error

    def settled(self, band: float) -> float:
        """A time from which on ``|y − s*| ≤ band``; ``band > 0``."""
        end = self.steps[-1].end
        if self._late(end) > band:
            low, high = end, end + max(log(max(2 * size / band, 1.0)) / rate for size, rate in self.tail)
            for _ in range(60):
                middle = (low + high) / 2
                low, high = (low, middle) if self._late(middle) <= band else (middle, high)
            return high
        return max((step.end for step in self.steps if step.error > band), default=0.0)

    def _late(self, t: float) -> float:
        return sum(size * exp(-rate * (t - self.steps[-1].end)) for size, rate in self.tail)


class Performances:
    """Of the trials of one agent with one design."""

    def __init__(self, model: AgentModel, surroundings: Surroundings) -> None:
        self.model, self.surroundings = model, surroundings
        self.steady = steady_input(model)
        self.fastest = max(map(abs, np.roots([1.0, *map(float, reversed(model.observer))])), default=0.0)

    def of(self, trial: Trial) -> Performance:
        outside, tube, zeros = self.surroundings, trial.tube, len(self.model.agent.zero_states)
        inputs = self._inputs(trial)
        boxes = [box.x[0] for box in trial.reached.boxes] + [float(box[zeros]) for box in tube.boxes]
        times = [*trial.reached.grid, *tube.grid[1:]]
        steps = []
        for start, end, box, push in zip(times[:-1], times[1:], boxes, inputs, strict=True):
            steps.append(Step(start, end, (box + outside.during(start, end).deviation) * SAFETY, push * SAFETY))
        away = float(outside.agent.tail_deviation) * exp(-outside.decay * (tube.grid[-1] - outside.horizon))
        tail = ((float(tube.tail[zeros]) * SAFETY, tube.tail_rate), (away * SAFETY, outside.decay))
        pole = 0.0 if trial.gains.h is None else float(self.fastest) * float(trial.gains.h)
        return Performance(tuple(steps), tail, (float(tube.tail[-1]) + self.steady) * SAFETY, pole)

    def _inputs(self, trial: Trial) -> Iterator[float]:
        """Bounds of ``|u|`` on every step of both phases."""
        im, reached, tube = self.model.internal_model, trial.reached, trial.tube
        M = np.array([[float(entry) for entry in row] for row in im.M]).reshape(im.order, im.order)
        N, psi = (np.array([float(entry) for entry in row]) for row in (im.N, im.psi))
        G, size = np.abs(M + np.outer(N, psi)), np.abs(psi)
        eta = np.full(im.order, float(self.model.agent.initial.eta.magnitude))
        through, least = abs(float(psi @ N)), float(self.model.input_gain.lo)
        pushes = [*reached.pushes, *(float(trial.gains.K) * float(box[-2]) for box in tube.boxes)]
        apart = [float(size @ box.zeta) + through * box.x[-1] / least for box in reached.boxes]
        around = [push + inner for push, inner in zip(reached.pushes, apart, strict=True)]
        around += [float(box[-1]) for box in tube.boxes]
        times, limit = [*reached.grid, *tube.grid[1:]], max([*around, 0.0]) + self.steady
        for k, push in enumerate(pushes):
            straight = push + float(size @ eta)
            if size @ eta <= limit and im.order:
                duration = times[k + 1] - times[k]
                eta = expm(G * duration) @ (eta + duration * np.abs(N) * push)
                straight = push + float(size @ eta)
            yield min(straight, around[k] + self.steady)


def steady_input(model: AgentModel) -> float:
    """A bound of ``|u*|`` for all time: over the box of ``v``, or over its ellipse around ``v = 0``."""
    if not model.internal_model.tau:
        return 0.0
    u, box = model.internal_model.tau[0], model.exogenous_box
    straight = float(magnitude_bound(u, box).value)
    states = model.exosystem.states
    g = [float(magnitude_bound(sympy.diff(u, v), box).value) for v in states]
    extent = np.abs(np.array([[float(entry) for entry in row] for row in model.extent])).reshape(len(g), len(g))
    at_rest = float(magnitude_bound(u.subs(dict.fromkeys(states, 0)), box).value)
    return min(straight, at_rest + sqrt(float(np.array(g) @ extent @ np.array(g))))
