"""Routes and theorems are values in two tables: a third route is a line in each, and nothing else has to know it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from test_pipeline import PAIR

from certify.certificate import canonical
from certify.checker import check
from certify.checker.certificate import Certificate, Witness
from certify.checker.plant import Plant as CheckedPlant
from certify.checker.rules import recipe
from certify.checker.theorems import THEOREMS, Theorem
from certify.checker.verdict import require
from certify.pipeline import design_gains
from certify.routes import DEFAULT, RECIPE, ROUTES, route_of_theorem
from certify.statement.claim import _VIEWS
from symbolic.plant_file import parse_plant

TEMPLATES = Path(__file__).parent.parent / "reports" / "templates"


def toy(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """A route ``toy`` whose theorem asks for a saturation level of at most ``most`` besides all that recipe/2 asks."""

    def prove(plant: CheckedPlant, certificate: Certificate) -> None:
        recipe.prove(plant, certificate)
        for agent in certificate.claim.agents:
            require(agent.delta <= most, f"agent {agent.id}: toy", delta=agent.delta, most=most)

    monkeypatch.setitem(ROUTES, "toy", replace(RECIPE, name="toy", theorem="toy/1"))
    monkeypatch.setitem(THEOREMS, "toy/1", Theorem(Witness, prove))


def test_a_third_route_is_one_line_in_each_table(monkeypatch: pytest.MonkeyPatch) -> None:
    toy(monkeypatch, 10**40)
    result = design_gains(parse_plant(PAIR.encode(), "pair.toml"), route="toy")
    assert (result.status, result.route, result.summary["route"]) == ("certified", "toy", "toy")
    assert result.certificate is not None and result.certificate["theorem"] == "toy/1"
    assert check(PAIR.encode(), canonical(result.certificate) + b"\n").status == "verified"


def test_its_rule_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    toy(monkeypatch, 1)
    result = design_gains(parse_plant(PAIR.encode(), "pair.toml"), route="toy")
    assert result.status == "inconclusive" and result.certificate is None
    assert "agent 1: toy" in result.reason


def test_without_its_line_the_checker_knows_no_such_theorem(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        toy(patched, 10**40)
        certificate = design_gains(parse_plant(PAIR.encode(), "pair.toml"), route="toy").certificate
    assert certificate is not None
    verdict = check(PAIR.encode(), canonical(certificate) + b"\n")
    assert verdict.status == "malformed" and "recipe/2" in verdict.detail


def test_every_route_has_a_rule_a_view_and_words_in_the_report() -> None:
    words = re.search(r"#let routes = \((.*)\)", (TEMPLATES / "routes.typ").read_text(encoding="utf-8"))
    assert words is not None
    assert set(ROUTES) == set(_VIEWS) == set(re.findall(r"(\w+):", words[1]))
    assert {route.theorem for route in ROUTES.values()} <= set(THEOREMS)
    assert all(route_of_theorem(route.theorem) is route for route in ROUTES.values())
    assert DEFAULT in ROUTES and route_of_theorem("direct/1") is None and route_of_theorem(["direct"]) is None
