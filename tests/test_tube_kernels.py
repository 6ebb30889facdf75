"""The nominal loop is the linearised closed loop, and its majorants lie above every impulse response, near it."""

from __future__ import annotations

import dataclasses
from fractions import Fraction
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import sympy
from flint import arb, arb_mat, ctx, fmpq

from certify.checker.balls import BITS, precision
from certify.checker.rules import kernels as checker_kernels
from certify.checker.rules import loop as checker_loop
from certify.tube.certificate import tube_controller
from certify.tube.kernels import cells
from certify.tube.loop import Loop, LoopGains, nominal_loop
from certify.tube.modes import Modes, NoModes, modes
from certify.tube.trial import Trial
from sims.codegen import Saturation
from sims.equations import closed_loop_equations
from symbolic.exact_field import as_expression
from tests.tubes import QUICK, Array, loop_of, passed, trials

EVERY = [*QUICK, ("five_agents", 1)]


def responses(loop: Loop, times: Array) -> Array:
    """``C e^{At} [B | S]`` in ball arithmetic: A is stiff, and floats would drown the small entries in rounding."""
    with ctx.workprec(400):
        A = arb_mat([[_ball(entry) for entry in row] for row in loop.A])
        C = arb_mat([[_ball(entry) for entry in row] for row in loop.outputs])
        J = arb_mat([[_ball(entry) for entry in row] for row in (*loop.columns, *loop.starts)]).transpose()
        found = [C * (A * _ball(Fraction(float(t)))).exp() * J for t in times]
        assert all(entry.rad() < 1e-9 for matrix in found for entry in matrix.entries())
        return np.array([[[float(entry.mid()) for entry in row] for row in matrix.tolist()] for matrix in found])


def _ball(value: Fraction) -> arb:
    return arb(fmpq(value.numerator, value.denominator))


@pytest.mark.parametrize("turns", [[], [3.0], [5.0], [5.0, 170.0], [40.0, 0.5]])
def test_the_search_and_the_checker_divide_time_alike(turns: list[float]) -> None:
    """Majorants are made with 1e-4 of room, so that the cells must be the same but for rounding."""
    decays = [1.0, 0.25, *(size for k in range(len(turns)) for size in [2.0 + 8 * k] * 2)]
    frequencies = [0.0, 0.0, *(side * turn for turn in turns for side in (1, -1))]
    blocks = (1, 1, *(2 for _ in turns))
    A = np.diag(-np.array(decays))
    for k, turn in enumerate(turns):
        A[2 * k + 2, 2 * k + 3], A[2 * k + 3, 2 * k + 2] = turn, -turn
    exact = [[Fraction(float(entry)) for entry in row] for row in A]
    unit = [[Fraction(int(i == j)) for j in range(len(A))] for i in range(len(A))]
    zero = np.zeros((len(A), len(A)))
    found = Modes((), blocks, np.array(decays), np.array(frequencies), zero, zero)
    witness = SimpleNamespace(
        modes=unit, blocks=blocks, rates=[Fraction(1, 8)], kernels=[[[Fraction(1)]] * len(A)] * len(A)
    )
    plain = checker_loop.Loop(0, 1, exact, [[] for _ in A], unit, unit)
    with precision(BITS):
        theirs = [float(end) for _, end in checker_kernels._Kernels("agent", plain, cast(Any, witness)).cells()]
    mine = cells(found)[1 : len(theirs) + 1]
    assert len(theirs) <= len(cells(found)) and np.allclose(mine, theirs, rtol=1e-9)
    assert theirs[-1] >= 32 / min(decays)
    widths = np.diff(theirs) / np.array(theirs[:-1])
    assert widths.max() <= 1 / 16 + 1e-9 and (widths.min() < 1 / 20) == any(
        turn > 4 * (2.0 + 8 * k) for k, turn in enumerate(turns)
    )


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_majorants_lie_above_the_impulse_responses(name: str, number: int) -> None:
    trial = passed(name, number)
    slowest, fastest = trial.modes.decay.min(), np.hypot(trial.modes.decay, trial.modes.frequency).max()
    generator = np.random.default_rng(number)
    times = np.exp(generator.uniform(np.log(1e-3 / fastest), np.log(45 / slowest), 80))
    times = np.concatenate([[0.0], times])
    exact = responses(loop_of(name, number), times)
    bound = sums(trial, times)
    assert np.all(np.abs(exact) <= bound * (1 + 1e-12))
    assert np.any(np.abs(exact) > bound / 3)  # a third of it would not do
    rounding = (
        1e-12 * np.linalg.norm(trial.modes.outputs, axis=1)[:, None] * np.linalg.norm(trial.modes.columns, axis=0)
    )
    assert np.all(np.abs(_floats(trial, times) - exact) <= rounding)
    ends = cells(trial.modes)
    fine = np.concatenate([ends[:-1] + share * np.diff(ends) for share in (0.0, 0.25, 0.5, 0.75, 1.0)])
    assert np.all(np.abs(_floats(trial, fine)) <= sums(trial, fine) + rounding)


