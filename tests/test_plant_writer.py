"""A plant that is written reads back equal, from files, from the generator of files and from memory."""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path

import pytest
import sympy
from fuzz.valid_plants import valid_plant

from symbolic.errors import InputError, Where
from symbolic.expression_text import expression_text, number_text
from symbolic.expressions import parse_expression
from symbolic.guards import Guard, guards
from symbolic.plant import Interval, Plant, RequestedGains, symbol
from symbolic.plant_file import load_plant, parse_plant
from symbolic.plant_writer import with_source, write_plant

ROOT = Path(__file__).resolve().parent.parent
REFUSED = ("number-1e400.toml", "agent-constant-in-initial.toml")  # cases that are no plants
FILES = sorted(
    path
    for path in (*(ROOT / "examples").rglob("*.toml"), *(ROOT / "tests").rglob("*.toml"))
    if path.name not in REFUSED
)
PENDULUMS = load_plant(ROOT / "examples" / "pendulums.toml")


def assert_reads_back(plant: Plant) -> Plant:
    """Every field but the digest, compared here and not by the writer's own comparison."""
    back = parse_plant(write_plant(plant).encode(), "back.toml")
    for part in fields(Plant):
        if part.name not in ("sha256", "source", "agents"):
            assert getattr(back, part.name) == getattr(plant, part.name), part.name
    for mine, theirs in zip(plant.agents, back.agents, strict=True):
        assert replace(theirs, guards=mine.guards) == mine
        for expr, written, again in (
            (mine.f, mine.guards.f, theirs.guards.f),
            (mine.b, mine.guards.b, theirs.guards.b),
            (mine.cost, mine.guards.cost, theirs.guards.cost),
        ):
            assert conditions(written) <= conditions(again) | conditions(guards(expr))
    return back


def conditions(found: Iterable[Guard]) -> set[tuple[sympy.Expr, str]]:
    return {(guard.expression, guard.need) for guard in found}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_files_read_back(path: Path) -> None:
    plant = load_plant(path)
    back = assert_reads_back(plant)
    assert write_plant(back) == write_plant(plant)


@pytest.mark.parametrize(
    "seeds", [range(40), pytest.param(range(40, 3000), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_generated_files_read_back(seeds: range) -> None:
    read = 0
    for seed in seeds:
        try:
            plant = parse_plant(valid_plant(random.Random(seed)), "generated.toml")
        except InputError:
            continue
        assert_reads_back(plant)
        read += 1
    assert read > len(seeds) // 2


x, y, p = map(symbol, "xyp")


@pytest.mark.parametrize(
    "expr",
    [
        1 / (3 * (x + 1)) * y,
        -(x + 1) * y,
        -(x + 1) * (y + 2) / 7,
        -x / y,
        -1 / x,
        x ** sympy.Rational(-3, 2) / 5,
        sympy.E * x,
        sympy.exp(-x) / 3,
        sympy.exp(1) ** 3 - x,
        sympy.sqrt(2) * x / sympy.sqrt(x**2 + 1),
        2 ** sympy.Rational(1, 3) * x / (x + sympy.pi),
        -2 * (x + y) ** 3 * sympy.sin(-x),
        sympy.Rational(-1, 3),
        x - (y - p) / 2,
        1 / (1 / (x + 1) + 2),
    ],
    ids=str,
)
def test_expressions_read_back(expr: sympy.Expr) -> None:
    assert parse_expression(expression_text(expr), {"x", "y", "p"}, where=Where("test")) == expr


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Fraction(3), "3"),
        (Fraction(-1, 2), "-0.5"),
        (Fraction(1, 3), '"1/3"'),
        (Fraction(1, 1000), "0.001"),
        (Fraction(1, 10**20), '"1/100000000000000000000"'),
        (Fraction(2**70), f'"{2**70}"'),
        (Fraction(-5, 4), "-1.25"),
    ],
)
def test_numbers_are_exact_and_short(value: Fraction, text: str) -> None:
    assert number_text(value) == text


def test_boxes_that_differ_from_agent_to_agent() -> None:
    agents = tuple(
        replace(agent, initial=replace(agent.initial, x=(Interval(Fraction(-k, 3), Fraction(k * k, 7)),) * 2))
        for k, agent in enumerate(PENDULUMS.agents, 1)
    )
    assert_reads_back(replace(PENDULUMS, agents=agents))


def test_gains_of_single_agents() -> None:
    gains = (RequestedGains(K=Fraction(3), h=Fraction(5)), RequestedGains(K=Fraction(3)), RequestedGains(K=Fraction(3)))
    text = write_plant(replace(PENDULUMS, gains=gains))
    assert "[gains]\nK = 3\n" in text and "[gains.1]\nh = 5\n" in text and "[gains.2]" not in text
    assert_reads_back(replace(PENDULUMS, gains=gains))


def test_a_changed_plant_gets_a_source_that_says_so() -> None:
    """The bytes that a certificate is bound to never tell of another plant than the values do."""
    assert with_source(PENDULUMS) is PENDULUMS
    changed = replace(PENDULUMS, gains=(RequestedGains(K=Fraction(7)),) * 3)
    sourced = with_source(changed)
    assert sourced.source != PENDULUMS.source and sourced.sha256 != PENDULUMS.sha256
    assert parse_plant(sourced.source, "again").gains == changed.gains
    assert with_source(replace(PENDULUMS, source=b"")).agents == PENDULUMS.agents


def test_plain_symbols_and_products_left_alone_are_evaluated() -> None:
    first = PENDULUMS.agents[0]
    left = sympy.Mul(2, sympy.Symbol("x1") + sympy.Symbol("d"), evaluate=False)
    plant = replace(PENDULUMS, agents=(replace(first, f=left), *PENDULUMS.agents[1:]))
    assert with_source(plant).agents[0].f == 2 * symbol("x1") + 2 * symbol("d")


def test_what_no_file_says_is_refused() -> None:
    some = replace(PENDULUMS.agents[0], initial=replace(PENDULUMS.agents[0].initial, observer=None))
    with pytest.raises(InputError, match=r"pendulums: agents\[1\]\.initial: a plant file cannot say this"):
        write_plant(replace(PENDULUMS, agents=(some, *PENDULUMS.agents[1:])))
    strange = replace(PENDULUMS.agents[0], f=sympy.Abs(symbol("x1")))
    with pytest.raises(InputError, match=r"agent\[1\]\.f: column 1: unknown function 'Abs'"):
        write_plant(replace(PENDULUMS, agents=(strange, *PENDULUMS.agents[1:])))


@pytest.mark.parametrize("cost", ["s^3/s", "log(s)*0 + s^2"])
def test_where_a_cost_is_not_defined_is_kept(cost: str) -> None:
    """SymPy cancels the pole, the file that is written does not."""
    text = (ROOT / "tests" / "tamper" / "plants" / "small_first_order.toml").read_text()
    line = next(line for line in text.splitlines() if line.startswith("cost"))
    plant = parse_plant(text.replace(line, f'cost = "{cost}"').encode(), "pole.toml")
    back = assert_reads_back(plant)
    assert any(guard.expression == symbol("s") for guard in back.agents[0].guards.cost)
