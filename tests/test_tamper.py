"""A slice of ``python -m tests.tamper``: nothing that changes the claim or a needed number is accepted."""

from __future__ import annotations

import hashlib
import json
import random
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from tamper.bases import SMALL, Base, encode, held_plants, make_base, small_plants
from tamper.corpus import REQUIRED, asks, corpus, every_number
from tamper.judge import Tally, judge
from tamper.mutations import Mutant, at, paths, plant_edits, replaced, systematic
from tamper.recompute import why_not_proved
from tamper.values import changes, is_number

from certify.checker import check


def base_of(name: str, route: str = "recipe") -> Base:
    base = make_base(SMALL / f"{name}.toml", route)
    assert base is not None
    return base


@pytest.fixture(scope="module")
def bases() -> list[Base]:
    return [base_of("small_first_order"), base_of("small_second_order")]


def test_every_small_plant_is_certified_by_the_recipe() -> None:
    assert len([base_of(path.stem) for path in small_plants()]) >= 5


@pytest.mark.parametrize("count", [250, pytest.param(3000, marks=pytest.mark.slow)])
def test_no_mutant_of_a_slice_is_accepted_wrongly(bases: list[Base], count: int) -> None:
    bases = [*bases, base_of("small_first_order", "direct")]
    tally = Tally()
    mutants = list(corpus(bases, count, seed=0))
    for mutant in mutants:
        judge(bases[mutant.base], mutant, tally)
    assert tally.total == count
    assert {mutant.base for mutant in mutants} == {0, 1, 2}
    assert [(reason, mutant.operator, mutant.path) for reason, mutant in tally.wrong] == []
    assert [reason for reason, _ in tally.faults] == []
    assert min(tally.classes[name] for name in ("malformed", "rejected", "equivalent")) > 5


