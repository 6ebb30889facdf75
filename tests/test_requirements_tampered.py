"""A slice of the tampering with requirements; the full run is a script of its own."""

from __future__ import annotations

from tamper_requirements import run


def test_no_mutant_of_the_requirements_is_accepted_wrongly() -> None:
    tally, wrong = run(40, seed=1)
    assert wrong == []
    assert tally["rejected"] > 15
    assert tally["malformed"] > 3
