"""Simulation of the closed loop: the equations, what is conserved, convergence, escape and failure as results."""

from __future__ import annotations

import dataclasses
import warnings
from fractions import Fraction
from typing import Any

import matplotlib
import numpy as np
import pytest
import sympy
from closed_loops import controller_for, corner, with_gains

from sims import Trajectory, ensemble, estimated_optimum, nominal, random_scenario, simulate
from sims.codegen import Saturation, compile_function
from sims.equations import closed_loop_equations, compile_agent
from symbolic.controller import AgentController, Controller
from symbolic.errors import InputError
from symbolic.network import laplacian
from symbolic.plant import Plant, symbol
from symbolic.plant_file import parse_plant

matplotlib.use("Agg")

R = np.array([2.0, 4.0, 3.0, 1.0, 1.0]) / 11  # left null vector of the example's Laplacian


def with_alpha(controller: Controller, alpha1: int, alpha2: int) -> Controller:
    return dataclasses.replace(controller, alpha1=Fraction(alpha1), alpha2=Fraction(alpha2))


def without_internal_model(controller: Controller) -> Controller:
    laws = tuple(dataclasses.replace(law, M=(), N=(), psi=()) for law in controller.agents)
    return dataclasses.replace(controller, agents=laws)


@pytest.fixture(scope="module")
def controller(five_agents: Plant) -> Controller:
    return controller_for(five_agents, g=5, K=100, h=500, delta=1000)


@pytest.fixture(scope="module")
def run(five_agents: Plant, controller: Controller) -> Trajectory:
    """A start that saturates every agent's input at first."""
    scenario = random_scenario(five_agents, controller, 2)
    return simulate(five_agents, controller, horizon=40, scenario=scenario)


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
    with pytest.raises(ValueError, match="beyond the range of floats"):
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


# --- the coordinator --------------------------------------------------------------------------------------------------


def test_coordinator_conserves_and_mixes(run: Trajectory) -> None:
    """``rᵀζ = 0`` is conserved, ``ξ_i^i → r_i``, ``y^r → s*``, and the exosystem stays on its circle."""
    assert np.abs(R @ run.zeta).max() < 1e-9
    assert run.mixing[:, 0] == pytest.approx(np.ones(5))
    assert run.mixing[:, -1] == pytest.approx(R, abs=1e-10)
    assert run.mixing[0].min() == pytest.approx(0.1667, abs=1e-4)  # below r_1 = 2/11 for a while
    assert run.reference[:, -1] == pytest.approx(np.full(5, 2.0), abs=1e-8)
    assert np.abs((run.v**2).sum(axis=0) - 1).max() < 1e-8


def test_mixing_is_the_matrix_exponential(five_agents: Plant, run: Trajectory) -> None:
    from scipy.linalg import expm

    L = np.array(laplacian(five_agents.digraph), dtype=float)
    for k in (1, 10, 25, 100, 400):
        assert run.mixing[:, k] == pytest.approx(np.diagonal(expm(-L * run.t[k])), abs=1e-10)


@pytest.mark.parametrize("alpha2", [1, 5])
def test_another_zeta_settles_elsewhere(five_agents: Plant, controller: Controller, alpha2: int) -> None:
    """``Σ c_i'(s) = −α2 rᵀζ(0)``: from ``ζ(0) = ½·1`` the outputs settle at ``2 − α2/5``: 1.8 for ``α2 = 1``."""
    law = with_alpha(controller, 5, alpha2)
    scenario = nominal(five_agents, law).with_zeta([0.5] * 5)
    run = simulate(five_agents, law, horizon=60, scenario=scenario, samples=2)
    assert run.y[:, -1] == pytest.approx(np.full(5, 2 - alpha2 / 5), abs=1e-4)


def test_unstable_coordinator_escapes(five_agents: Plant, controller: Controller) -> None:
    """For ``α1 = 1`` the example's coordinator is unstable beyond ``α2 = 73``."""
    run = simulate(five_agents, with_alpha(controller, 1, 200), horizon=40)
    assert run.status == "escaped"
    assert run.end < 40


# --- what a run shows -------------------------------------------------------------------------------------------------


