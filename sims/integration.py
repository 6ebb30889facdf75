"""One agent's stiff loop, step by step, with escape and failure as results."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import LSODA

from sims.codegen import ARITHMETIC_ERRORS
from sims.coordinator import Status
from sims.equations import CompiledAgent
from sims.signals import Array

Reader = Callable[[float], Sequence[float]]


@dataclass(frozen=True)
class Solution:
    """States ``(dim q, len(times))``, NaN where the solution was not reached, and how it ended.

    ``saturated_time`` is the time in seconds during which the feedback was at its bound, ``last_saturated`` the last
    such instant (0 if never), ``end`` the last instant reached, and ``steps`` the number of accepted steps.
    """

    states: Array
    status: Status
    reason: str
    end: float
    saturated_time: float
    last_saturated: float
    steps: int


def integrate_agent(
    compiled: CompiledAgent,
    inputs: Reader,
    parameters: Sequence[float],
    start: Sequence[float],
    times: Array,
    *,
    end: float,
    threshold: float,
    rtol: float,
    atol: float,
    escape_radius: float,
    max_steps: int,
) -> Solution:
    """Solve ``q' = derivative(q, inputs(t), parameters)`` on ``[0, end]`` and read it at the increasing ``times``.

    SciPy's LSODA (compiled ODEPACK) changes between Adams and BDF: the observer's poles lie at ``−h`` and are stiff
    after the first ``1/h`` seconds, the rest of the run is smooth. It is given the analytic Jacobian. CVODE of
    scikit-sundae does the same for a wheel of 21 MB more; SciPy's BDF and Radau took 2.5 to 7 times as long on the
    five-agent example. The kink of the saturation is resolved by the step control. ``threshold`` is ``δ/K``: the
    feedback is saturated where ``|ϑ̃| ≥ δ/K``.

    The run counts as escaped when a plant state ``(z, x)`` exceeds ``escape_radius``; observer states may peak beyond
    it.
    """
    parameters = tuple(parameters)
    dimension = len(start)
    plant_states = len(compiled.equations.z) + len(compiled.equations.x)
    evaluate, slope, signals = compiled.derivative, compiled.jacobian, compiled.signals

    def derivative(t: float, q: Array) -> tuple[float, ...]:
        return evaluate(q.tolist(), inputs(t), parameters)

    def jacobian(t: float, q: Array) -> Array:
        return np.array(slope(q.tolist(), inputs(t), parameters)).reshape(dimension, dimension)

    states = np.full((dimension, len(times)), np.nan)
    states[:, times == 0.0] = np.array(start, dtype=float)[:, None]
    filled = int(np.searchsorted(times, 0.0, side="right"))
    t, saturated_time, last_saturated, steps = 0.0, 0.0, 0.0, 0
    size = max(map(abs, start[:plant_states]), default=0.0)
    status: Status = "completed"
    reason = ""

    with warnings.catch_warnings(record=True) as caught, np.errstate(all="ignore"):
        warnings.simplefilter("always")  # LSODA says in a warning why it gives up
        try:
            solver = LSODA(derivative, 0.0, np.array(start, dtype=float), end, jac=jacobian, rtol=rtol, atol=atol)
            while solver.status == "running":
                if steps >= max_steps:
                    status, reason = "failed", f"{max_steps} steps were not enough; the run stops at t = {t:.6g} s"
                    break
                solver.step()
                y = solver.y
                if solver.status == "failed" or not math.isfinite(y.sum()):
                    why = str(caught[-1].message) if caught else "a state is not finite"
                    status, reason = "failed", f"the integrator stops at t = {t:.6g} s: {why}"
                    break
                steps += 1
                reached = int(np.searchsorted(times, solver.t, side="right"))
                if reached > filled:
                    states[:, filled:reached] = solver.dense_output()(times[filled:reached])
                    filled = reached
                if abs(signals(y.tolist(), inputs(solver.t), parameters)[2]) >= threshold:
                    saturated_time += solver.t - t
                    last_saturated = solver.t
                t = solver.t
                size = float(np.abs(y[:plant_states]).max())
                if size > escape_radius:
                    status, reason = "escaped", f"a plant state exceeds {escape_radius:g} at t = {t:.6g} s"
                    break
        except ARITHMETIC_ERRORS as error:
            status, reason = "failed", f"the right-hand side cannot be evaluated beyond t = {t:.6g} s: {error}"
    if status == "failed" and size > math.sqrt(escape_radius):
        status, reason = "escaped", f"a plant state grows beyond {size:.3g} at t = {t:.6g} s and the step size vanishes"
    return Solution(states, status, reason, t, saturated_time, last_saturated, steps)
