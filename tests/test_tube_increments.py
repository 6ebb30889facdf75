"""What is bounded by norms in the direct route lies above what is sampled: increments, steady states, phase 1."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.linalg import expm

from certify.tube.increments import Ranges, Slopes, residuals
from certify.tube.surroundings import Moment
from certify.tube.trial import AgentTrials
from symbolic.plant import COST_VARIABLE
from tests.tubes import (
    QUICK,
    TOLERANCE,
    Array,
    Starts,
    largest_vartheta,
    leaves_ranges,
    passed,
    reaching_usage,
    running,
    trials,
)

EVERY = [*QUICK, ("five_agents", 1), ("five_agents", 3)]
SAMPLES = 400
EMPTY: Ranges = ()


def draw(generator: np.random.Generator, sides: list[tuple[float, float]]) -> Array:
    """Half of the points inside, half at corners: shape ``(len(sides), SAMPLES)``."""
    low, high = np.array(sides).reshape(len(sides), 2).T[:, :, None]
    inner = generator.random((len(sides), SAMPLES))
    inner[:, SAMPLES // 2 :] = np.round(inner[:, SAMPLES // 2 :])
    return np.asarray(low + inner * (high - low))


@pytest.mark.parametrize(("name", "number"), EVERY)
@pytest.mark.parametrize("size", [0.1, 1.0])
@pytest.mark.parametrize("known", [False, True])
def test_increments_lie_below_their_bounds(name: str, number: int, size: float, known: bool) -> None:
    """Also where something is known of ``z`` itself: points that are elsewhere do not count."""
    held, generator = trials(name, number), np.random.default_rng(5)
    model, increments = held.model, held.increments
    agent, zeros, n = model.agent, increments.zeros, model.order
    z_size, x_size = size * (1 + np.arange(zeros)), size * (1 + np.arange(n))
    moment: Moment = held.surroundings.during(0.5, 0.75)
    rows = draw(generator, [*moment.v, *increments.parameters, moment.reference])
    v, w, reference = rows[: len(moment.v)], rows[len(moment.v) : -1], rows[-1]
    z_bar = draw(generator, [(-b, b) for b in z_size])
    x_bar = draw(generator, [(-b, b) for b in x_size])
    optimum = np.full(SAMPLES, float(model.optimum.lo))
    outside = (COST_VARIABLE, *model.exosystem.states, *agent.parameters)
    steady = np.array([_value(part, outside, [optimum, *v, *w]) for part in model.steady_state]).reshape(zeros, SAMPLES)
    around, ranges = increments.zero_ranges(z_size, moment), EMPTY
    if known:
        ranges = tuple((low + 0.3 * (high - low), high - 0.2 * (high - low)) for low, high in around)
        z = draw(generator, list(ranges)).reshape(zeros, SAMPLES)
        z_bar = z - steady
    there = np.all(np.abs(z_bar) <= z_size[:, None] * (1 + 1e-12), axis=0)
    assert there.any()
    x = x_bar.copy()
    x[0] += reference
    rest = np.zeros((n, SAMPLES))
    rest[0] = optimum
    symbols = (*agent.zero_states, *agent.chain, *model.exosystem.states, *agent.parameters)
    f0 = np.array([[float(a) for a in row] for row in held.nominal.f0]).reshape(zeros, zeros + 1)
    f1 = np.array([float(a) for a in held.nominal.f1])
    q = []
    for expression, row in zip((*agent.zero_dynamics, agent.f), [*f0, f1], strict=True):
        here = _value(expression, symbols, [*(steady + z_bar), *x, *v, *w])
        at_rest = _value(expression, symbols, [*steady, *rest, *v, *w])
        q.append(here - at_rest - row @ np.vstack([z_bar, x_bar])[: len(row)])
    S, s = bounds_of_inputs(held, increments.slopes(z_size, x_size, moment, ranges))
    bound = S @ np.concatenate([z_size, x_size]) + s * moment.deviation
    found = np.abs(np.array(q))[:, there]
    reached = found.max(axis=1)
    assert np.all(reached <= bound * (1 + 1e-9) + 1e-12)
    pointwise = S @ np.abs(np.vstack([z_bar, x_bar])) + s[:, None] * np.abs(reference - optimum)
    assert np.all(found <= pointwise[:, there] * (1 + 1e-9) + 1e-9)
    assert known or np.all(reached >= 0.1 * bound - 1e-9)
    if known:
        wide, _ = bounds_of_inputs(held, increments.slopes(z_size, x_size, moment))
        assert np.all(wide * (1 + 1e-9) + 1e-12 >= S)


def bounds_of_inputs(held: AgentTrials, slopes: Slopes) -> tuple[Array, Array]:
    """``S`` and ``s`` of ``residuals`` as arrays."""
    f0, f1 = ([[float(a) for a in row] for row in rows] for rows in (held.nominal.f0, [held.nominal.f1]))
    rows, s = residuals(slopes, f0, f1[0], held.increments.zeros)
    return np.array([row + [0.0] * (len(rows[-1]) - len(row)) for row in rows]), np.array(s)


def _value(expression: sympy.Expr, symbols: tuple[sympy.Symbol, ...], values: list[Array]) -> Array:
    return np.broadcast_to(sympy.lambdify(symbols, expression, "numpy")(*values), SAMPLES)


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_moments_contain_the_exosystem_the_reference_and_the_steady_state(name: str, number: int) -> None:
    starts, held = Starts(name, number, 12.0), trials(name, number)
    model, generator = held.model, np.random.default_rng(2)
    symbols = (COST_VARIABLE, *model.exosystem.states, *model.agent.parameters)
    optimum = float(model.optimum.lo)
    for begin in generator.uniform(0, 8, 12):
        length = float(np.exp(generator.uniform(np.log(1e-3), np.log(1.0))))
        moment = held.surroundings.during(begin, begin + length)
        times = np.linspace(begin, begin + length, 9)
        w = draw(generator, held.increments.parameters)[:, :9]
        for layer in starts.layers:
            reference, *v = layer.signals.sample(times)[layer.inputs_of(number)]
            for signal, (low, high) in zip((reference, *v), (moment.reference, *moment.v), strict=True):
                assert low - 1e-7 <= signal.min() and signal.max() <= high + 1e-7
            assert np.abs(reference - optimum).max() <= moment.deviation + 1e-7
            assert np.abs(np.diff(reference) / np.diff(times)).max() <= moment.rate + 1e-6
            for part, (low, high) in zip(model.steady_state, moment.steady, strict=True):
                star = np.broadcast_to(sympy.lambdify(symbols, part, "numpy")(optimum, *v, *w), 9)
                assert low - 1e-7 <= star.min() and star.max() <= high + 1e-7


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_later_contains_every_phase_of_the_exosystem(name: str, number: int) -> None:
    """The steady states on the ellipsoid around the orbits of ``V0``, by long flights from its corners."""
    held, generator = trials(name, number), np.random.default_rng(3)
    model, S, moment = held.model, held.surroundings.S, held.surroundings.later()
    symbols = (COST_VARIABLE, *model.exosystem.states, *model.agent.parameters)
    corners = draw(generator, [(float(side.lo), float(side.hi)) for side in model.exosystem.initial])
    w = draw(generator, held.increments.parameters)
    optimum, used = float(model.optimum.lo), [0.0] * len(model.steady_state)
    for time in generator.uniform(0, 60, 40):
        v = expm(S * time) @ corners
        for part, (low, high) in zip(v, moment.v, strict=True):
            assert low - 1e-9 <= part.min() and part.max() <= high + 1e-9
        for k, (expression, (low, high)) in enumerate(zip(model.steady_state, moment.steady, strict=True)):
            star = _value(expression, symbols, [np.full(SAMPLES, optimum), *v, *w])
            assert low - 1e-9 <= star.min() and star.max() <= high + 1e-9
            used[k] = max(used[k], float(np.ptp(star)) / max(high - low, 1e-9))
    assert all(share > 0.4 for share in used if share), used


SATURATED = [
    ("van_der_pol", 2),
    ("third_order_actuator", 2),
    ("fourth_order", 1),
    *(("five_agents", number) for number in range(1, 6)),
]


@pytest.mark.parametrize(("name", "number"), dict.fromkeys([*EVERY, *SATURATED]))
def test_the_first_phase_is_bounded(name: str, number: int) -> None:
    """From corners and inner points, by LSODA: all magnitudes on all steps, and ``Y`` where the tube begins."""
    trial, held = passed(name, number), trials(name, number)
    duration = trial.reached.duration
    grid = np.array(trial.reached.grid)
    times = np.unique(np.concatenate([grid, grid[:-1] + 0.4 * np.diff(grid), grid[:-1] + 0.8 * np.diff(grid)]))
    starts = Starts(name, number, duration + 0.01)
    flight = starts.fly_alone(starts.corners_and_inner(8, 4), np.append(times, duration + 0.01))
    used = reaching_usage(trial, flight, largest_vartheta(name, number))
    assert used.max() <= 1, used.max(axis=0)
    end = len(times) - 1
    assert flight.times[end] == duration
    Y = np.abs(flight.Y[:, :, end]).max(axis=0)
    assert np.all(trial.reached.start * (1 + 1e-6) + TOLERANCE >= Y), Y / trial.reached.start
    assert leaves_ranges(trial, flight, held.initial.ranges) <= TOLERANCE
    vartheta = np.abs(flight.outputs[:, held.increments.zeros + held.increments.order])
    level = float(trial.delta / trial.gains.K)
    assert vartheta[:, end:].max() <= level
    if (name, number) in SATURATED:
        assert duration > 0.01 and vartheta[:, :end].max() > 2 * level  # the saturation does act
        later = times > duration / 5  # and the line of vartheta is about these trajectories
        line = np.interp(times, grid, [largest_vartheta(name, number), *trial.reached.vartheta])
        assert np.max(np.abs(flight.reaching[:, len(trial.nominal.f1), :-1][:, later]) / line[later]) > 0.3


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_initial_magnitudes_cover_the_initial_set(name: str, number: int) -> None:
    starts, held = Starts(name, number, 0.1), trials(name, number)
    flight = starts.fly(starts.corners_and_inner(32, 16), np.array([0.0]))
    bound = np.concatenate([held.initial.z, held.initial.x])
    found = np.abs(flight.outputs[:, : len(bound), 0]).max(axis=0)
    assert np.all(found <= bound + 1e-9)
    assert found[-1] >= 0.9 * bound[-1]
    law, n = running(name, number).law, held.model.order
    if law.h is not None:
        scaled = np.abs(flight.Y[:, -n:, 0]).max(axis=0) / float(law.h) ** np.arange(n - 1, -1, -1)
        assert np.all(scaled <= held.initial.estimate + 1e-9)
