"""Constants that are no real numbers, or too much work: refused by both plant readers, at once and in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from counted import at_most

from certify.checker.plant import read_plant
from certify.checker.verdict import Malformed
from symbolic.errors import InputError
from symbolic.plant_file import parse_plant

PLANT = (Path(__file__).parent / "tamper" / "plants" / "small_first_order.toml").read_bytes()
LINKS = (
    "k + 1",
    "exp(k/9)",
    "exp(-k)",
    "sin(k)",
    "1/(1 + k)",
    "sqrt(k + 1)",
    "k*k",
    "k^2/(1 + k)",
    "cosh(k/9)^2/3",
)
NO_NUMBERS = (
    "log(0)",
    "sqrt(-1)",
    "log(1 - sqrt(2))",
    "sqrt(1 - exp(1))",
    "1/(sqrt(2) - sqrt(2))",
    "exp(exp(9))",
    "exp(9000)/exp(9000)",
    "0*log(-1)",
    "exp(1e200)",
)


def with_constants(*lines: str) -> bytes:
    return PLANT.replace(b"[network]", "\n".join(["[constants]", *lines, "[network]"]).encode())


def chain(link: str, length: int) -> bytes:
    parts = [f'k{n} = "{link.replace("k", f"k{n - 1}")}"' for n in range(1, length)]
    return with_constants('k0 = "sqrt(2)"', *parts)


@pytest.mark.parametrize("length", [49, 100, 400, 900])
@pytest.mark.parametrize("link", LINKS)
def test_long_chain_of_irrational_constants_is_refused_at_once(link: str, length: int) -> None:
    data = chain(link, length)
    with (
        at_most(15_000_000),
        pytest.raises(InputError, match=r"48 constants that are not rational|nested too deeply|too large|write it"),
    ):
        parse_plant(data, "chain.toml")
    with (
        at_most(15_000_000),
        pytest.raises(Malformed, match=r"48 constants that are not known|nested too deeply|too many parts|a constant"),
    ):
        read_plant(data)


@pytest.mark.parametrize("depth", [12, 24, 200])
def test_nested_exponentials_of_a_constant_are_refused_at_once(depth: int) -> None:
    """SymPy decides the sign of a constant in time that doubles with every level."""
    with at_most(150_000), pytest.raises(InputError, match="nested"):
        parse_plant(with_constants(f'k = "{"exp(1/9*" * depth + "sqrt(2)" + ")" * depth}"'), "deep.toml")


@pytest.mark.parametrize("text", NO_NUMBERS)
def test_constant_that_is_no_real_number_is_refused_by_both(text: str) -> None:
    for data in (with_constants(f'c = "{text}"'), PLANT.replace(b'"p*x1"', f'"p*x1 + 0*({text})"'.encode())):
        with pytest.raises(InputError, match=r"real number|division"):
            parse_plant(data, "c.toml")
        with pytest.raises(Malformed, match="real number"):
            read_plant(data)


@pytest.mark.parametrize("links", [47, 5])
def test_short_chains_are_read_by_both(links: int) -> None:
    for link in ("k + 1", "2*(k + 1)", "k*3/2"):
        data = chain(link, links)
        assert read_plant(data).sha256 == parse_plant(data, "chain.toml").sha256


def test_rational_constants_may_be_many() -> None:
    data = with_constants('k0 = "1/3"', *(f'k{n} = "k{n - 1} + 1"' for n in range(1, 900)))
    assert read_plant(data).sha256 == parse_plant(data, "many.toml").sha256


@pytest.mark.parametrize("text", ["+".join(["s"] * 1000), "(" * 20 + "s" + ")" * 20 + "+(s)" * 499])
def test_expressions_of_the_greatest_length_are_read_by_both(text: str) -> None:
    data = PLANT.replace(b'"(s - 1)^2/2"', f'"{text}"'.encode())
    assert read_plant(data).sha256 == parse_plant(data, "long.toml").sha256


def test_dots_in_comments_are_no_deep_key() -> None:
    data = PLANT + b"# " + b"x1 is here. " * 100 + b"\n"
    assert read_plant(data).sha256 == parse_plant(data, "dots.toml").sha256
