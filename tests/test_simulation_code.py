"""The simulator's generated code and its equations: they are those of the theory."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
import pytest
import sympy
from closed_loops import controller_for

from sims import random_scenario, simulate
from sims.codegen import Saturation, compile_function
from sims.equations import closed_loop_equations, compile_agent
from symbolic.controller import Controller
from symbolic.network import laplacian
from symbolic.plant import Plant, symbol

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def controller(five_agents: Plant) -> Controller:
    return controller_for(five_agents, g=5, K=100, h=500, delta=1000)


# --- generated code ---------------------------------------------------------------------------------------------------


def test_compiled_functions_agree_with_sympy() -> None:
    x, y, a = symbol("x"), symbol("lambda"), symbol("a")
    expressions = [
        x**2 * y / 3 - sympy.sqrt(2) * a,
        sympy.exp(-x) + sympy.log(1 + y**2) + sympy.tanh(a) ** 3,
        sympy.sin(x) * sympy.cos(y) + sympy.tan(a / 7) + sympy.atan(x * y),
        sympy.sinh(x) / sympy.cosh(y) + sympy.sqrt(1 + a**2) + (2 + y) ** sympy.Rational(-1, 2) + x ** (-3),
        (2 + x) ** sympy.Rational(2, 3) + sympy.pi + sympy.E ** sympy.Integer(1),
        sympy.Integer(0),
    ]
    function = compile_function([(x, y), (a,)], expressions)
    at = {x: sympy.Rational(3, 5), y: sympy.Rational(-2, 7), a: sympy.Rational(11, 4)}
    values = function((0.6, -2 / 7), (2.75,))
    assert values == pytest.approx([float(e.subs(at)) for e in expressions], rel=1e-14)


def test_compiled_functions_take_sums_of_any_length() -> None:
    symbols = [symbol(f"x{k}") for k in range(3000)]
    assert compile_function([symbols], [sympy.Add(*symbols)])(range(3000)) == (3000 * 2999 / 2,)


def test_compiled_functions_refuse_what_is_not_arithmetic() -> None:
    x = symbol("x")
    with pytest.raises(ValueError, match="no code for gamma"):
        compile_function([(x,)], [sympy.gamma(x)])
    with pytest.raises(ValueError, match="the symbol y has no value"):
        compile_function([(x,)], [x + symbol("y")])
    with pytest.raises(OverflowError, match="beyond the range of floats"):
        compile_function([(x,)], [x + sympy.Rational(10) ** 400])


def test_saturation_and_its_slope() -> None:
    x = symbol("x")
    saturated = Saturation(3 * x, sympy.Integer(6))
    function = compile_function([(x,)], [saturated, sympy.diff(saturated, x)])
    assert [function((value,)) for value in (-5.0, -1.0, 0.0, 1.9, 2.0, 7.0)] == [
        (-6.0, 0.0),
        (-3.0, 3.0),
        (0.0, 3.0),
        (pytest.approx(5.7), 3.0),
        (6.0, 0.0),
        (6.0, 0.0),
    ]


# --- equations --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [1, 3])
def test_observer_error_is_the_observer(five_agents: Plant, controller: Controller, number: int) -> None:
    """``x̃_k = x_k − e_k/h^(n−k)`` satisfies the printed observer equation identically."""
    agent, law = five_agents.agents[number - 1], controller.agents[number - 1]
    equations = closed_loop_equations(agent, law, five_agents.exosystem)
    rate = dict(zip(equations.states, equations.derivative, strict=True))
    h, n, estimate = law.h, agent.order, equations.estimate
    assert h is not None
    for k in range(1, n + 1):
        derivative = sum(sympy.diff(estimate[k - 1], q) * dq for q, dq in rate.items())
        upper = estimate[k] if k < n else 0
        gain = sympy.Rational(h**k * law.observer[n - k])
        assert sympy.expand(derivative - upper - gain * (equations.x[0] - estimate[0])) == 0


@pytest.mark.parametrize("number", [1, 3])
def test_jacobian_is_the_derivative(five_agents: Plant, controller: Controller, number: int) -> None:
    compiled = compile_agent(five_agents.agents[number - 1], controller.agents[number - 1], five_agents.exosystem)
    dimension = len(compiled.equations.states)
    generator = np.random.default_rng(number)
    for scale in (1e-3, 1e3):  # within and beyond the saturation
        q = scale * generator.standard_normal(dimension)
        inputs, parameters = (0.3, 0.1, 0.9), (-1.0, 2.0, 1.5)
        jacobian = np.array(compiled.jacobian(q, inputs, parameters)).reshape(dimension, dimension)
        for j, step in enumerate(np.diag(np.full(dimension, 1e-6 * scale))):
            above = np.array(compiled.derivative(q + step, inputs, parameters))
            below = np.array(compiled.derivative(q - step, inputs, parameters))
            size = np.abs(jacobian).max()
            assert jacobian[:, j] == pytest.approx((above - below) / (2 * step[j]), rel=1e-5, abs=1e-7 * size)


def test_trajectory_satisfies_the_printed_equations(five_agents: Plant, controller: Controller) -> None:
    """Central differences of the samples against plant, observer, internal model and coordinator written by hand."""
    step = 1e-4
    times = np.sort(np.concatenate([t0 + step * np.arange(-2, 3) for t0 in (0.1, 0.4, 1.0, 3.0)]))
    scenario = random_scenario(five_agents, controller, 5)
    run = simulate(five_agents, controller, horizon=4, scenario=scenario, samples=times, rtol=1e-11, atol=1e-12)
    middle = slice(2, None, 5)

    def rate(signal: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        ahead, behind = signal[..., 3::5] - signal[..., 1::5], signal[..., 4::5] - signal[..., 0::5]
        return (8 * ahead - behind) / (12 * step)

    v1, v2 = run.v[:, middle]
    assert rate(run.v) == pytest.approx(np.array([0.8 * v2, -0.8 * v1]), abs=1e-6)
    L = np.array(laplacian(five_agents.digraph), dtype=float)
    y, zeta, xi = run.reference[:, middle], run.zeta[:, middle], run.mixing[:, middle]
    slope = (y - np.arange(5)[:, None]) / 2
    assert rate(run.reference) == pytest.approx(-slope / xi - 5 * L @ y - 5 * zeta, abs=1e-5)
    assert rate(run.zeta) == pytest.approx(5 * L @ y, abs=1e-5)
    for i, (agent, law) in enumerate(zip(run.agents, controller.agents, strict=True), start=1):
        p1, p2, p3 = scenario.agents[i - 1].parameters
        x, est, eta, u = agent.x[:, middle], agent.observer[:, middle], agent.eta[:, middle], agent.u[middle]
        if i <= 2:
            z = agent.z[0, middle]
            assert rate(agent.z[0]) == pytest.approx(p1 * z + x[0] + 11 * v1, abs=1e-5)
            f = p2 * z * x[0] * x[1] + p3 * x[1] + 12 * v2
            estimate = est[1] + 5 * (est[0] - y[i - 1])
            innovation = np.array([2 * 500, 500**2])[:, None] * (x[0] - est[0])
        else:
            f = p1 * x[2] + p2 * x[1] + p3 * x[0] ** 3 + 13 * v1
            estimate = est[2] + 5 * 2 * est[1] + 25 * (est[0] - y[i - 1])
            innovation = np.array([3 * 500, 3 * 500**2, 500**3])[:, None] * (x[0] - est[0])
        assert agent.vartheta_estimate[middle] == pytest.approx(estimate, rel=1e-9, abs=1e-9)
        model = np.array(law.psi, dtype=float) @ eta
        assert u == pytest.approx(-np.clip(100 * estimate, -1000, 1000) + model, rel=1e-9, abs=1e-7)
        assert rate(agent.x[:-1]) == pytest.approx(x[1:], abs=1e-4)
        assert rate(agent.x[-1]) == pytest.approx(f + u, rel=1e-4, abs=1e-3)
        assert rate(agent.observer[:-1]) == pytest.approx(est[1:] + innovation[:-1], rel=1e-3, abs=1e-2)
        assert rate(agent.observer[-1]) == pytest.approx(innovation[-1], rel=1e-3, abs=1e-2)
        M, N = np.array(law.M, dtype=float), np.array(law.N, dtype=float)
        assert rate(agent.eta) == pytest.approx(M @ eta + np.outer(N, u), rel=1e-4, abs=1e-3)
