"""The batch integrator: its order, its agreement with LSODA across kinks, the same bits, and what stands on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import sympy
from closed_loops import at_the_centre, controller_for, with_gains

from sims import rodas5p
from sims.agent_loop import AgentLoop, agent_loop, upper_layer
from sims.batch import ABANDONED, COMPLETED, ESCAPED, BatchOptions, BatchSolution
from sims.critical_gains import critical_h, critical_K
from sims.cross_check import cross_check
from sims.deadline import Deadline
from sims.sampled_controller import SampledController, run_sampled
from sims.search_space import AgentPoint, SharedPoint, agent_box, agent_point, shared_points
from sims.stage_code import numpy_functions, stage_sources
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Plant
from symbolic.plant_file import load_plant


@pytest.fixture(scope="module")
def good(five_agents: Plant) -> Controller:
    return controller_for(five_agents, g=5, K=100, h=500, delta=1000)


def points(loop: AgentLoop, count: int, seed: int = 0) -> list[AgentPoint]:
    box = agent_box(loop.agent, loop.law)
    cubes = np.random.default_rng(seed).random((count, len(box.free)))
    return [agent_point(loop.agent, loop.law, box.point(cube)) for cube in cubes]


def run(loop: AgentLoop, chosen: list[AgentPoint], horizon: float, options: BatchOptions) -> BatchSolution:
    shared = shared_points(loop.plant, np.random.default_rng(0), 1, 0)
    layer = upper_layer(loop.plant, loop.controller, shared[0], horizon)
    times = np.linspace(0, horizon, 101)
    return loop.run(loop.signals([layer]), [0] * len(chosen), chosen, horizon, times, options)


# --- the method -------------------------------------------------------------------------------------------------------


def step(y: float, t: float, h: float, f: Callable[[float, float], float], fy: float, ft: float) -> tuple[float, float]:
    """One step of the tableau on a scalar equation: the new value and the dense output in the middle."""
    k = np.zeros(8)
    at = y
    for i in range(8):
        at = y + rodas5p.A[i, :i] @ k[:i]
        right = f(t + rodas5p.NODES[i] * h, at) + rodas5p.C[i, :i] @ k[:i] / h + h * rodas5p.D[i] * ft
        k[i] = right / (1 / (rodas5p.GAMMA * h) - fy)
    new = at + k[7]
    dense = rodas5p.H @ k
    return new, 0.5 * y + 0.5 * (new + 0.5 * (dense[0] + 0.5 * (dense[1] + 0.5 * dense[2])))


def test_order_of_the_method_and_of_its_dense_output() -> None:
    """A scalar equation against a tight reference: errors fall like ``h⁵`` at the steps, ``h⁴`` or better between."""
    from scipy.integrate import solve_ivp

    def f(t: float, y: float) -> float:
        return -y * y + float(np.cos(t))

    tight = {"rtol": 1e-13, "atol": 1e-14, "method": "DOP853", "dense_output": True}
    exact = solve_ivp(lambda t, y: [f(t, y[0])], (0, 2), [1.0], **tight)
    ends, middles = [], []
    for steps in (8, 16, 32):
        h, y, worst = 2 / steps, 1.0, 0.0
        for j in range(steps):
            t = j * h
            y, middle = step(y, t, h, f, -2 * y, -float(np.sin(t)))
            worst = max(worst, abs(middle - exact.sol(t + h / 2)[0]))
        ends.append(abs(y - exact.sol(2.0)[0]))
        middles.append(worst)
    orders = np.log2(np.array(ends[:-1]) / ends[1:])
    assert 4.4 < orders[0] < orders[1] and orders[1] > 4.7, ends
    assert np.log2(np.array(middles[:-1]) / middles[1:]).min() > 3.8, middles


def test_the_method_is_l_stable() -> None:
    """``y' = −λ y`` with ``hλ = 1e8`` is damped to nothing in one step."""
    new, _ = step(1.0, 0.0, 1.0, lambda t, y: -1e8 * y, -1e8, 0.0)
    assert abs(new) < 1e-6


