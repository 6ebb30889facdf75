"""A slice of ``python -m tests.refutable``: one plant of every kind, none of which gets a certificate."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest
from refutable.defects import COSTLY, DEFECTS
from refutable.network import Network, healthy
from refutable.trial import Tally, attempt, trial

from certify import pipeline


@pytest.mark.parametrize("defect", DEFECTS, ids=lambda defect: defect.__name__)
def test_no_certificate_for_a_refutable_network(defect: Callable[[random.Random], Network]) -> None:
    outcome, reason = attempt(defect(random.Random("slice")).text(), "recipe")
    assert outcome in ("refuted", "inconclusive"), reason
    assert reason


@pytest.mark.slow
@pytest.mark.parametrize("route", ["recipe", "direct"])
@pytest.mark.parametrize("defect", [*DEFECTS, *COSTLY], ids=lambda defect: defect.__name__)
def test_no_certificate_by_either_route(defect: Callable[[random.Random], Network], route: str) -> None:
    for seed in range(3):
        outcome, reason = attempt(defect(random.Random(f"slow/{seed}")).text(), route)
        assert outcome in ("refuted", "inconclusive", "too long"), reason


def test_networks_without_a_defect_do_get_one() -> None:
    """The generator's other parts are in order: what is refused above is refused for its defect."""
    outcomes = [attempt(healthy(random.Random(f"healthy/{seed}"), most=2).text(), "recipe")[0] for seed in range(4)]
    assert outcomes.count("certified") >= 3, outcomes


def test_exceptions_are_counted_as_failures(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*arguments: object) -> None:
        raise ZeroDivisionError("in the tool")

    monkeypatch.setattr("refutable.trial.design_gains", broken)
    tally = Tally()
    trial(0, 5, "recipe", tally)
    assert [reason for _, reason, _ in tally.faults] == ["ZeroDivisionError: in the tool"]
    assert not tally.certified


def test_time_limit_ends_the_search_of_the_direct_route(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a worker the pipeline makes no processes of its own, which an alarm would not reach."""
    monkeypatch.setattr(pipeline, "processors", lambda: 1)
    monkeypatch.setattr("certify.tube.route.tube_agent", lambda *arguments: any(zero for zero in iter(int, 1)))
    assert attempt(healthy(random.Random("limit"), least=2).text(), "direct", seconds=1)[0] == "too long"
