"""The outcome of route "recipe": certified, refuted or inconclusive, in exactly the JSON shape that is promised."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from fractions import Fraction

import pytest

from certify.certificate import SCHEMA, canonical, claim_digest
from certify.checker import check as independent_check
from certify.network_certificate import COORDINATOR_KEYS
from certify.pipeline import GainsResult, design_gains
from symbolic.plant import CoordinatorChoice, Plant
from symbolic.plant_file import parse_plant

PAIR = """
schema = "consensus-plant/1"
name = "pair"
network = { agents = 2, edges = ["1 -> 2", "2 -> 1"] }
initial = { box = [-1, 1], reference = 0, observer = 0, eta = 0 }
[[agent]]
ids = [1]
order = 1
f = "p*x1"
b = 1
cost = "(s - id)^2"
uncertain = { p = [-1, 1] }
[[agent]]
ids = [2]
order = 2
f = "x2 + x1^2"
b = "q"
cost = "(s - id)^2"
uncertain = { q = [1, 2] }
"""
NUMBER = re.compile(r"-?[0-9]+(/[1-9][0-9]*)?")


def pair(*changes: tuple[str, str]) -> Plant:
    text = PAIR
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return parse_plant(text.encode(), "pair.toml")


@pytest.fixture(scope="module")
def certified() -> GainsResult:
    return design_gains(pair(), route="recipe")


@pytest.fixture(scope="module")
def example(five_agents: Plant) -> GainsResult:
    return design_gains(five_agents, route="recipe")


def test_certified(certified: GainsResult) -> None:
    assert certified.status == "certified" and certified.route == "recipe"
    assert certified.certificate is not None
    assert certified.certificate["schema"] == SCHEMA and certified.certificate["theorem"] == "recipe/2"
    assert [agent.status for agent in certified.agents] == ["certified"] * 2
    assert certified.envelope is not None and certified.coordinator is not None


def test_the_summary_has_the_promised_shape(certified: GainsResult) -> None:
    summary, certificate = certified.summary, certified.certificate
    assert certificate is not None
    assert json.loads(json.dumps(summary)) == summary
    assert set(summary) == {"status", "route", "gains", "claim"}
    assert (summary["status"], summary["route"]) == ("certified", "recipe")
    gains = summary["gains"]
    assert set(gains) == {*COORDINATOR_KEYS, "agents"}
    assert [agent["id"] for agent in gains["agents"]] == [1, 2]
    for agent in gains["agents"]:
        assert list(agent) == ["id", "g", "K", "delta", "h", "level", "rate"]
        for key in ("g", "K", "delta", "level", "rate"):
            assert NUMBER.fullmatch(agent[key]) and Fraction(agent[key]) > 0
    assert gains["agents"][0]["h"] is None  # an agent of order 1 has no observer
    assert NUMBER.fullmatch(gains["agents"][1]["h"])
    assert summary["claim"] == {**certificate["claim"], "sha256": claim_digest(certificate)}


def test_the_claim_is_the_one_the_checker_verifies(certified: GainsResult) -> None:
    assert certified.certificate is not None
    text = canonical(certified.certificate) + b"\n"
    verdict = independent_check(PAIR.encode(), text)
    assert verdict.status == "verified"
    other = PAIR.replace("p = [-1, 1]", "p = [-1, 2]").encode()
    assert independent_check(other, text).status != "verified"


def test_progress_names_every_agent() -> None:
    heard: list[str] = []
    design_gains(pair(), route="recipe", progress=heard.append)
    assert [text for text in heard if text.startswith("agent ")] == [
        "agent 1: levels and thresholds",
        "agent 2: levels and thresholds",
    ]


def assert_nothing_certified(result: GainsResult, status: str) -> None:
    assert result.status == status and result.certificate is None
    assert result.summary == {"status": status, "route": "recipe", "gains": None, "claim": None}
    assert result.reason


def test_a_failed_assumption_refutes() -> None:
    result = design_gains(pair(('"1 -> 2", "2 -> 1"', '"1 -> 2"')), route="recipe")
    assert_nothing_certified(result, "refuted")
    assert result.reason.startswith("A2: ")
    convex = design_gains(pair(('"(s - id)^2"', '"(s - id)^4"')), route="recipe")
    assert_nothing_certified(convex, "refuted")
    assert convex.reason.startswith("A1, agent 1: ")


def test_an_open_assumption_is_inconclusive() -> None:
    result = design_gains(
        pair(('f = "x2 + x1^2"', 'f = "x2"\nzero_dynamics = { z1 = "-z1 - z1^3*cos(z1)^2 + x1" }')), route="recipe"
    )
    assert_nothing_certified(result, "inconclusive")
    assert re.match(r"A[36], agent 2: ", result.reason)


def test_an_exosystem_that_no_certificate_can_name_is_refused_before_any_search() -> None:
    exosystem = 'exosystem = { states = ["v", "w"], S = [[0, "sqrt(2)"], ["-sqrt(2)", 0]], initial = { v = 1, w = 0 } }'
    heard: list[str] = []
    plant = pair(("initial = {", f"{exosystem}\ninitial = {{"))
    result = design_gains(plant, route="recipe", progress=heard.append)
    assert_nothing_certified(result, "inconclusive")
    assert result.reason.startswith("A4: ") and "exosystem.S[1][2] = sqrt(2) is not rational" in result.reason
    assert heard == []
    rational = exosystem.replace('[0, "sqrt(2)"], ["-sqrt(2)", 0]', "[0, 1], [-2, 0]")
    assert design_gains(pair(("initial = {", f"{rational}\ninitial = {{")), route="recipe").status == "certified"


def test_a_cost_that_the_checker_cannot_bound_is_refused_before_any_search() -> None:
    cost = 'f = "p*x1"\nb = 1\ncost = "{}"'
    old = cost.format("(s - id)^2")
    heard: list[str] = []
    plant = pair((old, cost.format("s^2/2 + tanh(s^3)/100")))
    result = design_gains(plant, route="recipe", progress=heard.append)
    assert_nothing_certified(result, "inconclusive")
    assert (
        "agent 1: A1" in result.reason
        and "tanh of a growing argument; another way to write the cost may do" in result.reason
    )
    assert heard == []
    plant = pair((old, cost.format("s^2/2 + log(cosh(s))")))
    assert design_gains(plant, route="recipe", progress=heard.append).status == "certified"
    assert heard != []


def test_gains_that_are_too_small_for_the_proof_are_inconclusive() -> None:
    """They may well work: nothing is proved either way, and the reason names block and threshold."""
    result = design_gains(replace_gains("K = 20\nh = 5000"), route="recipe")
    assert_nothing_certified(result, "inconclusive")
    assert [agent.status for agent in result.agents].count("inconclusive") >= 1
    assert "a_ϑ is not positive (K = 20, the threshold is " in result.reason


def replace_gains(lines: str) -> Plant:
    return parse_plant((PAIR + "[gains]\n" + lines + "\n").encode(), "pair.toml")


def test_an_unstable_coordinator_is_inconclusive(five_agents: Plant) -> None:
    result = design_gains(
        replace(five_agents, coordinator=CoordinatorChoice(Fraction(1), Fraction(80), mixing_time=Fraction(0))),
        route="recipe",
    )
    assert_nothing_certified(result, "inconclusive")
    assert result.reason == "coordinator: no Lyapunov matrix was found for α1 = 1, α2 = 80"


def test_the_published_gains_are_refuted_for_every_agent(five_agents_published: Plant) -> None:
    """``K = 4e4, h = 100``: every agent's linearised loop is unstable; the smallest ``h`` that passes is named."""
    result = design_gains(five_agents_published, route="recipe")
    assert_nothing_certified(result, "refuted")
    assert len(result.agents) == 5
    for agent, derived in zip(result.agents, five_agents_published.agents, strict=True):
        assert agent.status == "refuted" and agent.linear is not None
        assert agent.linear.smallest_h is not None
        expected = 2.0e4 if derived.order == 2 else 4.5e4
        assert float(agent.linear.smallest_h) == pytest.approx(expected, rel=0.02)
        assert agent.reason.startswith(f"agent {agent.id}: ") and "the steady state is unstable" in agent.reason


def test_the_example_is_certified(example: GainsResult) -> None:
    assert example.status == "certified"
    assert [agent.id for agent in example.agents] == [1, 2, 3, 4, 5]
    for agent in example.agents:
        names = {"g", "K", "mu", "a", "delta", "T", "h1", "h2", "h3", "h", "level", "rate"}
        assert set(agent.thresholds) == names
        assert all(value > 0 for value in agent.thresholds.values())
        assert agent.thresholds["h"] >= max(agent.thresholds[name] for name in ("h1", "h2", "h3"))
        assert {f"varsigma{k}" for k in range(1, 12)} <= set(agent.constants) or not agent.matrices.get("V0")
        assert set(agent.matrices) - {"V0"} == {"P1", "P2", "P3"}