@pytest.mark.parametrize("number", [1, 3])
def test_elimination_solves_the_linear_system(five_agents: Plant, good: Controller, number: int) -> None:
    loop = agent_loop(five_agents, good, number)
    code, sources = numpy_functions(loop.sources), loop.sources
    generator = np.random.default_rng(number)
    q, u = generator.standard_normal((sources.states, 4)), generator.standard_normal((sources.inputs, 4))
    p = np.vstack([generator.standard_normal((sources.parameters - 2, 4)), np.ones(4), np.zeros(4)])
    lu, x = np.empty((sources.entries, 4)), generator.standard_normal((sources.states, 4))
    right = x.copy()
    code["factor"](q, u, p, 1e3, lu)
    code["solve"](lu, x)
    for j in range(4):
        jacobian = np.empty((sources.states, sources.states))
        for k in range(sources.states):
            ahead, behind = q[:, [j]].copy(), q[:, [j]].copy()
            ahead[k] += 1e-5
            behind[k] -= 1e-5
            one, two = np.empty_like(ahead), np.empty_like(ahead)
            code["rhs"](ahead, u[:, [j]], p[:, [j]], one)
            code["rhs"](behind, u[:, [j]], p[:, [j]], two)
            jacobian[:, k] = ((one - two) / 2e-5)[:, 0]
        left = (1e3 * np.eye(sources.states) - jacobian) @ x[:, j]
        assert left == pytest.approx(right[:, j], rel=1e-4, abs=1e-4 * np.abs(jacobian).max() * np.abs(x[:, j]).max())


# --- trajectories -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [1, 3])
def test_batch_agrees_with_lsoda_across_the_kink(five_agents: Plant, good: Controller, number: int) -> None:
    loop = agent_loop(five_agents, good, number)
    chosen = points(loop, 3)
    found = run(loop, chosen, 10.0, BatchOptions())
    assert (found.status == COMPLETED).all() and (found.saturated > 0).all()
    shared = SharedPoint((Fraction(0), Fraction(1)), (Fraction(0),) * 5)
    layer = upper_layer(five_agents, good, shared, 10.0, 1e-11, 1e-13)
    for k, point in enumerate(chosen):
        exact = loop.reference_run(layer, point, np.linspace(0, 10, 101), 1e-10, 1e-12)
        rows = loop.plant_states
        assert np.abs(exact.states[:rows] - found.samples[k, :rows]).max() < 1e-4
        assert found.last_saturated[k] == pytest.approx(exact.last_saturated, abs=2e-3)


def test_the_same_call_gives_the_same_bits(five_agents: Plant, good: Controller) -> None:
    loop = agent_loop(five_agents, good, 1)
    one, two = (run(loop, points(loop, 5), 5.0, BatchOptions()) for _ in range(2))
    assert (one.samples == two.samples).all() and (one.steps == two.steps).all()


def test_an_escape_can_end_the_batch(five_agents: Plant, good: Controller) -> None:
    weak = with_gains(good, g=3, K=30, h=100)
    loop = agent_loop(five_agents, weak, 1)
    corner = agent_point(loop.agent, loop.law, agent_box(loop.agent, loop.law).point((1, 1, 1, 1, 1, 1)))
    centre = points(at := agent_loop(at_the_centre(five_agents), weak, 1), 1)[0]
    assert at.agent.id == 1
    found = run(loop, [corner, centre], 20.0, BatchOptions())
    assert found.status.tolist() == [ESCAPED, COMPLETED] and 3.0 < found.end[0] < 3.2
    assert np.isnan(found.samples[0, :, -1]).all() and np.isfinite(found.samples[1]).all()
    ended = run(loop, [corner, centre], 20.0, BatchOptions(stop_at_escape=True))
    assert ended.status.tolist() == [ESCAPED, ABANDONED] and ended.end[1] < 20


