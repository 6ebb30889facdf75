"""A4: spectra decided exactly, next to the cases that floating-point eigenvalues get wrong."""

from __future__ import annotations

import re

import pytest
import sympy
from hand_built import NOTHING, exosystem
from sympy import Rational, pi, sqrt

from certify.assumptions.a4_exosystem import check_exosystem

THETA = Rational(4, 5)
TINY = Rational(1, 10**18)

NEUTRAL = {
    "rotation": ([[0, THETA], [-THETA, 0]], ["4/5"]),
    "constant": ([[0]], ["0"]),
    "two constants": ([[0, 0], [0, 0]], ["0"]),
    "constant and rotation": ([[0, 0, 0], [0, 0, 3], [0, -3, 0]], ["0", "3"]),
    "uneven oscillator": ([[0, 8], [-2, 0]], ["4"]),
    "irrational oscillator": ([[0, sqrt(2)], [-sqrt(2), 0]], ["sqrt(2)"]),
    "square root of an algebraic number": ([[0, 1], [1 - sqrt(2), 0]], ["sqrt(-1 + sqrt(2))"]),
    "two surds": ([[0, 1], [-sqrt(2) - sqrt(3), 0]], ["sqrt(sqrt(2) + sqrt(3))"]),
    "the same frequency twice": ([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]], ["1"]),
}


@pytest.mark.parametrize(("rows", "frequencies"), NEUTRAL.values(), ids=NEUTRAL)
def test_neutral_stability_holds(rows: list[list[object]], frequencies: list[str]) -> None:
    finding = check_exosystem(exosystem(*rows))
    assert finding.verdict == "holds"
    assert finding.evidence["frequencies"] == frequencies


def test_frequencies_that_are_no_roots_are_enclosed() -> None:
    finding = check_exosystem(exosystem([0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [-1, 0, -3, 0]))
    assert finding.verdict == "holds"
    assert [text[:8] for text in finding.evidence["frequencies"]] == ["[1.61803", "[0.61803"]


REJECTED = {
    "integrator chain": ([[0, 1], [0, 0]], "Jordan block: each root of lambda .* multiplicity 2 with only 1"),
    "coupled oscillators": (
        [[0, 1, 1, 0], [-1, 0, 0, 1], [0, 0, 0, 1], [0, 0, -1, 0]],
        r"Jordan block: each root of lambda\*\*2 \+ 1",
    ),
    "coupled irrational oscillators": (
        [[0, sqrt(2), 1, 0], [-sqrt(2), 0, 0, 1], [0, 0, 0, sqrt(2)], [0, 0, -sqrt(2), 0]],
        r"Jordan block: each root of lambda\*\*2 \+ 2",
    ),
    "tiny Jordan block": ([[0, TINY], [0, 0]], "Jordan block"),
    "tiny growth": ([[TINY, THETA], [-THETA, 0]], "mixes even and odd powers"),
    "tiny decay": ([[-TINY, THETA], [-THETA, 0]], "mixes even and odd powers"),
    "decay": ([[-1]], "mixes even and odd powers"),
    "saddle": ([[0, 1], [1, 0]], "only 0 are real and negative"),
    "tiny saddle": ([[0, 1], [TINY, 0]], "only 0 are real and negative"),
    "saddle in a number field": ([[0, 1], [sqrt(2) - 1, 0]], "only 0 are real and negative"),
    "spirals": ([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [-1, 0, -1, 0]], "only 0 are real and negative"),
}


@pytest.mark.parametrize(("rows", "reason"), REJECTED.values(), ids=REJECTED)
def test_violations_are_found(rows: list[list[object]], reason: str) -> None:
    finding = check_exosystem(exosystem(*rows))
    assert finding.verdict == "fails"
    assert re.search(reason, finding.reason), finding.reason


def test_the_growing_eigenvalue_is_the_witness() -> None:
    finding = check_exosystem(exosystem([TINY, THETA], [-THETA, 0]))
    assert [root["real_part"][:6] for root in finding.evidence["eigenvalues"]] == ["[5.000", "[5.000"]


def test_transcendental_entries() -> None:
    assert check_exosystem(exosystem([0, pi], [-pi, 0])).verdict == "holds"
    undecided = check_exosystem(exosystem([0, pi], [-1, 0]))
    assert undecided.verdict == "unknown"
    assert "not algebraic" in undecided.reason


def test_no_exosystem() -> None:
    assert check_exosystem(NOTHING).verdict == "holds"


@pytest.mark.parametrize("scale", [Rational(1, 10**6), 10**6])
def test_the_verdict_survives_a_change_of_coordinates(scale: sympy.Rational) -> None:
    change = sympy.Matrix([[1, scale, 0], [0, 1, 3], [0, 0, scale]])
    for rows, verdict in (([[0, 0, 0], [0, 0, 3], [0, -3, 0]], "holds"), ([[0, 0, 0], [0, 0, 3], [0, 0, 0]], "fails")):
        S = change * sympy.Matrix(rows) * change.inv()
        assert check_exosystem(exosystem(*S.tolist())).verdict == verdict
