"""``holds`` only where every part of an expression is smooth, one that algebra cancels included; and only where the
independent checker agrees."""

from __future__ import annotations

import random

import pytest
from fuzz.inputs import expression
from refutable.network import healthy

from certify.assumptions.check import check_assumptions
from certify.checker.plant import read_plant
from certify.checker.rules.costs import prove_cost
from certify.checker.verdict import Malformed, Rejected, Undecided, start_meter
from symbolic.errors import InputError
from symbolic.plant import Plant
from symbolic.plant_file import load_plant, parse_plant


def text(f: str = "-x1", b: str = "1", cost: str = "(s - id)^2", more: str = "", f0: str = "") -> str:
    zero = f'zero_dynamics = {{ z1 = "{f0}" }}' if f0 else ""
    return f"""
schema = "consensus-plant/1"
name = "part"
network = {{ agents = 2, edges = ["1 -> 2", "2 -> 1"] }}
initial = {{ box = [-1, 1], reference = 0, observer = 0, eta = 0 }}
{more}
[[agent]]
ids = [1, 2]
order = 1
{zero}
f = "{f}"
b = "{b}"
cost = "{cost}"
uncertain = {{ w = [-1, 1], c = [2, 2] }}
"""


def plant(**parts: str) -> Plant:
    return parse_plant(text(**parts).encode(), "part.toml")


NOT_SMOOTH = {
    "root of a state": ({"f": "-sqrt(x1)"}, "A0", "the root of x1"),
    "root inside the box": ({"f": "sqrt(x1 + 1/2) - sqrt(1/2)"}, "A0", "it is negative at x1 = -1"),
    "pole": ({"f": "-x1/(x1 - 0.5)"}, "A0", "x1 = 1/2"),
    "irrational pole": ({"f": "x1/(x1^2 - 1/2)"}, "A0", "it is 0 between"),
    "logarithm": ({"f": "x1*log(1 + x1 + w/4)"}, "A0", "the logarithm of"),
    "tangent": ({"f": "tan(2*x1)"}, "A0", "the tangent of 2*x1"),
    "transcendental pole": ({"f": "x1/(sin(x1) - 1/2)"}, "A0", "it is 0 between"),
    "third root": ({"f": "x1^(1/3)"}, "A0", "the power 1/3 of x1"),
    "pole in a parameter": ({"f": "x1/w"}, "A0", "w = 0"),
    "pole at a parameter of zero width": ({"f": "x1/(c - 2 + w)"}, "A0", "w = 0"),
    "cancelled quotient": ({"f": "x1^2/x1"}, "A0", "the denominator x1"),
    "cancelled root": ({"f": "sqrt(x1)^2 - 2*x1"}, "A0", "the root of x1"),
    "part times zero": ({"f": "-x1 + 0*log(x1)"}, "A0", "the logarithm of x1"),
    "part minus itself": ({"f": "-x1 + 1/(x1 - 1/4) - 1/(x1 - 1/4)"}, "A0", "x1 = 1/4"),
    "part to the power zero": ({"f": "-x1 + x1*sqrt(x1)^0 - x1"}, "A0", "the root of x1"),
    "denominator of a denominator": ({"f": "-x1/(1/x1)"}, "A0", "the denominator x1"),
    "zero dynamics": ({"f": "z1", "f0": "-z1 + sqrt(x1)^2"}, "A0", "f0 (z1)"),
    "gain, cancelled root": ({"b": "2 + sqrt(w)^2"}, "A0", "the root of w"),
    "gain, cancelled quotient": ({"b": "1 + w/w"}, "A0", "the denominator w"),
    "cost, power of a root": ({"cost": "sqrt(s)^4"}, "A1", "the root of s"),
    "cost, cancelled cube": ({"cost": "s^3/s"}, "A1", "the denominator s"),
    "cost, cancelled quotient": ({"cost": "s^2 + (1/s)*s"}, "A1", "the denominator s"),
    "cost, part times zero": ({"cost": "s^2 + 0*tan(s)"}, "A1", "the tangent of s"),
    "cost, negative root": ({"cost": "s^2 + 0*sqrt(s^2 - 3)"}, "A1", "the root of s**2 - 3"),
}

