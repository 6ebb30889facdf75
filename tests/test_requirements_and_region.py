"""What is required is met or named, and the boxes that ``certify region`` reports are certified, each by itself."""

from __future__ import annotations

import copy
import json
import re
from fractions import Fraction
from functools import cache
from pathlib import Path

import pytest

from certify.certificate import Json, canonical
from certify.checker import check
from certify.pipeline import design_gains
from certify.region import CertifiedRegion, NoRegion, certified_region
from certify.results import GainsResult
from certify.trade_off import TradeOff, trade_off
from certify.tube.initial_boxes import largest_factor
from reports.command_line import main
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant

TANKS = """
schema = "consensus-plant/1"
name = "tanks"
network = { agents = 2, edges = ["1 -> 2", "2 -> 1"] }
initial = { x = [-1, 1], reference = 0, observer = 0, eta = 0 }
[exosystem]
states = ["v1", "v2"]
S = [[0, 1], [-1, 0]]
initial = { v1 = 0, v2 = "1/2" }
[[agent]]
ids = [1, 2]
order = 1
f = "p*x1 - x1^3/20 + v1"
b = 1
cost = "(s - id + 3/2)^2"
uncertain = { p = [-1, 1] }
"""


@cache
def designed(more: str) -> tuple[Plant, GainsResult]:
    plant = parse_plant(f"{TANKS}\n{more}\n".encode(), "tanks.toml")
    return plant, design_gains(plant, route="direct")


def certified(more: str) -> tuple[Plant, Json]:
    plant, result = designed(more)
    assert result.certificate is not None, result.reason
    assert check(plant.source, canonical(result.certificate) + b"\n").status == "verified"
    return plant, result.certificate


def test_requirements_that_can_be_met_are_met() -> None:
    asked = '[requirements]\nsettling = { time = 12, band = "1/20" }\n[requirements.1]\ninput = 40'
    claim = certified(asked)[1]["claim"]
    assert claim["agents"][0]["requirements"] == {
        "settling": {"time": "12", "band": "1/20"},
        "input": "40",
        "bandwidth": None,
    }
    assert claim["agents"][1]["requirements"]["input"] is None


def test_what_stands_in_the_way_is_named_and_the_nearest_set_passes() -> None:
    band = 'band = "1/20"'
    result = designed(f'[requirements]\nsettling = {{ time = "1/2", {band} }}\ninput = 5')[1]
    assert result.status == "inconclusive"
    assert "requirements.settling" in result.reason
    set_ = r"the nearest set that passes: (settling = \{[^}]*\}), input = ([^,;]+), with K = ([^,;]+), delta = ([^ ]+) "
    nearest = re.findall(set_, result.reason)
    assert len(nearest) == 2
    for i, (settling, limit, K, delta) in enumerate(nearest, 1):
        table = f'[requirements.{i}]\n{settling}\ninput = {limit}\n[gains.{i}]\nK = "{K}"\ndelta = "{delta}"'
        certified(table)


def test_gains_that_are_fixed_are_kept() -> None:
    more = "[gains]\nK = 9\ndelta = 60\n[requirements]\ninput = 70"
    assert {entry["K"] for entry in certified(more)[1]["claim"]["agents"]} == {"9"}
    result = designed("[gains]\nK = 9\ndelta = 60\n[requirements]\ninput = 2")[1]
    assert result.status == "inconclusive"
    assert "requirements.input" in result.reason


def test_every_box_of_the_region_has_a_certificate_of_its_own() -> None:
    plant, certificate = certified("[gains]\nK = 9\ndelta = 60")
    found = certified_region(plant, certificate)
    assert isinstance(found, CertifiedRegion)
    assert found.uniform is not None
    for box in (found.uniform, *found.axes):
        assert box is not None
        assert check(box.plant.source, canonical(box.certificate) + b"\n").status == "verified"
        again = parse_plant(box.plant.source, "again.toml")
        for old, new, factors in zip(plant.agents, again.agents, box.factors, strict=True):
            assert new.initial.x[0].hi == factors[0] * old.initial.x[0].hi
            assert factors[0] > 1
            assert new.f == old.f
            assert new.initial.reference == old.initial.reference
        kept = [{key: entry[key] for key in ("g", "K", "delta", "h")} for entry in box.certificate["claim"]["agents"]]
        assert kept == [{key: entry[key] for key in kept[0]} for entry in certificate["claim"]["agents"]]


