"""Scenarios, ensembles of runs and their plots."""

from __future__ import annotations

import dataclasses
from typing import Any

import matplotlib
import pytest
from closed_loops import controller_for, with_gains

from sims import Trajectory, nominal, random_scenario, simulate
from sims.ensemble import ensemble
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Plant

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def controller(five_agents: Plant) -> Controller:
    return controller_for(five_agents, g=5, K=100, h=500, delta=1000)


@pytest.fixture(scope="module")
def run(five_agents: Plant, controller: Controller) -> Trajectory:
    """A start that saturates every agent's input at first."""
    scenario = random_scenario(five_agents, controller, 2)
    return simulate(five_agents, controller, horizon=40, scenario=scenario)


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
