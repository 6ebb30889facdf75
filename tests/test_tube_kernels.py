"""The nominal loop is the linearised closed loop, and its majorants lie above every impulse response, near it."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
import sympy
from flint import arb, arb_mat, ctx, fmpq

from certify.tube.certificate import tube_controller
from certify.tube.kernels import cells
from certify.tube.loop import Loop, LoopGains, nominal_loop
from certify.tube.modes import modes
from certify.tube.trial import Trial
from sims.codegen import Saturation
from sims.equations import closed_loop_equations
from symbolic.exact_field import as_expression
from tests.tubes import QUICK, Array, loop_of, passed, trials

EVERY = [*QUICK, ("five_agents", 1)]


def responses(loop: Loop, times: Array) -> Array:
    """``C e^{At} [B | I]`` in ball arithmetic: A is stiff, and floats would drown the small entries in rounding."""
    with ctx.workprec(400):
        A = arb_mat([[_ball(entry) for entry in row] for row in loop.A])
        C = arb_mat([[_ball(entry) for entry in row] for row in loop.outputs])
        unit = [[Fraction(i == j) for j in range(loop.size)] for i in range(loop.size)]
        J = arb_mat([[_ball(entry) for entry in row] for row in (*loop.columns, *unit)]).transpose()
        found = [C * (A * _ball(Fraction(float(t)))).exp() * J for t in times]
        assert all(entry.rad() < 1e-9 for matrix in found for entry in matrix.entries())
        return np.array([[[float(entry.mid()) for entry in row] for row in matrix.tolist()] for matrix in found])


def _ball(value: Fraction) -> arb:
    return arb(fmpq(value.numerator, value.denominator))


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_majorants_lie_above_the_impulse_responses(name: str, number: int) -> None:
    trial = passed(name, number)
    slowest, fastest = trial.modes.decay.min(), np.hypot(trial.modes.decay, trial.modes.frequency).max()
    generator = np.random.default_rng(number)
    times = np.exp(generator.uniform(np.log(1e-3 / fastest), np.log(45 / slowest), 80))
    times = np.concatenate([[0.0], times])
    true = np.abs(responses(loop_of(name, number), times))
    bound = np.einsum("ija,ta->tij", trial.kernels.coefficients, np.exp(-np.outer(times, trial.kernels.rates)))
    assert np.all(trial.kernels.coefficients >= 0)
    assert np.all(true <= bound * (1 + 1e-12))
    assert np.any(true > bound / 3)  # a third of it would not do


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_majorants_are_within_a_factor_of_the_peak_to_peak_gains(name: str, number: int) -> None:
    """The gains ``Σ c_a/μ_a`` against ``∫|k|`` from the inputs to ``ϑ̃``, which decide how far the tube reaches."""
    trial, loop = passed(name, number), loop_of(name, number)
    ends = cells(trial.modes)
    ends = np.unique(np.concatenate([ends[::4], np.linspace(0, 12 / trial.modes.decay.min(), 400)]))
    k = np.abs(_floats(trial, ends))[:, loop.plant_outputs, : len(loop.columns)]
    true = ((k[1:] + k[:-1]) / 2 * np.diff(ends)[:, None]).sum(axis=0)
    gains, reached = trial.kernels.gains[loop.plant_outputs], true > 0
    ratio = gains[reached] / true[reached]
    assert np.all(ratio > 0.98) and np.all(ratio < 3), ratio
    assert np.all(ratio[-2:] < 2), ratio  # from the increments of f1 and from the reference
    assert np.all(gains[~reached] < 1e-6 * gains.max())


def _floats(trial: Trial, times: Array) -> Array:
    """The responses from the modes; the other test has exact ones."""
    found = trial.modes
    moved = np.exp(-np.outer(times, found.decay))[:, :, None] * found.columns[None]
    position = 0
    for size in found.blocks:
        if size == 2:
            a, e = position, np.exp(-found.decay[position] * times)[:, None]
            c, s = (f(found.frequency[position] * times)[:, None] for f in (np.cos, np.sin))
            first, second = found.columns[a][None], found.columns[a + 1][None]
            moved[:, a], moved[:, a + 1] = e * (c * first + s * second), e * (c * second - s * first)
        position += size
    return np.einsum("ia,taj->tij", found.outputs, moved)


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_the_nominal_matrix_is_the_closed_loop_linearised(name: str, number: int) -> None:
    """Exactly: the simulation's equations with nominal slopes have the Jacobian ``A`` and the column ``B``."""
    trial, model = passed(name, number), trials(name, number).model
    law, agent, nominal = tube_controller(model, trial), model.agent, trial.nominal
    increment = sympy.Dummy("q")

    def slope(row: tuple[Fraction, ...], states: tuple[sympy.Symbol, ...]) -> sympy.Expr:
        return sympy.Add(*(as_expression(entry) * state for entry, state in zip(row, states, strict=True)))

    linear = dataclasses.replace(
        agent,
        zero_dynamics=tuple(slope(row, (*agent.zero_states, agent.chain[0])) for row in nominal.f0),
        f=slope(nominal.f1, (*agent.zero_states, *agent.chain)) + increment,
        b=as_expression(nominal.b),
    )
    equations = closed_loop_equations(linear, law, model.exosystem)
    order = (*equations.z, *equations.x, *equations.eta, *equations.e)
    rate = dict(zip(equations.states, equations.derivative, strict=True))
    rows = [rate[state].replace(Saturation, lambda argument, level: argument) for state in order]
    loop = loop_of(name, number)
    assert sympy.Matrix(rows).jacobian(order) == sympy.Matrix(
        loop.size, loop.size, lambda i, j: as_expression(loop.A[i][j])
    )
    into = sympy.Matrix(rows).diff(increment)
    assert list(into) == [as_expression(entry) for entry in loop.columns[loop.zeros]]
    estimate = equations.vartheta_estimate
    assert [sympy.diff(estimate, state) for state in order] == [
        as_expression(entry) for entry in loop.outputs[loop.plant_outputs]
    ]


@pytest.mark.parametrize("name", ["first_order", "rooms"])
def test_a_first_order_agents_increment_enters_x1_alone(name: str) -> None:
    loop = loop_of(name, {"first_order": 1, "rooms": 2}[name])
    assert loop.internal > 0
    column = loop.columns[loop.zeros]
    assert [k for k, entry in enumerate(column) if entry] == [loop.zeros]


def test_an_unstable_nominal_loop_has_no_modes() -> None:
    held = trials("third_order_actuator", 2)
    loop = nominal_loop(held.model, LoopGains(Fraction(2), Fraction(60), Fraction(5)), held.nominal)
    assert modes(loop) is None
    result = held.attempt(LoopGains(Fraction(2), Fraction(60), Fraction(5)))
    assert getattr(result, "reason", "") == "the nominal loop is not stable"