def sums(trial: Trial, times: Array) -> Array:
    return np.einsum("ija,ta->tij", trial.kernels.coefficients, np.exp(-np.outer(times, trial.kernels.rates)))


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_majorants_of_responses_that_begin_at_zero_begin_low(name: str, number: int) -> None:
    """Which only coefficients of either sign can do; positive ones add up at 0."""
    trial, loop = passed(name, number), loop_of(name, number)
    assert np.any(trial.kernels.coefficients < 0)
    times = np.append(0.0, np.geomspace(1e-3 / trial.kernels.rates[-1], 5 / trial.kernels.rates[0], 400))
    found, height = sums(trial, times), np.abs(_floats(trial, times)).max(axis=0)
    zero = [
        [not any(c * x for c, x in zip(row, column, strict=True)) for column in (*loop.columns, *loop.starts)]
        for row in loop.outputs
    ]
    matters = np.array(zero) & (height > 1e-6)
    assert matters.any()
    assert np.median(found[0][matters] / found.max(axis=0)[matters]) < 0.2


@pytest.mark.parametrize(("name", "number"), EVERY)
def test_start_columns_are_a_change_of_coordinates(name: str, number: int) -> None:
    """Exactly ``X = Σ S_l Y_l`` with ``ϑ = θx̄`` and ``ζ = η̄ − N x̄_n/b`` in place of ``x̄_n`` and ``η̄``."""
    loop, model = loop_of(name, number), trials(name, number).model
    gains, nominal = passed(name, number).gains, trials(name, number).nominal
    nz, n, s = loop.zeros, loop.order, loop.internal
    generator = np.random.default_rng(1)
    X = [Fraction(int(k), 7) for k in generator.integers(-50, 50, loop.size)]
    x, eta = X[nz : nz + n], X[nz + n : nz + n + s]
    theta = [*(gains.g ** (n - k) * model.gamma[k - 1] for k in range(1, n)), Fraction(1)]
    vartheta = sum((a * b for a, b in zip(theta, x, strict=True)), Fraction(0))
    zeta = [value - N * x[-1] / nominal.b for value, N in zip(eta, model.internal_model.N, strict=True)]
    Y = [*X[:nz], *x[:-1], vartheta, *zeta, *X[nz + n + s :]]
    assert [sum(y * row[k] for y, row in zip(Y, loop.starts, strict=True)) for k in range(loop.size)] == X


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
    law, agent, nominal = tube_controller(trial), model.agent, trial.nominal
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
    last = sympy.Matrix([rows[loop.plant_outputs - 1]]).jacobian(order)
    slopes = [*map(as_expression, nominal.f1), *[sympy.Integer(0)] * (loop.size - loop.plant_outputs)]
    # υ is what b multiplies in x_n'
    assert [sympy.expand(a - b) for a, b in zip(last, slopes, strict=True)] == [
        as_expression(nominal.b * entry) for entry in loop.outputs[loop.plant_outputs + 1]
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
    assert modes(loop) is NoModes.UNSTABLE
    result = held.attempt(LoopGains(Fraction(2), Fraction(60), Fraction(5)))
    assert getattr(result, "reason", "") == "the nominal loop is not stable"