SMOOTH = {
    "root that stays positive": {"f": "x1*sqrt(x1 + w/4 + 2)"},
    "pole outside": {"f": "x1/(x1 - 3/2)"},
    "tangent that stays finite": {"f": "tan(x1)"},
    "transcendental denominator": {"f": "x1/(2 + sin(x1*w))"},
    "cancelled part that is smooth": {"f": "x1*(x1 + 2)/(x1 + 2)", "b": "1 + (w + 3)/(w + 3)"},
    "cost": {"cost": "s^2 + (s^2 + 1)/(s^2 + 1) + sqrt(1 + s^2)^2"},
}


@pytest.mark.parametrize(("parts", "assumption", "words"), NOT_SMOOTH.values(), ids=NOT_SMOOTH)
def test_a_part_that_is_not_smooth_fails_with_its_name(parts: dict[str, str], assumption: str, words: str) -> None:
    finding = check_assumptions(plant(**parts)).of(assumption, 1)
    assert finding.verdict == "fails"
    assert words in finding.reason
    assert finding.evidence["at"]


@pytest.mark.parametrize("parts", SMOOTH.values(), ids=SMOOTH)
def test_parts_that_are_smooth_where_they_are_used_hold(parts: dict[str, str]) -> None:
    report = check_assumptions(plant(**parts))
    assert report.of("A0", 1).verdict == report.of("A1", 1).verdict == "holds"


def test_laws_that_the_checker_does_not_know_are_not_called_holding() -> None:
    """``sin² + cos² = 1`` makes A3 hold; an irrational oscillator satisfies A4."""
    steady = check_assumptions(plant(f0="-z1 + x1*(sin(w)^2 + cos(w)^2)", f="z1 - x1"))
    assert steady.of("A3", 1).verdict == "holds"  # z* = s (sin² + cos²) is what the equation says
    oscillator = (
        '[exosystem]\nstates = ["v1", "v2"]\nS = [[0, "sqrt(2)"], ["-sqrt(2)", 0]]\ninitial = { v1 = 0, v2 = 1 }\n'
    )
    finding = check_assumptions(plant(f="-x1 + v1", more=oscillator)).of("A4")
    assert finding.verdict == "unknown"
    assert "not rational" in finding.reason


def refused(data: bytes) -> dict[int, str]:
    """The agents whose costs the checker refuses, asked without the tool."""
    found = {}
    for agent in read_plant(data).agents:
        start_meter()
        try:
            prove_cost(agent)
        except (Rejected, Undecided, Malformed) as reason:
            found[agent.id] = str(reason)
    return found


def test_check_never_says_holds_of_a_cost_that_the_checker_refuses() -> None:
    """Expressions of the fuzzer's grammar as a part of a cost, as far as the readers accept them."""
    rng, read = random.Random(5), 0
    while read < 40:
        cost = "s^2 + " + expression(rng, 3).replace("x1", "s").replace("z1", "s")
        network = healthy(rng, 1, 2)
        network.agents[0].cost = cost
        data = network.text().encode()
        try:
            loaded = parse_plant(data, "fuzzed.toml")
        except InputError:
            continue
        read += 1
        report, refusals = check_assumptions(loaded), refused(data)
        for agent in loaded.agents:
            assert agent.id not in refusals or report.of("A1", agent.id).verdict != "holds", cost


def test_check_agrees_with_the_checker_on_every_example(examples) -> None:  # type: ignore[no-untyped-def]
    for file in sorted(examples.glob("*.toml")):
        report = check_assumptions(load_plant(file))
        assert not [finding for finding in report.findings if "refuses" in finding.reason], file.name
