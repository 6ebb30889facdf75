"""The whole check: the paper's example holds, and each broken assumption is found where it is broken."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from counted import at_most

from certify.assumptions import CheckReport, Finding, check_assumptions
from certify.assumptions.findings import Verdict
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant

BASE = """
schema = "consensus-plant/1"
name = "pair"
[network]
agents = 2
edges = ["1 -> 2", "2 -> 1"]
[exosystem]
states = ["v1", "v2"]
S = [[0, 1], [-1, 0]]
initial = { v1 = 0, v2 = 1 }
[initial]
box = [-1, 1]
reference = 0
[[agent]]
ids = [1, 2]
zero_dynamics = { z1 = "-p1*z1 + x1 + v1" }
order = 2
f = "z1*x2 + v2"
b = "1 + p1^2"
cost = "(s - id)^2/2 + log(1 + exp(s))"
uncertain = { p1 = ["1/2", 2] }
"""


def plant(old: str = "", new: str = "") -> Plant:
    assert not old or BASE.count(old) == 1
    return parse_plant(BASE.replace(old, new).encode(), "p.toml")


def test_the_example_holds_and_is_fast(five_agents: Plant) -> None:
    with at_most(2_500_000):
        report = check_assumptions(five_agents)
    assert report.status == "holds"
    assert [finding.id for finding in report.findings] == sorted(finding.id for finding in report.findings)
    assert len(report.findings) == 5 * 5 + 2
    assert report.of("A2").evidence["r"] == ["2/11", "4/11", "3/11", "1/11", "1/11"]
    assert "- s/p1" in report.of("A3", 1).evidence["z_star"]["z1"]  # F19: the paper prints another term
    assert [report.of("A5", k).evidence["order"] for k in range(1, 6)] == [2, 2, 3, 3, 3]
    assert [report.of("A6", k).evidence["a0"] for k in (1, 2)] == ["1/2", "3/2"]
    assert any("origin" in text for text in report.of("A0", 1).evidence["warnings"])  # F18


def test_the_other_examples_hold(examples: Path) -> None:
    from symbolic.plant_file import load_plant

    for path in sorted(examples.glob("five_agents*.toml")):
        assert check_assumptions(load_plant(path)).status == "holds"


def test_reports_are_json(five_agents: Plant) -> None:
    answer = check_assumptions(five_agents).as_json()
    assert json.loads(json.dumps(answer)) == answer
    assert set(answer) == {"status", "assumptions"}
    assert all(set(entry) == {"id", "agent", "verdict", "reason", "evidence"} for entry in answer["assumptions"])


def test_a_pair_with_transcendental_costs_holds() -> None:
    assert check_assumptions(plant()).status == "holds"


BROKEN = {
    "A0 drift": ("z1*x2 + v2", "z1*x2 + v2 + 1", "A0", "f1 is 1 at the origin"),
    "A0 gain": ("1 + p1^2", "p1 - 1/2", "A0", "b = 0 is not positive at p1 = 1/2"),
    "A1 only convex": ("(s - id)^2/2 + log(1 + exp(s))", "log(1 + exp(s))", "A1", "tends to 0"),
    "A1 not Lipschitz": ("(s - id)^2/2 + log(1 + exp(s))", "s^2 + s^4", "A1", "not globally Lipschitz"),
    "A2": ('["1 -> 2", "2 -> 1"]', '["1 -> 2"]', "A2", "no edge enters the agents {1}"),
    "A3 resonance": ('"-p1*z1 + x1 + v1"', '"x1 + v1"', "A3", "cannot be matched"),
    "A4 Jordan block": ("[[0, 1], [-1, 0]]", "[[0, 1], [0, 0]]", "A4", "Jordan block"),
    "A4 growth": ("[[0, 1], [-1, 0]]", '[["1e-18", 1], [-1, 0]]', "A4", "mixes even and odd powers"),
    "A5": ("z1*x2 + v2", "z1*x2 + sin(v2)", "A5", "not a polynomial in v"),
    "A6 one corner": ('["1/2", 2]', '["-1/10", 2]', "A6", "not stable at p1 = -1/10"),
}


@pytest.mark.parametrize(("old", "new", "assumption", "reason"), BROKEN.values(), ids=BROKEN)
def test_each_broken_assumption_is_found(old: str, new: str, assumption: str, reason: str) -> None:
    report = check_assumptions(plant(old, new))
    assert report.status == "fails"
    failing = [finding for finding in report.findings if finding.id == assumption and finding.verdict == "fails"]
    assert failing
    assert re.search(re.escape(reason), failing[0].reason), failing[0].reason


ANSWERS = {
    "right z*": ("steady_state = { z1 = '(p1*v1 - v2)/(1 + p1^2) + s/p1' }", "A3", "holds"),
    "wrong z*": ("steady_state = { z1 = '(p1*v1 + v2)/(1 + p1^2) + s/p1' }", "A3", "fails"),
    "z* off at the origin": ("steady_state = { z1 = '(p1*v1 - v2)/(1 + p1^2) + s/p1 + 1' }", "A3", "fails"),
    "right V0": ("zero_dynamics_lyapunov = '3*z1^2 + z1^4'", "A6", "holds"),
    "wrong V0": ("zero_dynamics_lyapunov = 'z1^4 - z1^2'", "A6", "fails"),
}


@pytest.mark.parametrize(("line", "assumption", "verdict"), ANSWERS.values(), ids=ANSWERS)
def test_answers_of_the_user_are_judged(line: str, assumption: str, verdict: str) -> None:
    report = check_assumptions(parse_plant((BASE + line).encode(), "p.toml"))
    assert report.of(assumption, 1).verdict == verdict


def test_steady_input_waits_for_what_it_rests_on() -> None:
    without_a3 = check_assumptions(plant('"-p1*z1 + x1 + v1"', '"x1 + v1"'))
    assert (without_a3.of("A5", 1).verdict, "A3" in without_a3.of("A5", 1).reason) == ("unknown", True)
    without_a4 = check_assumptions(plant("[[0, 1], [-1, 0]]", "[[0, 1], [0, 0]]"))
    assert (without_a4.of("A5", 1).verdict, "A4" in without_a4.of("A5", 1).reason) == ("unknown", True)


@pytest.mark.parametrize(
    ("verdicts", "status"),
    [
        ((), "holds"),
        (("holds", "holds"), "holds"),
        (("holds", "unknown"), "unknown"),
        (("unknown", "fails", "holds"), "fails"),
    ],
)
def test_status_of_a_report(verdicts: tuple[Verdict, ...], status: str) -> None:
    report = CheckReport(tuple(Finding("A1", k, verdict, "") for k, verdict in enumerate(verdicts)))
    assert report.status == status


def test_a_finding_that_is_not_there() -> None:
    with pytest.raises(KeyError):
        CheckReport(()).of("A1", 1)
