"""The controller of one agent as an object that is stepped by hand: samples in, input out.

Between two samples the measurement and the reference are held, so observer and internal model are linear with constant
input and are advanced exactly, by a matrix exponential that is computed once per period. The continuous controller is
the limit of short periods. Nothing is proved about a sampled loop; this is for trying noise, delay and sampling rates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import sympy
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from sims.agent_loop import agent_loop, upper_layer
from sims.codegen import compile_function, saturation
from sims.search_space import AgentPoint, SharedPoint
from sims.signals import Array
from symbolic.controller import AgentController, Controller
from symbolic.errors import InputError
from symbolic.plant import Plant

_ESCAPE = 1e9


class SampledController:
    """``u = −sat_δ(K ϑ̃) + Ψ η`` at the sampling instants, held for ``period`` seconds.

    ``observer`` and ``eta`` are the states ``x̃(0)`` and ``η(0)``, zero if left out. Raises ``InputError`` for a period
    that is not positive or a state of another length.
    """

    def __init__(
        self, law: AgentController, period: float, observer: Array | None = None, eta: Array | None = None
    ) -> None:
        if not 0.0 < period < float("inf"):
            raise InputError(f"the sampling period must be positive and finite, not {period!r}")
        self.period = period
        order, model = len(law.gamma) + 1, len(law.N)
        self.observer = np.zeros(order if law.h is not None else 0) if observer is None else np.array(observer, float)
        self.eta = np.zeros(model) if eta is None else np.array(eta, float)
        if len(self.observer) != (order if law.h is not None else 0) or len(self.eta) != model:
            raise InputError("the controller's states have another length")
        g, gamma = float(law.g), [float(value) for value in law.gamma] + [1.0]
        self._weights = np.array([g ** (order - k) * gamma[k - 1] for k in range(1, order + 1)])
        self._K, self._delta = float(law.K), float(law.delta)
        self._psi = np.array([float(value) for value in law.psi])
        self._observe = _held(*_observer(law, order), period)
        M = np.array([[float(entry) for entry in row] for row in law.M]).reshape(model, model)
        self._advance = _held(M, np.array([float(value) for value in law.N]), period)

    def step(self, y: float, reference: float) -> float:
        """Take the sample ``y`` of the output and ``y^r``, return the input to hold until the next one."""
        estimate = self.observer if self.observer.size else np.array([y])
        theta = float(self._weights @ estimate) - float(self._weights[0]) * reference
        u = -saturation(self._K * theta, self._delta) + float(self._psi @ self.eta)
        self.observer = self._observe[0] @ self.observer + self._observe[1] * y
        self.eta = self._advance[0] @ self.eta + self._advance[1] * u
        return u


@dataclass(frozen=True)
class SampledRun:
    """Output error ``y − s*`` at the samples ``t`` in seconds, and the inputs; ``escaped`` if a state exceeded 1e9."""

    t: Array
    error: Array
    u: Array
    escaped: bool

    def final_error(self, window: float) -> float:
        """``max |y − s*|`` over the last ``window`` seconds, infinite after an escape."""
        return float("inf") if self.escaped else float(np.abs(self.error[self.t >= self.t[-1] - window]).max())


def run_sampled(
    plant: Plant,
    controller: Controller,
    number: int,
    start: AgentPoint,
    shared: SharedPoint,
    *,
    rate: float,
    horizon: float,
    noise: float = 0.0,
    delay: int = 0,
    seed: int = 0,
) -> SampledRun:
    """Agent ``number`` in continuous time under its controller sampled ``rate`` times a second with zero-order hold.

    ``noise`` is the standard deviation of a white noise on the samples of ``y``, ``delay`` the number of periods after
    which an input arrives (0 before). Raises ``InputError`` for options that do not fit.
    """
    if not rate > 0 or not horizon > 0 or noise < 0 or delay < 0:
        raise InputError("a sampled run needs rate > 0, horizon > 0, noise >= 0 and delay >= 0")
    loop = agent_loop(plant, controller, number)
    layer = upper_layer(plant, controller, shared, horizon)
    read = layer.signals.reader(layer.inputs_of(number))
    derivative = _plant(loop.plant, number)
    w = [float(value) for value in start.parameters]
    device = SampledController(
        loop.law, 1.0 / rate, np.array([float(v) for v in start.observer]), np.array([float(v) for v in start.eta])
    )
    q = np.array([float(value) for value in (*start.z, *start.x)])
    output = len(start.z)
    generator = np.random.default_rng(seed)
    pending = [0.0] * delay
    times, errors, inputs = [], [], []
    for k in range(int(np.ceil(horizon * rate))):
        t = k / rate
        pending.append(device.step(float(q[output]) + noise * float(generator.standard_normal()), read(t)[0]))
        u = pending.pop(0)
        times.append(t)
        errors.append(float(q[output]) - loop.optimum)
        inputs.append(u)
        solution = solve_ivp(
            lambda s, x, u=u: derivative(x.tolist(), read(s)[1:], w, (u,)), (t, t + 1.0 / rate), q, rtol=1e-7, atol=1e-9
        )
        q = solution.y[:, -1]
        if solution.status != 0 or not np.abs(q).max() < _ESCAPE:
            return SampledRun(np.array(times), np.array(errors), np.array(inputs), True)
    return SampledRun(np.array(times), np.array(errors), np.array(inputs), False)


def _observer(law: AgentController, order: int) -> tuple[Array, Array]:
    """``x̃' = A x̃ + B y``; empty for ``n = 1``."""
    if law.h is None:
        return np.zeros((0, 0)), np.zeros(0)
    gains = np.array([float(law.h**k * law.observer[order - k]) for k in range(1, order + 1)])
    A = np.diag(np.ones(order - 1), 1)
    A[:, 0] -= gains
    return A, gains


def _held(A: Array, B: Array, period: float) -> tuple[Array, Array]:
    """``x(t + period) = F x + G u`` of ``x' = A x + B u`` with constant ``u``."""
    n = len(B)
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = A * period, B * period
    flow = expm(block)
    return flow[:n, :n], flow[:n, n]


def _plant(plant: Plant, number: int) -> Callable[..., tuple[float, ...]]:

    agent = plant.agents[number - 1]
    u = sympy.Dummy("u", real=True)
    x = agent.chain
    rows = (*agent.zero_dynamics, *x[1:], agent.f + agent.b * u)
    return compile_function(((*agent.zero_states, *x), plant.exosystem.states, agent.parameters, (u,)), rows)