def test_outputs_reach_the_optimum(run: Trajectory) -> None:
    assert run.status == "completed" and run.end == 40
    assert run.optimum == pytest.approx(2.0, abs=1e-12)
    assert run.final_error(window=1.0) < 1e-7
    assert np.abs(run.u).max() > 500
    assert (run.saturated_fraction > 0).all() and (run.saturated_fraction < 0.01).all()
    assert all(agent.last_saturated < 0.5 for agent in run.agents)


def test_start_is_the_scenario(run: Trajectory) -> None:
    for agent, start in zip(run.agents, run.scenario.agents, strict=True):
        assert tuple(agent.z[:, 0]) == start.z
        assert tuple(agent.x[:, 0]) == start.x
        assert agent.observer[:, 0] == pytest.approx(start.observer, abs=1e-12)
        assert tuple(agent.eta[:, 0]) == start.eta
        assert all(abs(value) <= 1 for value in start.x + start.z)


def test_tolerances_resolve_the_kink(five_agents: Plant, controller: Controller, run: Trajectory) -> None:
    """All inputs saturate at first; a hundredfold tolerance moves no output by more than a few tolerances."""
    tight = simulate(five_agents, controller, horizon=40, scenario=run.scenario, rtol=1e-10, atol=1e-12)
    assert np.abs(run.y - tight.y).max() < 2e-7
    assert all(
        a.last_saturated == pytest.approx(b.last_saturated, abs=1e-3)
        for a, b in zip(run.agents, tight.agents, strict=True)
    )


def test_internal_model_matters(five_agents: Plant, controller: Controller) -> None:
    run = simulate(five_agents, without_internal_model(controller), horizon=30)
    assert run.status == "completed"
    assert (run.error[:, run.t > 20].max(axis=1) > 5e-3).all()  # every output keeps oscillating


def test_published_gains_end_in_a_limit_cycle(five_agents: Plant, controller: Controller) -> None:
    """``K = 4e4, h = 100`` is linearly unstable: the feedback stays at its bound and ``|y − 2|`` does not vanish."""
    law = with_gains(controller, K=40_000, h=100, delta=200)
    run = simulate(five_agents, law, horizon=12, samples=np.linspace(8, 12, 2001))
    assert run.status == "completed"
    first, second = np.split(run.error[:, :2000], 2, axis=1)
    swing = np.ptp(run.y[:, run.t > 10], axis=1)
    assert (swing > 1e-3).all()
    assert (second.max(axis=1) > 0.3 * first.max(axis=1)).all()
    assert (run.saturated_fraction > 0.9).all()


def test_finite_escape_is_a_result(five_agents: Plant, controller: Controller) -> None:
    """``(g, K, h) = (3, 30, 100)`` at the corner escapes; ``(2, 40, 150)`` survives the same corner."""
    weak = with_gains(controller, g=3, K=30, h=100)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = simulate(five_agents, weak, horizon=40, scenario=corner(five_agents, weak))
    assert run.status == "escaped"
    assert run.reason.startswith("agent 1: a plant state exceeds 1e+09 at t = 3.09")
    assert 3.0 < run.end < 3.2
    assert run.final_error() == float("inf")
    assert [agent.status for agent in run.agents] == ["escaped"] * 2 + ["completed"] * 3
    assert np.isnan(run.y[0, run.t > run.end]).all() and np.isfinite(run.y[0, run.t < run.end]).all()
    strong = with_gains(controller, g=2, K=40, h=150)
    assert simulate(five_agents, strong, horizon=20, scenario=corner(five_agents, strong)).final_error() < 1e-3


def test_gains_beyond_the_integrator_are_a_failure_with_a_reason(five_agents: Plant, controller: Controller) -> None:
    recipe = with_gains(controller, K=10**12, h=10**41, delta=10**20)
    run = simulate(five_agents, recipe, horizon=1)
    assert run.status == "failed"
    assert run.reason.startswith("agent 1: the integrator stops at t = 0 s: lsoda:")


def test_large_gains_are_integrated(five_agents: Plant, controller: Controller) -> None:
    """``h^3 = 2e16``: in the observer's own coordinates rounding noise would stall the step control."""
    law = with_alpha(with_gains(controller, g=3, K=1000, h=260_000, delta=4800), 3, 2)
    run = simulate(five_agents, law, horizon=40, scenario=random_scenario(five_agents, law, 1))
    assert run.final_error() < 1e-6
    assert max(agent.steps for agent in run.agents) < 20_000


# --- other plants -----------------------------------------------------------------------------------------------------