def test_compiled_agrees_with_numpy_and_not_with_its_neighbours(five_agents: Plant, good: Controller) -> None:
    pytest.importorskip("numba", reason="the extra fast is not installed")
    loop = agent_loop(five_agents, good, 1)
    chosen = points(loop, 6)
    plain, fast = (run(loop, chosen, 10.0, BatchOptions(compiled=compiled)) for compiled in (False, True))
    assert (fast.status == COMPLETED).all() and fast.steps.tolist() == pytest.approx(plain.steps.tolist(), abs=3)
    assert np.abs(plain.samples - fast.samples).max() < 1e-5
    alone = run(loop, chosen[3:4], 10.0, BatchOptions(compiled=True))
    assert (alone.samples[0] == fast.samples[3]).all()


def test_lanes_are_filled_again_and_do_not_mix(five_agents: Plant, good: Controller) -> None:
    """More trajectories than lanes, some of which escape early: each as NumPy has it, and as it is alone."""
    pytest.importorskip("numba", reason="the extra fast is not installed")
    loop = agent_loop(five_agents, with_gains(good, g=3, K=30, h=100), 1)
    corner = agent_point(loop.agent, loop.law, agent_box(loop.agent, loop.law).point((1, 1, 1, 1, 1, 1)))
    chosen = [corner if k % 5 == 0 else point for k, point in enumerate(points(loop, 150))]
    plain, fast = (run(loop, chosen, 5.0, BatchOptions(compiled=compiled)) for compiled in (False, True))
    assert (fast.status == plain.status).all() and set(fast.status) == {COMPLETED, ESCAPED}
    assert fast.end == pytest.approx(plain.end, rel=1e-3)
    assert fast.saturated == pytest.approx(plain.saturated, abs=1e-5)
    assert fast.last_saturated == pytest.approx(plain.last_saturated, abs=1e-5)
    done = fast.status == COMPLETED
    assert fast.peak[done] == pytest.approx(plain.peak[done], rel=1e-5) and (fast.peak[~done] > 1e9).all()
    assert np.abs(plain.samples[done] - fast.samples[done]).max() < 1e-4
    assert (np.isnan(plain.samples) == np.isnan(fast.samples)).all()
    few = run(loop, chosen[131:134], 5.0, BatchOptions(compiled=True))
    assert (few.samples == fast.samples[131:134]).all()


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("delta", [10, 1000])
def test_the_unsaturated_zone_is_not_stepped_over(examples: Path, delta: int, compiled: bool) -> None:
    """From ``e_1(0) = −4.3e13`` the argument passes the zone in a tiny part of a step."""
    if compiled:
        pytest.importorskip("numba", reason="the extra fast is not installed")
    plant = load_plant(examples / "fourth_order.toml")
    loop = agent_loop(plant, controller_for(plant, g=1, K=60, h=60_000, delta=delta), 1)
    box = agent_box(loop.agent, loop.law)
    corner = agent_point(loop.agent, loop.law, box.point((0.0,) * len(box.free)))
    assert loop.start(corner)[loop.plant_states] == pytest.approx(-4.3e13, rel=0.01)
    found = run(loop, [corner], 2.0, BatchOptions(compiled=compiled))
    shared = shared_points(plant, np.random.default_rng(0), 1, 0)
    layer = upper_layer(plant, loop.controller, shared[0], 2.0)
    exact = loop.reference_run(layer, corner, np.linspace(0, 2, 101), 1e-9, 1e-11)
    rows = loop.plant_states
    assert np.abs(exact.states[:rows] - found.samples[0, :rows]).max() < 1e-5
    assert found.saturated[0] == pytest.approx(exact.saturated_time, rel=1e-3)


def test_feedback_without_saturation_is_not_compiled(five_agents: Plant, good: Controller) -> None:
    equations = agent_loop(five_agents, good, 1).equations
    with pytest.raises(ValueError, match="unpack"):
        stage_sources(replace(equations, u=sympy.Integer(0)))


# --- what stands on it ------------------------------------------------------------------------------------------------


