"""A1 of the checker: a cost must be smooth on the whole line before its second derivative says anything."""

from __future__ import annotations

import random
from fractions import Fraction
from typing import Any

import mpmath
import pytest

from certify.checker.expressions import FUNCTIONS, Node, evaluate
from certify.checker.plant import read_plant
from certify.checker.rules.costs import prove_cost
from certify.checker.verdict import STEPS, Malformed, Rejected, start_meter

PLANT = """schema = "consensus-plant/1"
name = "cost"
[network]
agents = 1
edges = []
[initial]
box = 0
[[agent]]
ids = [1]
order = 1
f = "0"
b = 1
cost = "{cost}"
"""


def curvature(cost: str) -> tuple[float, float]:
    start_meter(STEPS)
    found = prove_cost(read_plant(PLANT.format(cost=cost).encode()).agents[0])
    return float(found.least), float(found.largest)


@pytest.mark.parametrize(
    "cost",
    [
        "s^2 + 4*s - s*exp(atan(s) + atan(1/s))",  # c'' has no trace of the jump of c' at 0
        "s^2/4 + 10000*exp(atan(s + 100) + atan(1/(s + 100)))",  # nor of a jump far from every trajectory
        "s^2/4 + 0*log(s)",
        "s^2 + 0/s",
        "s^2 + exp(atan(tan(s)) - s)",
        "s^2 + sqrt(s)*0",
    ],
)
def test_a_cost_that_is_not_smooth_somewhere_is_refused(cost: str) -> None:
    with pytest.raises(Rejected, match="A1"):
        curvature(cost)


@pytest.mark.parametrize(
    ("cost", "least", "largest"),
    [
        ("s^2/4", 0.5, 0.5),
        ("s^2/2 + log(1 + exp(s))", 1.0, 1.25),
        ("(s - 1)^2/4 + sin(s)/10", 0.4, 0.6),
        ("s^2 + sqrt(1 + s^2)", 2.0, 3.0),
        ("s^2/2 + log(cosh(s - 1))", 1.0, 2.0),
        ("s^2/2 + sqrt(1 + (s - 3)^2)", 1.0, 2.0),
        ("s^2/2 + sqrt(s^2 - 2*s + 2)", 1.0, 2.0),
        ("s^2 + exp(-(s - 2)^2)/2", 1.0, 2.4463),
        ("(s - 2)^2/2 + log(1 + (s - 2)^2)/8", 0.96875, 1.25),
        ("s^2 + tanh(s - 1)/2", 1.6151, 2.3849),
        ("s^2 + atan(s - 1)/3", 1.7835, 2.2165),
        ("s^2 + s*tanh(s)", 1.8523, 4.0),
        ("s^2 + sin(s)*exp(-s^2)/4", 1.4712, 2.5289),
        ("sqrt((s - 1)^2 + 1e-12) + (s - 1)^2", 2.0, 1e6 + 2),
        ("sqrt((s - 1/3)^2 + 1e-8)/100 + s^2/2", 1.0, 101.0),
        ("s^2/(80*log(s^2 + 2)) + (s - 5)^2", 2.0, 2.0361),
    ],
)
def test_smooth_costs_keep_their_bounds(cost: str, least: float, largest: float) -> None:
    low, high = curvature(cost)
    assert 0.9 * least <= low <= least + 1e-4
    assert largest - 1e-4 <= high <= 1.21 * largest


def term(rng: random.Random, depth: int) -> str:
    kind = rng.randrange(12)
    if depth <= 0 or kind < 2:
        return rng.choice(["s", "s", "s", "1", "2", "1/3", "s + 1", "s - 100", "s/7", "1/s"])
    if kind < 5:
        return f"({term(rng, depth - 1)}{rng.choice('+-*/')}({term(rng, depth - 1)}))"
    if kind < 6:
        return f"({term(rng, depth - 1)})^{rng.choice([2, 3, 4, -1, -2])}"
    return f"{rng.choice(FUNCTIONS)}({term(rng, depth - 1)})"


def value(cost: Node, s: Any) -> Any:
    """In 60 digits; a number that is not real where the cost is not defined."""

    def number(q: Fraction) -> Any:
        return mpmath.mpf(q.numerator) / q.denominator

    return evaluate(cost, {"s": s}, number, lambda function, argument: getattr(mpmath, function)(argument))


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 9))])
def test_second_differences_of_random_costs_are_within_what_was_proved(seed: int) -> None:
    rng, accepted = random.Random(seed), 0
    while accepted < 15:
        text = f"s^2/2 + {rng.choice(['1', '1/10', '1/1000', '1/1000000'])}*({term(rng, rng.randint(1, 4))})"
        start_meter(10_000_000)
        try:
            agent = read_plant(PLANT.format(cost=text).encode()).agents[0]
            found = prove_cost(agent)
        except (Malformed, Rejected):
            continue
        accepted += 1
        least, largest = float(found.least) - 1e-8, float(found.largest) + 1e-8
        with mpmath.workdps(60):
            sizes = [mpmath.mpf(10) ** k for k in range(-6, 6)]
            points = [mpmath.mpf(0), *sizes, *(-size for size in sizes)]
            for s in [*points, *(mpmath.mpf(rng.uniform(-20, 20)) for _ in range(20))]:
                h = mpmath.mpf(10) ** -15 * max(1, abs(s)) if abs(s) < 1000 else mpmath.mpf(10) ** -10
                second = (value(agent.cost, s + h) - 2 * value(agent.cost, s) + value(agent.cost, s - h)) / h**2
                assert isinstance(second, mpmath.mpf), text
                assert least <= second <= largest, (text, s)