FIRST_ORDER = b"""
schema = "consensus-plant/1"
name = "first-order"
[network]
agents = 2
edges = ["1 -> 2", "2 -> 1"]
[initial]
box = [-1, 1]
[[agent]]
ids = [1, 2]
order = 1
f = "p*x1 - x1^3"
b = "1"
cost = "(s - id)^2 + exp(s - id)"
uncertain = { p = [0, 1] }
"""


def proportional(plant: Plant, K: int | Fraction, delta: int) -> Controller:
    """``u = −sat_δ(K (y − y^r))`` for agents of order 1."""
    gains = {"g": Fraction(1), "K": Fraction(K), "delta": Fraction(delta), "h": None}
    laws = [AgentController(agent.id, gamma=(), observer=(), M=(), N=(), psi=(), **gains) for agent in plant.agents]
    return Controller(Fraction(2), Fraction(2), tuple(laws))


def test_first_order_without_disturbance_or_observer() -> None:
    """Non-quadratic costs; proportional control leaves an offset that shrinks like 1/K, and there is no observer."""
    plant = parse_plant(FIRST_ORDER, "test")
    optimum = estimated_optimum(plant)
    slope = sum(2 * (optimum - i) + np.exp(optimum - i) for i in (1, 2))
    assert abs(slope) < 1e-12
    law = proportional(plant, K=1000, delta=10_000)
    run = simulate(plant, law, horizon=60, scenario=random_scenario(plant, law, 0))
    assert run.agents[0].observer.shape == (0, 1001) and run.v.shape == (0, 1001)
    assert run.reference[:, -1] == pytest.approx(np.full(2, optimum), abs=1e-7)
    assert 1e-7 < run.final_error() < 1e-2


def test_leaving_the_domain_is_a_failure_with_a_reason() -> None:
    plant = parse_plant(FIRST_ORDER.replace(b"p*x1 - x1^3", b"p*log(1 + x1) - 5"), "test")
    run = simulate(plant, proportional(plant, K=Fraction(1, 100), delta=1), horizon=10)
    assert run.status == "failed"
    assert "the right-hand side cannot be evaluated beyond t = " in run.reason


def test_costs_without_a_minimum_are_refused() -> None:
    plant = parse_plant(FIRST_ORDER.replace(b"(s - id)^2 + exp(s - id)", b"exp(s)"), "test")
    with pytest.raises(InputError, match=r"cannot be evaluated|no minimum"):
        estimated_optimum(plant)


# --- scenarios, ensembles, plots --------------------------------------------------------------------------------------


def test_scenarios_are_drawn_from_the_box(five_agents_box: Plant) -> None:
    law = controller_for(five_agents_box, g=5, K=100, h=500, delta=1000)
    uniform = random_scenario(five_agents_box, law, 7)
    assert uniform == random_scenario(five_agents_box, law, 7) != random_scenario(five_agents_box, law, 8)
    vertices = random_scenario(five_agents_box, law, 7, parameters="vertex", start="vertex")
    for agent, start in zip(five_agents_box.agents, vertices.agents, strict=True):
        assert all(abs(value) == 1 for value in start.z + start.x + start.observer + start.eta)
        assert len(start.eta) == (2 if agent.id <= 2 else 3)
        sides = zip(start.parameters, agent.parameter_box, strict=True)
        assert all(value in (float(side.lo), float(side.hi)) for value, side in sides)
    assert all(abs(value) == 1 for value in vertices.reference)
    assert vertices.v == (0.0, 1.0) and vertices.zeta == (0.0,) * 5


def test_a_measured_observer_starts_at_the_output(five_agents: Plant, controller: Controller) -> None:
    agents = tuple(
        dataclasses.replace(agent, initial=dataclasses.replace(agent.initial, observer=None))
        for agent in five_agents.agents
    )
    scenario = random_scenario(dataclasses.replace(five_agents, agents=agents), controller, 3)
    for start in scenario.agents:
        assert start.observer == (start.x[0], *(0.0,) * (len(start.x) - 1))


