"""Simulation of the whole closed loop: plants, exosystem, coordinator, observers, internal models, saturated
input.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sims.coordinator import Status, UpperLayer, estimated_optimum, integrate_upper_layer
from sims.equations import CompiledAgent, compile_agent
from sims.integration import integrate_agent
from sims.scenario import AgentStart, Scenario, nominal
from sims.signals import Array
from symbolic.controller import AgentController, Controller
from symbolic.errors import InputError
from symbolic.plant import Agent, Plant


@dataclass(frozen=True)
class AgentTrajectory:
    """One agent's states over ``Trajectory.t``: shapes ``(dim, times)`` for ``z, x, observer, eta``, ``(times,)`` for
    the rest.

    ``vartheta`` is ``ϑ`` of the true state, ``vartheta_estimate`` the observer's ``ϑ̃``. ``saturated_fraction`` is
    the part of the time during which ``|K ϑ̃| ≥ δ`` and ``last_saturated`` the last such instant in seconds (0 if
    never). ``end`` is the last instant reached; after it the arrays hold NaN.
    """

    id: int
    z: Array
    x: Array
    observer: Array
    eta: Array
    u: Array
    vartheta: Array
    vartheta_estimate: Array
    saturated_fraction: float
    last_saturated: float
    status: Status
    reason: str
    end: float
    steps: int


@dataclass(frozen=True)
class Trajectory:
    """A run of the network. ``t`` in seconds, shape ``(times,)``; network signals have shape ``(agents, times)``.

    ``status`` is ``completed``, ``escaped`` (a plant or coordinator state left the ball of radius ``escape_radius``)
    or ``failed`` (the numerics could not go on); ``reason`` names the agent and the instant and ``end`` is the first
    such instant. ``optimum`` is ``s*`` in floats, an estimate (``certify.optimum`` proves it).
    """

    t: Array
    y: Array
    reference: Array
    zeta: Array
    mixing: Array
    v: Array
    agents: tuple[AgentTrajectory, ...]
    optimum: float
    scenario: Scenario
    status: Status
    reason: str
    end: float

    @property
    def u(self) -> Array:
        """Inputs, shape ``(agents, times)``."""
        return np.array([agent.u for agent in self.agents])

    @property
    def vartheta(self) -> Array:
        """``ϑ_i`` of the true states, shape ``(agents, times)``."""
        return np.array([agent.vartheta for agent in self.agents])

    @property
    def error(self) -> Array:
        """``|y_i − s*|``, shape ``(agents, times)``."""
        return np.abs(self.y - self.optimum)

    @property
    def saturated_fraction(self) -> Array:
        """Per agent, shape ``(agents,)``."""
        return np.array([agent.saturated_fraction for agent in self.agents])

    def final_error(self, window: float = 0.0) -> float:
        """``max_i |y_i − s*|`` over the last ``window`` seconds (0: the last instant); infinite for a run cut short."""
        if self.status != "completed":
            return float("inf")
        return float(self.error[:, self.t >= self.t[-1] - window].max())


def simulate(
    plant: Plant,
    controller: Controller,
    *,
    horizon: float,
    scenario: Scenario | None = None,
    samples: int | Sequence[float] | Array = 1001,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    escape_radius: float = 1e9,
    max_steps: int = 1_000_000,
) -> Trajectory:
    """Integrate the closed loop of theory.md section 1 from ``scenario`` (the centre of all intervals if left out).

    ``samples`` is a number of equidistant instants on ``[0, horizon]`` or the increasing instants themselves. The
    loop is a cascade and is solved as one: exosystem and coordinator first, a hundred times more accurately than
    asked, then every agent by itself. Escape and failure are results. Raises ``InputError`` for a horizon, samples or
    scenario that do not fit.
    """
    if not 0.0 < horizon < float("inf"):
        raise InputError(f"the horizon must be positive and finite, not {horizon!r}")
    if len(controller.agents) != len(plant.agents):
        raise InputError(f"the controller has {len(controller.agents)} agents and the plant {len(plant.agents)}")
    times = _sample_times(samples, horizon)
    chosen = nominal(plant, controller) if scenario is None else scenario
    upper = integrate_upper_layer(
        plant,
        controller.coordinator,
        (chosen.v, chosen.reference, chosen.zeta),
        float(horizon),
        rtol / 100,
        atol / 100,
        escape_radius,
    )
    agents = tuple(
        _run_agent(plant, agent, law, start, upper, times, (rtol, atol, escape_radius, max_steps))
        for agent, law, start in zip(plant.agents, controller.agents, chosen.agents, strict=True)
    )
    shared = upper.signals.sample(times)
    shared[:, times > upper.signals.end] = np.nan
    nv, N = len(plant.exosystem.states), len(plant.agents)
    status, reason, end = _verdict(agents, upper)
    return Trajectory(
        t=_frozen(times),
        y=_frozen(np.array([agent.x[0] for agent in agents])),
        reference=_frozen(shared[nv : nv + N]),
        zeta=_frozen(shared[nv + N : nv + 2 * N]),
        mixing=_frozen(shared[nv + 2 * N :]),
        v=_frozen(shared[:nv]),
        agents=agents,
        optimum=estimated_optimum(plant),
        scenario=chosen,
        status=status,
        reason=reason,
        end=end,
    )


def _run_agent(
    plant: Plant,
    agent: Agent,
    law: AgentController,
    start: AgentStart,
    upper: UpperLayer,
    times: Array,
    options: tuple[float, float, float, int],
) -> AgentTrajectory:
    compiled = compile_agent(agent, law, plant.exosystem)
    rtol, atol, escape_radius, max_steps = options
    rows = upper.inputs_of(agent.id)
    solution = integrate_agent(
        compiled,
        upper.signals.reader(rows),
        start.parameters,
        (*start.z, *start.x, *_observer_error(law, start), *start.eta),
        times,
        end=upper.signals.end,
        threshold=float(law.delta / law.K),
        rtol=rtol,
        atol=atol,
        escape_radius=escape_radius,
        max_steps=max_steps,
    )
    nz, n, ne = len(start.z), len(start.x), len(start.observer)
    z, x, _, eta = np.split(solution.states, [nz, nz + n, nz + n + ne])
    u, vartheta, vartheta_estimate, *observer = _signals(
        compiled, solution.states, upper.signals.sample(times)[rows], start.parameters
    )
    return AgentTrajectory(
        id=agent.id,
        z=_frozen(z),
        x=_frozen(x),
        observer=_frozen(np.array(observer).reshape(ne, len(times))),
        eta=_frozen(eta),
        u=_frozen(u),
        vartheta=_frozen(vartheta),
        vartheta_estimate=_frozen(vartheta_estimate),
        saturated_fraction=solution.saturated_time / solution.end if solution.end > 0.0 else 0.0,
        last_saturated=solution.last_saturated,
        status=solution.status,
        reason=solution.reason,
        end=solution.end,
        steps=solution.steps,
    )


def _observer_error(law: AgentController, start: AgentStart) -> list[float]:
    if not start.observer:
        return []
    h, n = float(law.h or 1), len(start.x)
    return [
        h ** (n - k) * (x - estimate)
        for k, (x, estimate) in enumerate(zip(start.x, start.observer, strict=True), start=1)
    ]


def _signals(compiled: CompiledAgent, states: Array, inputs: Array, parameters: Sequence[float]) -> Array:
    columns = zip(states.T.tolist(), inputs.T.tolist(), strict=True)
    return np.array([compiled.signals(q, e, parameters) for q, e in columns]).T


def _verdict(agents: Sequence[AgentTrajectory], upper: UpperLayer) -> tuple[Status, str, float]:
    ends = [
        (agent.end, agent.status, f"agent {agent.id}: {agent.reason}")
        for agent in agents
        if agent.status != "completed"
    ]
    if upper.status != "completed":
        ends.append((upper.signals.end, upper.status, upper.reason))
    if not ends:
        return "completed", "", upper.signals.end
    end, status, reason = min(ends)
    return status, reason, end


def _sample_times(samples: int | Sequence[float] | Array, horizon: float) -> Array:
    if isinstance(samples, int):
        if samples < 2:
            raise InputError(f"at least 2 samples are needed, not {samples}")
        return np.linspace(0.0, horizon, samples)
    times = np.array(samples, dtype=float)
    if times.ndim != 1 or times.size == 0 or not np.all(np.diff(times) > 0) or times[0] < 0 or times[-1] > horizon:
        raise InputError(f"the sample times must increase within [0, {horizon:g}]")
    return times


def _frozen(array: Array) -> Array:
    copy = np.ascontiguousarray(array)
    copy.setflags(write=False)
    return copy
