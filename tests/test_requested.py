"""What a plant file asks for (coordinator, gains, requirements, implementation): both readers, and what is unproved."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest
from fuzz.agreement import difference

from certify.assumptions.check import check_assumptions
from certify.checker import check
from certify.checker.plant import read_plant
from certify.checker.verdict import Malformed
from certify.preparation import Stopped, prepare
from symbolic.errors import InputError
from symbolic.plant import (
    CoordinatorChoice,
    Implementation,
    Interval,
    Plant,
    RequestedGains,
    Requirements,
    Settling,
)
from symbolic.plant_file import parse_plant

TEXT = (Path(__file__).parent / "tamper" / "plants" / "small_two_agents.toml").read_text()
CERTIFICATE = (Path(__file__).parent / "checker_corpus" / "first_order.json").read_bytes()
CORPUS = (Path(__file__).parent / "checker_corpus" / "first_order.toml").read_bytes()


def both(more: str) -> Plant:
    """The plant, which the two readers read alike."""
    data = f"{TEXT}\n{more}\n".encode()
    plant = parse_plant(data, "p.toml")
    assert difference(("accepted", read_plant(data)), ("accepted", plant)) is None
    return plant


def refused(more: str) -> str:
    """The tool's reason why neither reader takes the file."""
    data = f"{TEXT}\n{more}\n".encode()
    with pytest.raises(Malformed):
        read_plant(data)
    with pytest.raises(InputError) as caught:
        parse_plant(data, "p.toml")
    return str(caught.value).removeprefix("p.toml: ")


def test_all_of_the_coordinator() -> None:
    lines = "alpha1 = 3\nalpha2 = 2\ngradient_gain = '1/2'\nmixing_gain = 4\nmixing_time = 0\nsoftening = 0.25"
    plant = both(f"[coordinator]\n{lines}\nperiod = '1/100'\n[implementation]\nperiod = '1/2000'")
    numbers = map(Fraction, ("3", "2", "1/2", "4", "0", "1/4", "1/100"))
    assert plant.coordinator == CoordinatorChoice(*numbers)


def test_a_table_of_one_agent_keeps_what_it_leaves_out() -> None:
    plant = both("[gains]\nK = 40\nh = 100\n[gains.2]\nK = 50\ng = 2")
    assert plant.gains_of(1) == RequestedGains(K=Fraction(40), h=Fraction(100))
    assert plant.gains_of(2) == RequestedGains(g=Fraction(2), K=Fraction(50), h=Fraction(100))


def test_requirements_and_implementation_of_one_agent() -> None:
    plant = both(
        "[requirements]\nsettling = { time = 10, band = '1/100' }\ninput = 60\n"
        "[requirements.2]\nsettling = { time = 0, band = 2 }\nbandwidth = 400\nregion = 'largest'\n"
        "[implementation]\nperiod = '1/2000'\ndelay = [0, '1/2000']\nnoise = '1/1000'\ninput_resolution = 0\n"
        "[implementation.1]\narithmetic = 'single'\ndelay = '1/4000'"
    )
    assert plant.requirements_of(1) == Requirements(Settling(Fraction(10), Fraction(1, 100)), Fraction(60))
    assert plant.requirements_of(2) == Requirements(
        Settling(Fraction(0), Fraction(2)), Fraction(60), Fraction(400), "largest"
    )
    step = Fraction(1, 2000)
    own = Implementation(step, Interval(step / 2, step / 2), Fraction(1, 1000), Fraction(0), "single")
    assert plant.implementation_of(1) == own
    assert plant.implementation_of(2) == Implementation(step, Interval(Fraction(0), step), own.noise, Fraction(0))


def test_empty_tables_ask_for_nothing() -> None:
    plant, silent = both("[gains]\n[gains.1]\n[requirements]\n[coordinator]"), both("")
    assert (plant.gains, plant.requirements, plant.implementations) == ((), (), ())
    assert plant.coordinator == silent.coordinator == CoordinatorChoice()
    assert (plant.gains_of(2), plant.requirements_of(2), plant.implementation_of(2)) == (
        RequestedGains(),
        Requirements(),
        None,
    )