def test_the_limit_of_the_input_holds_in_the_larger_box_too() -> None:
    plant, certificate = certified("[gains]\nK = 9\ndelta = 60\n[requirements]\ninput = 20")
    limited, free = (
        certified_region(*pair) for pair in ((plant, certificate), certified("[gains]\nK = 9\ndelta = 60"))
    )
    assert isinstance(limited, CertifiedRegion)
    assert isinstance(free, CertifiedRegion)
    assert limited.uniform is not None
    assert free.uniform is not None
    assert max(limited.uniform.factors[0]) < max(free.uniform.factors[0])
    assert limited.uniform.certificate["claim"]["agents"][0]["requirements"]["input"] == "20"


@pytest.mark.slow
def test_gains_for_the_largest_region_have_a_larger_one() -> None:
    factors = []
    for wish in ("", 'region = "largest"'):
        found = certified_region(*certified(f"[requirements]\ninput = 30\n{wish}"))
        assert isinstance(found, CertifiedRegion)
        factors.append(min(max(row) for row in found.uniform.factors) if found.uniform else Fraction(1))
    assert factors[1] > factors[0]


def test_a_certificate_of_the_recipe_has_no_region() -> None:
    plant, certificate = certified("")
    found = certified_region(plant, {**certificate, "theorem": "recipe/1"})
    assert isinstance(found, NoRegion)


@pytest.mark.slow
def test_the_designs_of_a_trade_off_are_certified_and_none_beats_another() -> None:
    plant, certificate = certified("")
    found = trade_off(plant, certificate)
    assert isinstance(found, TradeOff)
    assert len(found.networks) >= 5
    for network in found.networks:
        assert check(plant.source, canonical(network.certificate) + b"\n").status == "verified"
    for index in range(2):
        designs = found.of(index)
        assert sorted(designs, key=lambda design: -design.settled) == list(designs)
        for one in designs:
            for other in designs:
                assert one is other or other.settled > one.settled or other.peak > one.peak or other.pole > one.pole


@pytest.mark.slow
def test_what_a_design_says_is_what_the_checker_proves() -> None:
    plant, certificate = certified("")
    found = trade_off(plant, certificate)
    assert isinstance(found, TradeOff)
    network = found.networks[-1]
    asked = [
        f'[requirements.{i}]\nsettling = {{ time = "{one.settled}", band = "{one.band}" }}\ninput = "{one.peak}"'
        for i, one in enumerate(network.designs, 1)
    ]
    data = f"{plant.source.decode()}\n{chr(10).join(asked)}\n".encode()
    again = copy.deepcopy(network.certificate)
    again["claim"]["plant_sha256"] = parse_plant(data, "p.toml").sha256
    for entry, one in zip(again["claim"]["agents"], network.designs, strict=True):
        settling = {"time": str(one.settled), "band": str(one.band)}
        entry["requirements"] = {"settling": settling, "input": str(one.peak), "bandwidth": None}
    assert check(data, canonical(again) + b"\n").status == "verified"


@pytest.mark.parametrize("limit", [1, 2, 5, 37, 1000])
def test_the_largest_factor_is_near_the_limit(limit: int) -> None:
    found = largest_factor(lambda factor: factor <= limit)
    assert found is not None
    assert limit * Fraction(98, 100) <= found <= limit


def test_no_factor_where_nothing_passes() -> None:
    assert largest_factor(lambda factor: False) is None
    assert largest_factor(lambda factor: True) == 2**10


def test_the_command_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plant, certificate = certified("[gains]\nK = 9\ndelta = 60")
    file, proof, folder = tmp_path / "p.toml", tmp_path / "c.json", tmp_path / "out"
    file.write_bytes(plant.source)
    proof.write_bytes(canonical(certificate) + b"\n")
    arguments = ["region", str(file), str(proof), "-o", str(folder), "--no-simulate", "--json"]
    assert main(arguments) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["status"] == "certified"
    assert len(answer["uniform"]["agents"]) == 2
    assert Fraction(answer["uniform"]["agents"][0]["factors"]["x1"]) > 1
    written = json.loads((folder / "region.json").read_text())
    assert written["uniform"] == answer["uniform"]
    assert main(["verify", str(folder / "region.toml"), str(folder / "certificate.json")]) == 0
    capsys.readouterr()
    file.write_bytes(plant.source + b"# another file\n")
    assert main([*arguments[:3], "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["status"] == "rejected"
