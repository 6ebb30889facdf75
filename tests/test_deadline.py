"""How long runs last follows from the plant and what is proved about it, in whatever unit time is measured."""

from __future__ import annotations

from fractions import Fraction

import pytest
from closed_loops import controller_for

from certify.statement.error_envelope import ErrorEnvelope
from reports.command_line.demonstration import demonstration_controller
from sims.deadline import LAST_WINDOW, SETTLED, Deadline, deadline, nominal_deadlines, settled_run
from sims.fate import longest_period, windows
from symbolic.derivation import derive
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant

MOTORS = """
schema = "consensus-plant/1"
name = "motors"
network = {{ agents = 2, edges = [["1 -> 2", "{per}"], ["2 -> 1", "{per}"]] }}
initial = {{ box = [-1, 1], reference = 0, observer = 0, eta = 0 }}
coordinator = {{ alpha1 = 2, alpha2 = 1, mixing_gain = 1, mixing_time = "1/2/{per}" }}
gains = {{ g = 1, K = 4, delta = 20 }}
[[agent]]
ids = [1, 2]
order = 1
f = "{per}*x1/2"
b = "{per}"
cost = "{per}*(s - id)^2"
internal_model = {{ M = [["-{per}"]], N = ["{per}"] }}
"""


def motors(unit: int) -> Plant:
    """The same motors with time in units of ``unit`` seconds."""
    return parse_plant(MOTORS.format(per=unit).replace("alpha2 = 1", f"alpha2 = {unit}").encode(), "motors.toml")


@pytest.mark.parametrize("unit", [60, 3600])
def test_a_run_lasts_as_long_in_any_unit_of_time(unit: int) -> None:
    seconds, others = motors(1), motors(unit)
    runs = [
        settled_run(plant, demonstration_controller(plant, derive(plant, Fraction(3, 2))))
        for plant in (seconds, others)
    ]
    assert runs[0].t[-1] == pytest.approx(unit * runs[1].t[-1], rel=1e-9)
    for run in runs:
        assert run.status == "completed"
        assert run.final_error(LAST_WINDOW * run.t[-1]) <= float(SETTLED) * 2.5  # the furthest start is 2.5 from s*


def test_an_unstable_loop_is_given_time_and_ends(five_agents: Plant) -> None:
    run = settled_run(five_agents, controller_for(five_agents, g=1, K=1, h=2, delta=5))
    assert run.status == "escaped" or run.final_error(1.0) > float(SETTLED)


def test_the_last_window_begins_when_the_error_is_due(five_agents: Plant) -> None:
    period = longest_period(five_agents)
    assert period == pytest.approx(7.854, abs=1e-3)
    for settled in (1e-3, 1.0, 10.0, 100.0):
        due = deadline(five_agents, settled, Fraction(1, 7))
        assert due.tolerance == Fraction(1, 7)
        last = windows(five_agents, due.horizon).times[-160:]
        assert last[0] >= settled and last[-1] == due.horizon
        assert due.horizon <= 1.25 * settled + 1.01 * period


def test_what_is_due_is_what_the_envelope_promises() -> None:
    """The bound a thousandth of its peak: from the grid, and beyond it by its decay."""
    times, values = tuple(map(Fraction, (0, 1, 2))), tuple(map(Fraction, (4, 2, 1)))
    envelope = ErrorEnvelope(times, values, Fraction(1, 2))
    tolerance = SETTLED * envelope.peak
    settled = float(envelope.settled(tolerance))
    assert 2 + 2 * 5.52 < settled < 2 + 2 * 5.53  # e^(-t/2) falls from 1 to 0.004


def test_deadlines_of_a_controller_without_bounds(five_agents: Plant) -> None:
    due = nominal_deadlines(five_agents, controller_for(five_agents, g=5, K=100, h=500, delta=1000))
    assert list(due) == [1, 2, 3, 4, 5] and len(set(due.values())) == 1
    assert due[1].horizon > longest_period(five_agents)
    assert due[1] == Deadline(due[1].horizon, Fraction(3, 1000))  # outputs and references start at most 3 from s* = 2