def test_cross_check_counts_and_finds(five_agents: Plant, good: Controller) -> None:
    plant = five_agents
    passed = cross_check(plant, good, count=6)
    assert (passed.count, passed.failed, passed.broken) == (30, 0, None)
    assert 0.9 < passed.worst_margin < 1 and "30 trajectories" in passed.reason
    assert cross_check(plant, good, count=6, workers=2) == passed
    broken = cross_check(plant, with_gains(good, g=2, K=10, h=50), count=60)
    assert broken.broken is not None and broken.worst_margin < 0
    with pytest.raises(InputError, match="a cross-check needs count >= 1"):
        cross_check(plant, good, count=0)


def test_a_time_limit_leaves_the_first_part_of_every_agent(
    five_agents: Plant, good: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sims.cross_check._FIRST", 2)
    shares: list[float] = []
    hurried = cross_check(five_agents, good, count=100, time_limit=1e-9, horizon=5, share=shares.append)
    assert [tried.trajectories for tried in hurried.tried] == [2] * 5
    assert (hurried.count, hurried.asked) == (10, 100)
    assert shares == sorted(shares) and shares[-1] == 1.0


def test_every_agent_has_its_own_deadline(five_agents: Plant, good: Controller) -> None:
    """The same points: what is due is what each agent is judged by, at an end of its own."""
    strict = {2: Deadline(20.0, Fraction(1, 10**15)), 3: Deadline(12.0, Fraction(1))}
    found = cross_check(five_agents, good, count=2, deadlines=strict)
    slow = {tried.agent: tried.slow for tried in found.tried}
    assert slow[2] > 0 and slow[3] == 0
    early = {tried.agent: tried.worst for tried in found.tried}
    late = {tried.agent: tried.worst for tried in cross_check(five_agents, good, count=2).tried}
    assert early[3] > late[3] and early[1] == late[1]


@pytest.mark.slow
def test_critical_gains_bracket(five_agents: Plant, good: Controller) -> None:
    base = with_gains(good, g=2, K=40, h=150)
    wide, options = Fraction(1, 4), {"budget": 64, "compiled": find_spec("numba") is not None}
    found = critical_K(five_agents, base, 1, Fraction(10), Fraction(100), accuracy=wide, **options)
    assert found.falsified is not None and found.surviving is not None and found.witness is not None
    assert 25 < found.falsified < found.surviving <= found.falsified * (1 + wide) and found.surviving < 60
    observer = critical_h(five_agents, base, 1, Fraction(20), Fraction(200), accuracy=wide, **options)
    assert observer.falsified is not None and 90 < observer.falsified < 150


def test_critical_gains_refuse_an_empty_range(five_agents: Plant, good: Controller) -> None:
    with pytest.raises(InputError, match="needs 0 < low < high"):
        critical_K(five_agents, good, 1, Fraction(10), Fraction(5))
    survives = critical_K(at_the_centre(five_agents), good, 1, Fraction(100), Fraction(200), budget=1)
    assert survives.falsified is None and survives.surviving == 100 and survives.witness is None


def test_sampled_controller_tends_to_the_continuous_one(five_agents: Plant, good: Controller) -> None:
    loop = agent_loop(five_agents, good, 1)
    start = points(loop, 1)[0]
    shared = SharedPoint((Fraction(0), Fraction(1)), (Fraction(0),) * 5)
    layer = upper_layer(five_agents, good, shared, 2.0)
    errors = []
    for rate in (1000, 4000):
        sampled = run_sampled(five_agents, good, 1, start, shared, rate=rate, horizon=2)
        exact = loop.reference_run(layer, start, sampled.t, 1e-9, 1e-11).states[loop.output_row] - loop.optimum
        errors.append(np.abs(sampled.error - exact).max())
    assert errors[1] < 0.5 * errors[0] < 0.05
    slow = run_sampled(five_agents, good, 1, start, shared, rate=40, horizon=2)
    assert slow.final_error(0.5) > 0.1


def test_sampled_controller_refuses(good: Controller) -> None:
    with pytest.raises(InputError, match="the sampling period must be positive"):
        SampledController(good.agents[0], 0.0)
    with pytest.raises(InputError, match="another length"):
        SampledController(good.agents[0], 0.1, eta=np.zeros(5))