@pytest.mark.parametrize("count", [60, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("path", held_plants(), ids=lambda path: path.stem)
def test_no_mutant_of_references_that_wait_is_accepted_wrongly(path: Path, count: int) -> None:
    """Neither of the coordinator's curve nor of requirements, which are changed in the plant file too."""
    base = make_base(path, "direct")
    assert base is not None and "curve" in base.certificate["witness"]["coordinator"]
    tally = Tally()
    for mutant in corpus([base], count, seed=2):
        judge(base, mutant, tally)
    assert [(reason, mutant.operator, mutant.path) for reason, mutant in tally.wrong] == []
    assert [reason for reason, _ in tally.faults] == []
    assert min(tally.classes[name] for name in ("malformed", "rejected")) > 5
    asked = sum(number for (part, _), number in tally.parts.items() if part == "requirements")
    assert asked == (round(REQUIRED * count) if asks(base) else 0)


def test_requirements_that_no_bound_gives_are_not_confirmed() -> None:
    """The second proof of a changed requirement can say no."""
    base = make_base(next(path for path in held_plants() if path.stem == "required_two_agents"), "direct")
    assert base is not None
    claimed = {key: base.certificate["claim"]["agents"][1]["requirements"][key] for key in ("input", "bandwidth")}
    assert why_not_proved(base.plant, base.certificate) is None
    for key, value in claimed.items():
        plant = base.plant.replace(f"{key} = {value}".encode(), f'{key} = "1/100"'.encode())
        changed = replaced(base.certificate, ("claim", "plant_sha256"), hashlib.sha256(plant).hexdigest())
        for agent in (0, 1):
            changed = replaced(changed, ("claim", "agents", agent, "requirements", key), "1/100")
        assert check(plant, encode(changed)).status == "rejected"
        assert f": {key}" in (why_not_proved(plant, changed) or "")


@pytest.mark.parametrize("route", ["recipe", pytest.param("direct", marks=pytest.mark.slow)])
def test_every_path_of_the_certificate_matters_or_is_a_note(route: str) -> None:
    """For every number there is a change that is not accepted; only the producer's note is free."""
    base, rng = base_of("small_first_order", route), random.Random(0)
    for path in paths(base.certificate):
        if path[:1] == ("producer",) or not isinstance(at(base.certificate, path), str):
            continue
        options = changes(at(base.certificate, path))
        rng.shuffle(options)
        assert any(
            check(base.plant, encode(replaced(base.certificate, path, new))).status != "verified"
            for _, new in options[:12]
        ), path


def test_claim_is_bound_to_the_plant_file(bases: list[Base]) -> None:
    first, second = bases
    assert check(second.plant, encode(first.certificate)).status == "rejected"
    rebound = replaced(first.certificate, ("claim", "plant_sha256"), second.certificate["claim"]["plant_sha256"])
    assert check(second.plant, encode(rebound)).status != "verified"
    for _, plant in list(plant_edits(first.plant))[:10]:
        if plant != first.plant:
            assert check(plant, encode(first.certificate)).status != "verified"


def test_equivalent_means_the_same_claim_and_other_claims_are_proved_again(bases: list[Base]) -> None:
    base, tally = bases[0], Tally()
    delta = Fraction(base.certificate["claim"]["agents"][0]["delta"])
    larger = replaced(base.certificate, ("claim", "agents", 0, "delta"), str(2 * delta))
    assert judge(base, Mutant(0, "δ doubled", "claim", larger), tally) == "other claim, proved again"
    noted = replaced(base.certificate, ("producer", "python"), "another")
    assert judge(base, Mutant(0, "note", "producer", noted), tally) == "equivalent"
    smaller = replaced(base.certificate, ("claim", "agents", 0, "delta"), str(delta / 100))
    assert judge(base, Mutant(0, "δ/100", "claim", smaller), tally) == "rejected"
    assert not tally.wrong


@pytest.mark.slow
def test_every_number_of_a_direct_certificate_is_changed_once() -> None:
    base, tally = base_of("small_first_order", "direct"), Tally()
    mutants = list(every_number([base], seed=0))
    assert len(mutants) == sum(is_number(at(base.certificate, path)) for path in paths(base.certificate))
    for mutant in mutants:
        judge(base, mutant, tally)
    assert not tally.wrong
    assert not tally.faults


def test_other_claim_with_another_lyapunov_function_is_proved_again_with_that_one(bases: list[Base]) -> None:
    base = bases[1]
    g = Fraction(base.certificate["claim"]["agents"][0]["g"])
    changed = replaced(base.certificate, ("claim", "agents", 0, "g"), str(g * (1 + Fraction(1, 10**12))))
    changed = replaced(changed, ("witness", "agents", 0, "V0", 0, 0), "499999/1000000")
    assert judge(base, Mutant(1, "g and V0", "both", changed), Tally()) == "other claim, proved again"
    unproved = replaced(changed, ("witness", "agents", 0, "a0"), "1")
    assert why_not_proved(base.plant, unproved) is not None


def test_other_claims_of_the_direct_route_are_proved_again() -> None:
    base, tally = base_of("small_first_order", "direct"), Tally()
    delta = Fraction(base.certificate["claim"]["agents"][0]["delta"])
    larger = replaced(base.certificate, ("claim", "agents", 0, "delta"), str(delta + 1))
    assert judge(base, Mutant(0, "δ + 1", "claim", larger), tally) == "other claim, proved again"
    weaker = replaced(base.certificate, ("claim", "agents", 0, "K"), "1/1000")
    assert why_not_proved(base.plant, weaker) is not None


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("claim", "agents", 0, "delta"), "1/1000"),
        (("claim", "agents", 0, "K"), "2"),
        (("claim", "agents", 0, "g"), "1/2"),
        (("claim", "alpha1"), "-1"),
        (("witness", "coordinator", "rate"), "1000"),
        (("witness", "coordinator", "c"), "1/1000000"),
        (("witness", "agents", 0, "level"), "1/1000000"),
        (("witness", "agents", 0, "weight_theta"), "1000000"),
        (("claim", "plant_sha256"), "0" * 64),
    ],
)
def test_second_proof_refuses_what_is_not_so(bases: list[Base], path: tuple[Any, ...], value: Any) -> None:
    """The code that confirms other claims can say no; otherwise its yes would mean nothing."""
    assert why_not_proved(bases[0].plant, bases[0].certificate) is None
    assert why_not_proved(bases[0].plant, replaced(bases[0].certificate, path, value)) is not None


def test_rule_counts_a_checker_that_accepts_everything(bases: list[Base], monkeypatch: pytest.MonkeyPatch) -> None:
    """Were the checker to say yes to all, the corpus would say so."""
    import tamper.judge as judging

    from certify.certificate import claim_digest
    from certify.checker import Verdict

    def gullible(plant: bytes, certificate: bytes) -> Verdict:
        return Verdict("verified", claim_sha256=claim_digest(json.loads(certificate)))

    monkeypatch.setattr(judging, "check", gullible)
    tally, outcomes = Tally(), Counter[str]()
    for mutant in list(systematic(bases, 0, splices=False))[200:2000:40]:
        if mutant.path.startswith("claim.") and not isinstance(mutant.value, bytes):
            try:
                outcomes[judge(bases[0], mutant, tally)] += 1
            except (ValueError, KeyError, TypeError, AttributeError):
                continue  # the second proof cannot even read this one
    assert outcomes["accepted wrongly"] > 5