def test_scenario_overrides(five_agents: Plant, controller: Controller) -> None:
    scenario = nominal(five_agents, controller).with_parameters({2: {"p1": -1.5}}, five_agents)
    assert scenario.agents[1].parameters == (-1.5, 2.0, 2.0)
    with pytest.raises(InputError, match="agent 2 has no parameter q"):
        scenario.with_parameters({2: {"q": 1.0}}, five_agents)
    with pytest.raises(InputError, match="there is no agent 6"):
        scenario.with_parameters({6: {}}, five_agents)
    with pytest.raises(InputError, match="there is no agent 0"):
        scenario.with_agent(0)
    with pytest.raises(InputError, match="agent 1: x has 3 values and needs 2"):
        scenario.with_agent(1, x=[1, 2, 3])
    with pytest.raises(InputError, match=r"zeta\(0\) has 1 values for 5 agents"):
        scenario.with_zeta([1.0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"horizon": 0}, "the horizon must be positive and finite, not 0"),
        ({"horizon": float("nan")}, "the horizon must be positive and finite, not nan"),
        ({"horizon": 1, "samples": 1}, "at least 2 samples are needed, not 1"),
        ({"horizon": 1, "samples": [0.0, 2.0]}, r"the sample times must increase within \[0, 1\]"),
        ({"horizon": 1, "samples": [0.5, 0.5]}, r"the sample times must increase within \[0, 1\]"),
    ],
)
def test_bad_options_are_refused(
    five_agents: Plant, controller: Controller, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        simulate(five_agents, controller, **options)


def test_a_controller_without_h_is_refused(five_agents: Plant, controller: Controller) -> None:
    laws = tuple(dataclasses.replace(law, h=None) for law in controller.agents)
    with pytest.raises(InputError, match="agent 1 has order 2 and needs an observer gain h"):
        simulate(five_agents, dataclasses.replace(controller, agents=laws), horizon=1)


def test_results_cannot_be_written(run: Trajectory) -> None:
    with pytest.raises(ValueError, match="read-only"):
        run.y[0, 0] = 1.0


def test_ensemble_finds_the_escape_and_repeats_it(five_agents: Plant, controller: Controller) -> None:
    weak = with_gains(controller, g=2, K=10, h=50)
    result = ensemble(five_agents, weak, count=9, seed=0, horizon=10)
    assert result.escapes and not result.failures
    found = result.worst
    assert found.status == "escaped" and found.final_error == float("inf")
    again = simulate(five_agents, weak, horizon=10, scenario=found.scenario(five_agents, weak), samples=2)
    assert (again.status, again.end) == (found.status, pytest.approx(found.end, rel=1e-6))


def test_ensemble_of_good_gains_converges(five_agents: Plant, controller: Controller) -> None:
    result = ensemble(five_agents, controller, count=3, seed=1, horizon=25)
    assert not result.escapes and not result.failures
    assert result.worst.final_error < 1e-3
    with pytest.raises(InputError, match="count >= 1"):
        ensemble(five_agents, controller, count=0)
    with pytest.raises(InputError, match=r"the window must lie in \(0, 5\], not 6"):
        ensemble(five_agents, controller, count=1, horizon=5, window=6)


@pytest.mark.slow
def test_ensemble_does_not_depend_on_the_workers(five_agents: Plant, controller: Controller) -> None:
    alone = ensemble(five_agents, controller, count=4, seed=3, horizon=5)
    assert ensemble(five_agents, controller, count=4, seed=3, horizon=5, workers=2) == alone


def test_plots_label_their_axes(run: Trajectory) -> None:
    import matplotlib.pyplot as plt

    from sims.plots import plot_inputs, plot_outputs, plot_references, plot_tracking_error

    _, axes = plt.subplots(2, 2)
    for draw, ax, label in zip(
        (plot_outputs, plot_references, plot_inputs, plot_tracking_error),
        axes.flat,
        ("output", "reference", "input", "tracking error"),
        strict=True,
    ):
        assert draw(run, ax) is ax
        assert ax.get_xlabel() == "time $t$ [s]"
        assert label in ax.get_ylabel()
        assert len({line.get_color() for line in ax.lines[:5]}) == 5
    assert axes[0, 0].lines[-1].get_linestyle() == "--" and axes[0, 0].lines[-1].get_ydata()[0] == run.optimum
    assert axes[1, 1].get_yscale() == "log"
    assert axes[1, 0].get_ylim()[1] < 200 and "$ = 9" in axes[1, 0].texts[0].get_text()  # the first peak is written
    assert plot_outputs(run).get_title() == ""
    plt.close("all")