REFUSED = [
    ("[coordinator]\nmixing_time = -1", "coordinator.mixing_time: a number that is not negative is needed, found -1"),
    ("[coordinator]\nmixing_gain = 0", "coordinator.mixing_gain: a positive number is needed, found 0"),
    ("[coordinator]\nperiod = 1", "coordinator.period: only a sampled controller has one; add [implementation]"),
    ("[coordinator.1]\nalpha1 = 1", "coordinator: unknown key '1'"),
    ("[gains.3]\nK = 1", "gains.3: there is no agent '3'; agents are 1 to 2"),
    ("[gains.0]\nK = 1", "gains.0: there is no agent '0'"),
    ("[gains.01]\nK = 1", "gains.01: write 1 without leading zeros"),
    (f"[gains.{'9' * 5000}]\nK = 1", "there is no agent"),
    ('[gains."\u0661"]\nK = 1', "gains: unknown key '\\u0661'"),
    ("[gains.one]\nK = 1", "gains: unknown key 'one'"),
    ("[gains]\n1 = 3", "gains.1: a table is needed, found an integer"),
    ("[gains.1.1]\nK = 3", "gains.1: unknown key '1'"),
    ("gains = 3", "gains"),
    ("[requirements]\nsettling = 3", "requirements.settling: a table is needed, found an integer"),
    ("[requirements]\nsettling = { time = 3 }", "requirements.settling.band: missing; for example settling = {"),
    ("[requirements]\nsettling = { time = 3, band = 0 }", "requirements.settling.band: a positive number is needed"),
    ("[requirements]\nsettling = { time = 3, band = 1, x = 1 }", "requirements.settling: unknown key 'x'"),
    ("[requirements]\nregion = 'larger'", "requirements.region: \"largest\" is needed; did you mean 'largest'?"),
    ("[requirements]\nregion = ['largest']", 'requirements.region: "largest" is needed'),
    ("[implementation]\nnoise = 0", "implementation.period: missing; for example period ="),
    ("[implementation.1]\nperiod = 1", "implementation.period: missing"),
    (
        "[implementation]\nperiod = 1\ndelay = [-1, 0]",
        "implementation.delay: a number that is not negative is needed, found -1",
    ),
    ("[implementation]\nperiod = 1\narithmetic = 'float'", 'implementation.arithmetic: "double" or "single" is needed'),
    ("[implementation]\nperiod = 1\nnoise = -1", "implementation.noise: a number that is not negative is needed"),
]


@pytest.mark.parametrize(("more", "message"), REFUSED)
def test_refused_by_both_readers(more: str, message: str) -> None:
    assert message in refused(more)


UNPROVED = [
    ("[implementation]\nperiod = 1", "[implementation]"),
    ("[requirements]\ninput = 1", "requirements"),
    ("[requirements.1]\nregion = 'largest'", "requirements"),
]


def claimed_of(data: bytes) -> bytes:
    """The corpus' certificate with the digest of another plant file in its claim."""
    return CERTIFICATE.replace(
        parse_plant(CORPUS, "p.toml").sha256.encode(), parse_plant(data, "p.toml").sha256.encode()
    )


@pytest.mark.parametrize(("more", "name"), UNPROVED)
def test_what_is_not_proved_is_not_ignored(more: str, name: str) -> None:
    """The producer stops with the reason; the checker rejects a claim about the file, whatever its witnesses are."""
    data = f"{CORPUS.decode()}\n{more}\n".encode()
    plant = parse_plant(data, "p.toml")
    stopped = prepare(plant, check_assumptions(plant), lambda message: None)
    assert isinstance(stopped, Stopped)
    assert stopped.status == "inconclusive"
    assert name in stopped.reason
    verdict = check(data, claimed_of(data))
    assert verdict.status == "rejected"
    assert name in verdict.detail


@pytest.mark.parametrize("key", ["alpha1", "alpha2", "gradient_gain", "mixing_gain", "mixing_time", "softening"])
def test_a_claim_keeps_what_the_file_fixes_of_the_coordinator(key: str) -> None:
    lines = {"mixing_time": "0", key: '"3/7"'}
    data = CORPUS.replace(b"mixing_time = 0", "\n".join(f"{name} = {value}" for name, value in lines.items()).encode())
    assert data != CORPUS
    verdict = check(data, claimed_of(data))
    assert (verdict.status, verdict.obligation) == ("rejected", f"{key} is fixed by the plant file")


def test_a_claim_keeps_the_gains_of_each_agent() -> None:
    data = f"{CORPUS.decode()}\n[gains.2]\nK = 12345\n".encode()
    plant = parse_plant(data, "p.toml")
    claim_on_it = CERTIFICATE.replace(parse_plant(CORPUS, "p.toml").sha256.encode(), plant.sha256.encode())
    verdict = check(data, claim_on_it)
    assert (verdict.status, verdict.obligation) == ("rejected", "agent 2: K is fixed by the plant file")
