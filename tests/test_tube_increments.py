"""What is bounded by norms in the direct route lies above what is sampled: increments, steady states, the peaking."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from certify.tube.increments import residuals
from certify.tube.peaking import Peaked
from certify.tube.surroundings import Moment
from symbolic.plant import COST_VARIABLE
from tests.tubes import QUICK, Array, Starts, passed, running, trials

EVERY = [*QUICK, ("five_agents", 1), ("five_agents", 3)]
SAMPLES = 400


def draw(generator: np.random.Generator, sides: list[tuple[float, float]]) -> Array:
    """Half of the points inside, half at corners: shape ``(len(sides), SAMPLES)``."""
    low, high = np.array(sides).reshape(len(sides), 2).T[:, :, None]
    inner = generator.random((len(sides), SAMPLES))
    inner[:, SAMPLES // 2 :] = np.round(inner[:, SAMPLES // 2 :])
    return np.asarray(low + inner * (high - low))


@pytest.mark.parametrize(("name", "number"), EVERY)
@pytest.mark.parametrize("size", [0.1, 1.0])
def test_increments_lie_below_their_bounds(name: str, number: int, size: float) -> None:
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
        there = _value(expression, symbols, [*steady, *rest, *v, *w])
        q.append(here - there - row @ np.vstack([z_bar, x_bar])[: len(row)])
    S, s = residuals(increments.slopes(z_size, x_size, moment), f0, f1, zeros)
    bound = S @ np.concatenate([z_size, x_size]) + s * moment.deviation
    reached = np.abs(np.array(q)).max(axis=1)
    assert np.all(reached <= bound * (1 + 1e-9) + 1e-12)
    pointwise = S @ np.abs(np.vstack([z_bar, x_bar])) + s[:, None] * np.abs(reference - optimum)
    assert np.all(np.abs(q) <= pointwise * (1 + 1e-9) + 1e-9)
    assert np.all(reached >= 0.1 * bound - 1e-9)


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


@pytest.mark.parametrize(("name", "number"), [key for key in EVERY if key not in [("first_order", 1), ("rooms", 2)]])
def test_the_state_after_the_peaking_phase_is_bounded(name: str, number: int) -> None:
    """``z̄, x̄`` and the observer's error at ``T1``, from corners and inner points; ``e`` is what decays meanwhile."""
    trial = passed(name, number)
    peaked: Peaked = trial.peaked
    if peaked.duration == 0:
        pytest.skip("no peaking phase was chosen: the tube begins at 0")
    starts = Starts(name, number, peaked.duration * 1.01)
    flight = starts.fly_alone(starts.corners_and_inner(8, 4), np.array([0.0, peaked.duration]))
    plant, n = len(trial.nominal.f1), trials(name, number).model.order
    assert np.all(np.abs(flight.outputs[:, :plant, 1]) <= peaked.state[:plant] * (1 + 1e-6))
    assert np.all(np.abs(flight.observer[:, :, 1]) <= peaked.state[-n:] * (1 + 1e-6) + 1e-9)
    assert np.abs(flight.observer[:, :, 0]).max() >= np.abs(flight.observer[:, :, 1]).max()


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_initial_magnitudes_cover_the_initial_set(name: str, number: int) -> None:
    starts, held = Starts(name, number, 0.1), trials(name, number)
    flight = starts.fly(starts.corners_and_inner(32, 16), np.array([0.0]))
    bound = np.concatenate([held.initial.z, held.initial.x])
    found = np.abs(flight.outputs[:, : len(bound), 0]).max(axis=0)
    assert np.all(found <= bound + 1e-9)
    assert found[-1] >= 0.9 * bound[-1]
    law = running(name, number).law
    if law.h is not None:
        h, n = float(law.h), len(flight.observer[0])
        scaled = np.abs(flight.observer[:, :, 0]).max(axis=0) / h ** np.arange(n - 1, -1, -1)
        assert np.all(scaled <= held.initial.estimate + 1e-9)
