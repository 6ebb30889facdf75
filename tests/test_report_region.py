"""The certified region: its bounds hold, agree however they are computed, and are stated only where verified."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from mixed_orders import MIXED, Certified, certified_mixed_orders

from certify.certificate import Json
from certify.results import Alternative
from certify.statement.bandwidth import observer_bandwidth
from certify.statement.bounds import ProvedBounds, proved_bounds
from certify.statement.claim import certified_gains
from certify.statement.error_envelope import ErrorEnvelope
from certify.statement.input_bound import InputBound, input_bound
from certify.statement.numbers import rounded
from certify.statement.recomputed import coordinator_envelope
from certify.statement.tube import Reaching, Tube
from reports.command_line import certified_steps
from reports.command_line.steps import Steps
from reports.cross_checked import ending, search_fields, sentence
from reports.details import details
from reports.document import build_report
from reports.region_sections import closest
from reports.sections import document_data
from reports.study import conclusion
from sims.certified_bounds import signal_bounds
from sims.closed_loop import Trajectory, simulate
from sims.cross_check import CrossCheck
from sims.deadline import certified_deadlines
from sims.falsifier import Tried
from sims.scenario import random_scenario
from symbolic.controller import Controller
from symbolic.plant import Interval, Plant

HORIZON = 12.0


@pytest.fixture(scope="module")
def certified() -> Certified:
    return certified_mixed_orders()


@pytest.fixture(scope="module")
def runs(certified: Certified) -> tuple[Trajectory, ...]:
    """From vertices and inner points, sampled where the observer peaks too."""
    times = np.union1d(np.linspace(0.0, HORIZON, 400), np.geomspace(1e-7, 0.1, 200))
    plant, controller = certified.plant, certified.controller
    starts = [random_scenario(plant, controller, (7, k), parameters="vertex", start="vertex") for k in range(4)]
    starts += [random_scenario(plant, controller, (8, k), parameters="vertex") for k in range(2)]
    return tuple(simulate(plant, controller, horizon=HORIZON, samples=times, scenario=start) for start in starts)


# --- the bounds -------------------------------------------------------------------------------------------------------


def test_no_run_leaves_the_region(certified: Certified, runs: tuple[Trajectory, ...]) -> None:
    for run in runs:
        assert run.status == "completed"
        for agent, bounds in zip(run.agents, certified.bounds.agents, strict=True):
            assert np.all(run.error[bounds.id - 1] <= bounds.error.at(run.t) + 1e-6)
            for values, bound in zip((*agent.z, *agent.x), bounds.states, strict=True):
                assert float(bound.whole.lo) - 1e-6 <= values.min()
                assert values.max() <= float(bound.whole.hi) + 1e-6
            assert np.abs(agent.u).max() <= float(bounds.input.peak)
            late = run.t >= float(bounds.reaching)
            assert np.abs(agent.u[late]).max() <= float(bounds.input.after)
    assert 0.01 < closest(certified.bounds, runs) <= 1.0


def test_bounds_that_are_too_small_are_left(certified: Certified, runs: tuple[Trajectory, ...]) -> None:
    """The other way round: the test above can fail."""
    shrunk = tuple(
        replace(agent, error=replace(agent.error, values=tuple(value / 10 for value in agent.error.values)))
        for agent in certified.bounds.agents
    )
    assert closest(ProvedBounds(shrunk), runs) > 1.0


def test_the_boxes_of_the_tube_alone_are_left_before_it_begins(
    certified: Certified, runs: tuple[Trajectory, ...]
) -> None:
    """Why phase 1 counts: ``|x_1 − y^r|`` starts above what the tube says."""
    tube = certified.view.agents[0].tube
    assert tube is not None and tube.grid[0] > 0
    apart = max(np.abs(run.agents[0].x[0] - run.reference[0]).max() for run in runs)
    assert float(tube.peak(0)) < apart <= float(tube.furthest(0))
    assert certified.bounds.agents[0].states[0].distance == tube.furthest(0)


def test_the_search_bounds_the_plant_states_for_all_time_too(certified: Certified) -> None:
    for result, bounds in zip(certified.gains.agents, certified.bounds.agents, strict=True):
        assert set(result.bounds) == {*(str(state.state) for state in bounds.states), "vartheta", "input"}
        for state in bounds.states:
            assert state.distance <= result.bounds[str(state.state)]
        assert bounds.input.tracking <= result.bounds["input"]


def test_a_range_of_the_zero_state_itself_is_used_where_it_is_known(certified: Certified) -> None:
    zero, tube = certified.bounds.agents[1].states[0], certified.view.agents[1].tube
    assert tube is not None and tube.ranges
    unknown = replace(certified.view.agents[1], tube=replace(tube, ranges=()))
    assert certified.gains.envelope is not None
    view = replace(certified.view, agents=(certified.view.agents[0], unknown))
    wider = proved_bounds(certified.plant, certified.derivation, view, certified.gains.envelope)
    assert isinstance(wider, ProvedBounds)
    without = wider.agents[1].states[0]
    assert without.distance == tube.furthest(0) > zero.distance
    assert without.whole.lo < zero.whole.lo <= zero.whole.hi <= without.whole.hi


def test_the_input_before_and_after_the_saturation_by_hand(certified: Certified) -> None:
    """``b ∈ [1/2, 2]``, ``Ψ = (1, −2)``, ``N = (3, 4)``: ``|Ψ| (1, 1) + |3 − 8| x̂/b_min = 3 + 20`` with ``x̂ = 2``."""
    one = list(map(Fraction, (1, 1, 1)))
    reaching = Reaching((Fraction(0), Fraction(1)), (tuple(map(Fraction, (2, 9, 1, 1))),))
    boxes = ((Fraction(1), Fraction(1), Fraction(7)),)
    tube = Tube(reaching, (Fraction(1),), (Fraction(1), Fraction(2)), boxes, (), tuple(one), Fraction(1, 2))
    q, v = sympy.Symbol("q"), sympy.Symbol("v")
    box = {q: Interval(Fraction(1, 2), Fraction(2)), v: Interval(Fraction(-3), Fraction(1))}
    agent = replace(certified.plant.agents[0], b=q)
    claim = replace(
        certified.view.agents[0], delta=Fraction(5), psi=(Fraction(1), Fraction(-2)), N=(Fraction(3), Fraction(4))
    )
    assert input_bound(agent, claim, tube, v, box) == InputBound(Fraction(5), Fraction(23), Fraction(3), Fraction(7))
    found = InputBound(Fraction(5), Fraction(23), Fraction(3), Fraction(7))
    assert (found.peak, found.after) == (31, 10)
    assert replace(found, tracking=Fraction(99)).peak == 102
    never = replace(tube, reaching=Reaching((Fraction(0),), ()), grid=(Fraction(0), Fraction(2)))
    unsaturated = input_bound(agent, claim, never, v, box)
    assert isinstance(unsaturated, InputBound)
    assert (unsaturated.internal, unsaturated.peak) == (None, 10)
    assert isinstance(input_bound(replace(agent, b=q - 1), claim, tube, v, box), str)


def test_the_region_from_the_two_files_is_that_of_the_search(certified: Certified) -> None:
    again = coordinator_envelope(certified.plant, certified.view)
    assert not isinstance(again, str)
    assert proved_bounds(certified.plant, certified.derivation, certified.view, again) == certified.bounds


def test_a_state_is_named_with_what_it_approaches(certified: Certified) -> None:
    targets = [[(str(s.state), s.target) for s in agent.states] for agent in certified.bounds.agents]
    assert targets == [[("x1", "reference")], [("z1", "steady state"), ("x1", "reference"), ("x2", "origin")]]


def test_the_region_is_a_claim_that_a_search_can_try_to_break(certified: Certified) -> None:
    bounds = signal_bounds(certified.bounds)
    assert [(bound.agent, bound.signal) for bound in bounds] == [
        (1, "error"), (1, "x1"), (2, "error"), (2, "z1"), (2, "x1"), (2, "x2"),
    ]  # fmt: skip
    assert all(bound.times[0] == 0 for bound in bounds)


# --- the settling envelope --------------------------------------------------------------------------------------------

ENVELOPE = ErrorEnvelope(
    (Fraction(0), Fraction(1), Fraction(2)), (Fraction(4), Fraction(5), Fraction(1)), Fraction(1, 2)
)


def test_settling_is_after_the_last_step_above_the_level() -> None:
    assert ENVELOPE.settled(Fraction(5)) == 0
    assert ENVELOPE.settled(Fraction(9, 2)) == 2
    assert ENVELOPE.settled(Fraction(1)) == 2
    late = ENVELOPE.settled(Fraction(1, 100))
    assert math.exp(-0.5 * float(late - 2)) <= 0.01 * (1 + 1e-12)
    assert float(late) == pytest.approx(2 + 2 * math.log(100))


def test_the_envelope_takes_the_larger_side_of_a_border() -> None:
    assert ENVELOPE.at(np.array([0.0, 0.5, 1.0, 1.5, 2.0, 4.0])) == pytest.approx([4, 4, 5, 5, 5, math.exp(-1)])


# --- estimates --------------------------------------------------------------------------------------------------------


@given(st.fractions(Fraction(1, 10), 10**6), st.integers(1, 4))
def test_a_multiple_observer_pole_is_one_pole(h: Fraction, order: int) -> None:
    """``(s + 2)^n``."""
    observer = [Fraction(math.comb(order, k) * 2 ** (order - k)) for k in range(order)]
    found = observer_bandwidth(observer, h)
    ((pole, count),) = found.poles
    assert count == order
    assert pole == pytest.approx(-2 * float(h), rel=1e-3)
    assert found.hertz == pytest.approx(2 * float(h) / (2 * math.pi), rel=1e-3)


def test_complex_observer_poles_and_the_sampling_rate() -> None:
    found = observer_bandwidth([Fraction(25), Fraction(6)], Fraction(100))  # -3 ± 4i
    assert sorted((round(p.real), round(p.imag)) for p, _ in found.poles) == [(-300, -400), (-300, 400)]
    assert found.fastest == pytest.approx(500)
    assert list(found.sampling) == pytest.approx([5000 / (2 * math.pi), 10000 / (2 * math.pi)])


@given(st.fractions(Fraction(1, 1000), 10**9))
def test_rounded_bounds_stay_bounds(value: Fraction) -> None:
    assert Fraction(rounded(value, 3, "down")) <= value <= Fraction(rounded(value, 3, "up"))


# --- the report -------------------------------------------------------------------------------------------------------


def test_the_report_states_the_region_of_a_verified_certificate(
    certified: Certified, runs: tuple[Trajectory, ...]
) -> None:
    study = replace(certified.study, trajectory=runs[0], runs=runs[1:], simulated=certified.controller)
    data = document_data(study)
    assert (data["status"], data["verified"], data["route"]["text"]) == ("certified", True, "direct")
    assert data["region"]["runs"] == len(runs)
    assert [row[0]["text"] for row in data["region"]["observers"]] == ["2"]
    assert data["numbers"]["thresholds"] == []
    assert data["simulation"]["lead"] == "The certified gains."
    assert build_report(study).startswith(b"%PDF-")


def test_nothing_is_stated_of_a_certificate_that_is_not_verified(certified: Certified) -> None:
    for answer in (None, {"status": "rejected", "claim_sha256": "", "reason": "no"}):
        data = document_data(replace(certified.study, verification=answer))
        assert data["region"] is None
        assert "region" not in details(replace(certified.study, verification=answer))


def test_bounds_are_not_compared_with_runs_of_other_gains(certified: Certified, runs: tuple[Trajectory, ...]) -> None:
    constants = replace(certified.controller.coordinator, alpha1=Fraction(7))
    other = replace(certified.controller, coordinator=constants)
    study = replace(certified.study, trajectory=runs[0], simulated=other)
    assert document_data(study)["region"]["runs"] == 0
    assert build_report(study).startswith(b"%PDF-")


def test_other_gains_that_passed_are_named_with_their_reason(certified: Certified) -> None:
    g, K, delta, h = map(Fraction, (1, 50, 700, 9000))
    law = replace(certified.controller.agents[1], g=g, K=K, delta=delta, h=h, observer=(Fraction(1), Fraction(3, 2)))
    other = Alternative("least K", "the least feedback gain that passed", law)
    agents = (certified.gains.agents[0], replace(certified.gains.agents[1], alternatives=(other,)))
    study = replace(certified.study, gains=replace(certified.gains, agents=agents))
    rows = document_data(study)["region"]["alternatives"]
    assert [row[1]["text"] for row in rows] == ["default", "default", "least K"]
    shown = rows[2][6]["text"].replace("\u200b", "")
    assert shown.startswith(other.reason) and 'observer = [1, "3/2"]' in shown
    (found,) = details(study)["agents"][1]["alternatives"]
    assert {key: found[key] for key in ("label", "reason", "g", "K", "delta", "h", "observer")} == {
        "label": "least K",
        "reason": other.reason,
        "g": "1",
        "K": "50",
        "delta": "700",
        "h": "9000",
        "observer": ["1", "3/2"],
    }
    assert [list(map(Fraction, row)) for row in found["M"]] == [list(row) for row in law.M]


def test_details_are_json_with_exact_numbers_as_text(certified: Certified) -> None:
    found = json.loads(json.dumps(details(certified.study)))
    state = found["region"][1]["states"]["x2"]
    assert Fraction(state["range"][1]) == certified.bounds.agents[1].states[2].whole.hi
    assert found["estimates"][0] == {"id": 1, "observer": None}
    assert found["estimates"][1]["observer"]["fastest_rad_per_s"] == pytest.approx(6000, rel=1e-2)


def damages(certificate: Json) -> Iterator[Json]:
    for key, value in (
        ("grid", ["0"]), ("grid", ["1", "0"]), ("boxes", []), ("boxes", [["1"]]), ("rates", []), ("tail", None),
        ("tail", {"box": [], "rate": "1"}), ("boxes", 3),
        ("phase1", {"grid": [], "boxes": []}), ("phase1", {"grid": ["0", "1e9"], "boxes": [["1"]]}), ("phase1", None),
        ("ranges", [[]]), ("ranges", [[["1", "0"]]]), ("ell", ["1"]), ("steady_state", []),
    ):  # fmt: skip
        changed = deepcopy(certificate)
        changed["witness"]["agents"][1][key] = value
        yield changed


def test_a_damaged_tube_is_not_shown(certified: Certified) -> None:
    for damaged in damages(certified.certificate):
        assert certified_gains(damaged) is None
        assert document_data(replace(certified.study, certificate=damaged))["region"] is None


# --- the search for a counterexample ----------------------------------------------------------------------------------


def checked(count: int, failed: int, broken: Any = None) -> CrossCheck:
    tried = (Tried(1, count, failed, 0, 0.0, 1.0),)
    return CrossCheck(count, failed, 0.5 if count else math.nan, broken, tried, 10, "said")


def test_how_a_search_ends() -> None:
    assert ending(checked(10, 0)) == "survived"
    assert ending(checked(10, 5)) == ending(checked(0, 0)) == "inconclusive"
    assert ending(checked(10, 0, object())) == "refuted"
    none = "10 trajectories (10 of each agent), none breaks the claim, worst margin 0.5"
    assert sentence(checked(10, 0), 1) == none
    assert sentence(checked(10, 1), 1) == f"{none}; 1 could not be integrated in floats"
    assert sentence(checked(10, 0), 4) == f"{none}; the time limit left out the rest of 40"
    uneven = replace(checked(10, 0), count=13, tried=(Tried(1, 10, 0, 0, 0.0, 1.0), Tried(2, 3, 0, 0, 0.0, 1.0)))
    assert sentence(uneven, 2).startswith("13 trajectories (3 to 10 of each agent), none")
    assert search_fields(uneven, 2)["agents"] == [{"id": 1, "trajectories": 10}, {"id": 2, "trajectories": 3}]
    assert search_fields(None, 1)["status"] == "left out"
    assert (search_fields(uneven, 2)["asked"], search_fields(uneven, 2)["limited"]) == (10, True)
    assert search_fields(checked(0, 0), 1)["margin"] is None


def test_a_trajectory_that_breaks_the_claim_outweighs_the_checker(certified: Certified) -> None:
    study = replace(certified.study, search=checked(10, 0, object()))
    ended = conclusion(study)
    assert (ended.status, ended.verified) == ("refuted", False)
    assert "BREAKS THE CLAIM" in ended.reason
    assert document_data(study)["region"] is None
    assert build_report(study).startswith(b"%PDF-")


def test_the_search_tries_the_certified_gains_against_the_region(
    certified: Certified, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen: dict[str, Any] = {}

    def searched(plant: Plant, controller: Controller, **options: Any) -> CrossCheck:
        seen.update(options, controller=controller)
        return checked(10, 0)

    monkeypatch.setattr(certified_steps, "cross_check", searched)
    study = certified_steps.with_search(certified.study, Steps())
    assert study.search == checked(10, 0)
    assert seen["controller"] == certified.controller
    assert seen["bounds"] == signal_bounds(certified.bounds)
    assert seen["deadlines"] == certified_deadlines(certified.study.plant, certified.bounds)
    assert (seen["count"], seen["time_limit"]) == (5000, math.inf)  # 10 000 of two agents, however long they take
    assert certified_steps.with_search(replace(certified.study, verification=None), Steps()).search is None
    assert "left out: there is no verified certificate" in capsys.readouterr().err


def test_progress_away_from_a_terminal_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = [0.0]
    monkeypatch.setattr("reports.command_line.steps.time", SimpleNamespace(monotonic=lambda: clock[0]))
    with Steps().step("gains") as report:
        for text, now in (("one", 1.0), ("two", 6.0), ("three", 10.0)):
            clock[0] = now
            report.progress(text)
        report("certified")
    captured = capsys.readouterr()
    assert captured.out == ""
    assert [line.split()[-1] for line in captured.err.splitlines()] == ["two", "certified"]


@pytest.mark.slow
def test_report_from_the_two_files_alone(certified: Certified, tmp_path: Path) -> None:
    from certify.certificate import write_certificate
    from reports.command_line import main

    (tmp_path / "mixed.toml").write_text(MIXED)
    write_certificate(certified.certificate, tmp_path / "c.json")
    files = [str(tmp_path / name) for name in ("mixed.toml", "c.json", "r.pdf")]
    assert main(["report", files[0], files[1], "-o", files[2]]) == 0
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF-")
