"""Attempts, made by hand while reading the checker, to have something false accepted; what is accepted here is true."""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from counted import at_most
from tamper.bases import SMALL, Base, encode, make_base
from tamper.recompute import why_not_proved

from certify.certificate import claim_digest
from certify.checker import check

Json = dict[str, Any]
HUGE, TINY = "9" * 3_999, "1/1" + "0" * 3_900


@pytest.fixture(scope="module")
def lone() -> Base:
    """One agent of order 1, no zero dynamics, no disturbance."""
    return _base("small_first_order")


@pytest.fixture(scope="module")
def second() -> Base:
    """One agent of order 2 with zero dynamics, an internal model and a disturbance."""
    return _base("small_second_order")


def _base(name: str) -> Base:
    base = make_base(SMALL / f"{name}.toml")
    assert base is not None
    return base


def _status(base: Base, edit: Callable[[Json], Any], plant: bytes | None = None) -> str:
    certificate = copy.deepcopy(base.certificate)
    edit(certificate)
    return check(base.plant if plant is None else plant, encode(certificate)).status


def _agent(certificate: Json, part: str = "witness") -> Json:
    return certificate[part]["agents"][0]  # type: ignore[no-any-return]


def _coordinator(certificate: Json) -> Json:
    return certificate["witness"]["coordinator"]  # type: ignore[no-any-return]


def _times(value: str, factor: Fraction) -> str:
    return str(Fraction(value) * factor)


WITNESS_OF_SECOND: dict[str, Callable[[Json], Any]] = {
    "V0 negative definite": lambda c: _agent(c).update(V0=[["-1", "0"], ["0", "-1"]]),
    "V0 zero": lambda c: _agent(c).update(V0=[["0", "0"], ["0", "0"]]),
    "V0 not symmetric": lambda c: _agent(c)["V0"][0].__setitem__(1, "1/1000000"),
    "V0 tiny, so that the box is huge": lambda c: _agent(c).update(V0=[[TINY, "0"], ["0", TINY]]),
    "a0 huge": lambda c: _agent(c).update(a0=HUGE),
    "a0 negative": lambda c: _agent(c).update(a0="-1"),
    "level 0": lambda c: _agent(c).update(level="0"),
    "level negative, slack larger": lambda c: _agent(c).update(level="-1", slack="1000"),
    "slack 0": lambda c: _agent(c).update(slack="0"),
    "slack huge": lambda c: _agent(c).update(slack=HUGE),
    "weight 0": lambda c: _agent(c).update(weight_eta="0"),
    "weight negative": lambda c: _agent(c).update(weight_theta="-1"),
    "both weights negative": lambda c: _agent(c).update(weight_theta="-1", weight_eta="-1"),
    "weights huge, so that V2 and V3 vanish": lambda c: _agent(c).update(weight_theta=HUGE, weight_eta=HUGE),
    "no P2": lambda c: _agent(c).update(P2=[]),
    "no P1, no P3": lambda c: _agent(c).update(P1=[], P3=[]),
    "ell one too long": lambda c: _agent(c)["ell"].append("0"),
    "ell and internal model away": lambda c: (
        _agent(c).update(ell=[], P2=[]),
        _agent(c, "claim").update(M=[], N=[], psi=[]),
    ),
    "M not Hurwitz": lambda c: _agent(c, "claim").update(M=[["0", "1", "0"], ["0", "0", "1"], ["0", "-1", "0"]]),
    "psi and N with the other sign": lambda c: _agent(c, "claim").update(
        psi=[_times(p, Fraction(-1)) for p in _agent(c, "claim")["psi"]]
    ),
    "other observer than P3's": lambda c: _agent(c, "claim").update(observer=["100", "1/100"]),
    "observer unstable": lambda c: _agent(c, "claim").update(observer=["-1", "2"]),
    "gamma negative": lambda c: _agent(c, "claim").update(gamma=["-1"]),
    "g below 1": lambda c: _agent(c, "claim").update(g="999999/1000000"),
    "h below g": lambda c: _agent(c, "claim").update(h="1"),
    "h null": lambda c: _agent(c, "claim").update(h=None),
    "K negative": lambda c: _agent(c, "claim").update(K="-1"),
    "δ negative": lambda c: _agent(c, "claim").update(delta="-1"),
    "K alone huge": lambda c: _agent(c, "claim").update(K=HUGE),
    "K tiny": lambda c: _agent(c, "claim").update(K=TINY),
    "h alone huge, so that h2 and peaking are not seen": lambda c: _agent(c, "claim").update(delta="1", h=HUGE),
    "steady state in terms of a state": lambda c: _agent(c).update(steady_state=["z1", "z2"]),
    "steady state divided by zero and back": lambda c: _agent(c).update(steady_state=["s*(v1/v1)", "s"]),
    "steady state too short": lambda c: _agent(c).update(steady_state=["s"]),
    "another id": lambda c: _agent(c).update(id="2"),
    "id 01": lambda c: _agent(c).update(id="01"),
    "optimum empty": lambda c: c["witness"].update(optimum=["2", "1"]),
    "optimum beside s*": lambda c: c["witness"].update(optimum=["2", "3"]),
    "optimum a point beside s*": lambda c: c["witness"].update(optimum=["1000000000001/1000000000000"] * 2),
    "optimum infinite": lambda c: c["witness"].update(optimum=["-" + HUGE, HUGE]),
    "no Q": lambda c: c["witness"].update(exosystem=None),
    "Q only semidefinite": lambda c: c["witness"].update(exosystem={"Q": [["0", "0"], ["0", "0"]]}),
    "Q negative": lambda c: c["witness"].update(exosystem={"Q": [["-1", "0"], ["0", "-1"]]}),
    "Q not kept": lambda c: c["witness"].update(exosystem={"Q": [["1", "0"], ["0", "2"]]}),
    "no curve": lambda c: _coordinator(c).update(curve=[], times=[c["claim"]["mixing_time"]]),
    "the curve is zero": lambda c: _coordinator(c).update(
        curve=[[["0"] for _ in step] for step in _coordinator(c)["curve"]]
    ),
    "one stretch only": lambda c: _coordinator(c).update(
        curve=_coordinator(c)["curve"][:1], times=_coordinator(c)["times"][:2]
    ),
    "stretches in another order": lambda c: _coordinator(c)["curve"].reverse(),
    "times in another order": lambda c: _coordinator(c)["times"].reverse(),
    "a stretch without length": lambda c: _coordinator(c)["times"].__setitem__(2, _coordinator(c)["times"][1]),
    "the curve begins earlier": lambda c: _coordinator(c)["times"].__setitem__(0, "0"),
    "unit negative": lambda c: _coordinator(c).update(unit="-1"),
    "unit huge": lambda c: _coordinator(c).update(unit=HUGE),
    "unit tiny": lambda c: _coordinator(c).update(unit=TINY),
    "no time to mix": lambda c: (c["claim"].update(mixing_time=TINY), _coordinator(c)["times"].__setitem__(0, TINY)),
    "starts at once": lambda c: c["claim"].update(mixing_time="0"),
    "mixing slowly": lambda c: c["claim"].update(mixing_gain=TINY),
    "soft start negative": lambda c: c["claim"].update(softening="-1"),
    "soft start huge": lambda c: c["claim"].update(softening=HUGE),
    "gradient gain 0": lambda c: c["claim"].update(gradient_gain="0"),
    "gradient gain ten times": lambda c: c["claim"].update(
        gradient_gain=_times(c["claim"]["gradient_gain"], Fraction(10))
    ),
    "c below B²": lambda c: _coordinator(c).update(c=TINY),
    "B huge": lambda c: _coordinator(c).update(B=[HUGE]),
    "shift negative": lambda c: _coordinator(c).update(shift="-1"),
    "left null vector of another graph": lambda c: c["witness"].update(left_null_vector=["1/2"]),
    "rate negative": lambda c: c["witness"]["coordinator"].update(rate="-1"),
    "rate beyond the truth": lambda c: c["witness"]["coordinator"].update(rate="11"),
    "mixing rate 0": lambda c: c["witness"]["coordinator"].update(mixing_rate="0"),
    "α1 negative": lambda c: c["claim"].update(alpha1="-1"),
    "α2 zero": lambda c: c["claim"].update(alpha2="0"),
    "no agents": lambda c: (c["claim"].update(agents=[]), c["witness"].update(agents=[])),
    "agent twice": lambda c: (
        c["claim"]["agents"].append(_agent(c, "claim")),
        c["witness"]["agents"].append(_agent(c)),
    ),
    "another theorem": lambda c: c.update(theorem="direct/3"),
    "unknown theorem": lambda c: c.update(theorem="recipe/1"),
}


@pytest.mark.parametrize("name", WITNESS_OF_SECOND)
def test_attack_on_the_certificate_of_a_second_order_agent(second: Base, name: str) -> None:
    assert _status(second, lambda certificate: None) == "verified"
    with at_most(3_000_000):
        assert _status(second, WITNESS_OF_SECOND[name]) in ("rejected", "malformed")


FIRST_ORDER: dict[str, Callable[[Json], Any]] = {
    "h given": lambda c: _agent(c, "claim").update(h="100"),
    "observer given": lambda c: _agent(c, "claim").update(observer=["1"]),
    "gamma given": lambda c: _agent(c, "claim").update(gamma=["1"]),
    "P3 given": lambda c: _agent(c).update(P3=[["1"]]),
    "V0 given": lambda c: _agent(c).update(V0=[["1"]]),
    "steady state given": lambda c: _agent(c).update(steady_state=["s"]),
    "exosystem given": lambda c: c["witness"].update(exosystem={"Q": [["1"]]}),
    "exosystem given, empty": lambda c: c["witness"].update(exosystem={"Q": []}),
    "K huge and δ not": lambda c: _agent(c, "claim").update(K=HUGE),
    "internal model without need": lambda c: (
        _agent(c).update(ell=["-1"], P2=[["1"]]),
        _agent(c, "claim").update(M=[["-1"]], N=["0"], psi=["1"]),
    ),
}


@pytest.mark.parametrize("name", FIRST_ORDER)
def test_attack_on_the_certificate_of_a_first_order_agent(lone: Base, name: str) -> None:
    assert _status(lone, FIRST_ORDER[name]) in ("rejected", "malformed")


PLANTS = {
    "x1 = 0 is a pole of f that cancels": ('f = "p*x1"', 'f = "p*x1 + 1/x1 - 1/x1"'),
    "f is not defined on the box, times 0": ('f = "p*x1"', 'f = "p*x1 + 0*log(x1 - 5)"'),
    "f is divided by what vanishes identically": ('f = "p*x1"', 'f = "p*x1 + 0/(p - p)"'),
    "b is divided by what vanishes identically": ('b = "1"', 'b = "1 + 0/(p - p)"'),
    "the cost is divided by what vanishes identically": ("(s - 1)^2/2", "(s - 1)^2/2 + 0/(s - s)"),
    "b is not defined on W, cancelled": ('b = "1"', 'b = "p/p"'),
    "b is 0 at a point inside W": ('b = "1"', 'b = "p^2"'),
    "b is positive at the vertices of W": ('b = "1"', 'b = "p^2 - 1/2"'),
    "the cost is not defined where y goes": ("(s - 1)^2/2", "(s - 1)^2/2 + log(s + 1/2) - log(s + 1/2)"),
    "the cost has a cancelled pole": ("(s - 1)^2/2", "(s - 1)^2/2 + 1/s - 1/s"),
    "the cost is convex near s* only": ("(s - 1)^2/2", "(s - 1)^2/2 - (s - 1)^4/1000000"),
    "the cost grows faster far away": ("(s - 1)^2/2", "(s - 1)^2/2 + (s - 1)^4/1000000000000"),
    "another optimum": ("(s - 1)^2/2", "(s - 1000001/1000000)^2/2"),
    "a flat cost": ("(s - 1)^2/2", "(s - 1)^2/2000"),
    "f does not vanish at the origin": ('f = "p*x1"', 'f = "p*x1 + 1/1000000000000000000"'),
    "a parameter beyond the box": ("p = [-1, 1]", "p = [-1, 100]"),
    "a wider initial box": ("box = [-1, 1]", "box = [-100, 100]"),
    "references from a box": ("reference = 0", "reference = [-50, 50]"),
    "K fixed to another value": ("p = [-1, 1] }", "p = [-1, 1] }\n[gains]\nK = 7"),
    "γ of the wrong kind": ("order = 1", "order = 1\nobserver = [3]"),
}


@pytest.mark.parametrize("name", PLANTS)
def test_certificate_bound_to_a_plant_for_which_it_is_not_made(lone: Base, name: str) -> None:
    old, new = PLANTS[name]
    plant = lone.plant.replace(old.encode(), new.encode())
    assert plant != lone.plant
    digest = hashlib.sha256(plant).hexdigest()
    assert _status(lone, lambda c: c["claim"].update(plant_sha256=digest), plant) in ("rejected", "malformed")


def test_what_rounds_away_is_decided_exactly(lone: Base, second: Base) -> None:
    """Changes by one part in 10^1000, where 128 bits would see none, go the right way."""
    little = Fraction(1, 10**1000)
    for base, key in ((lone, "psi"), (second, "psi")):
        entries = _agent(base.certificate, "claim")[key]
        for k in range(len(entries)):
            assert (
                _status(
                    base,
                    lambda c, k=k, key=key: _agent(c, "claim")[key].__setitem__(
                        k, _times(_agent(c, "claim")[key][k], 1 + little)
                    ),
                )
                == "rejected"
            )
    assert (
        _status(second, lambda c: c["witness"].update(exosystem={"Q": [["1", "0"], ["0", str(1 + little)]]}))
        == "rejected"
    )
    assert _status(lone, lambda c: c["witness"].update(optimum=[str(1 + little)] * 2)) == "rejected"


def test_large_gains_that_are_accepted_are_proved_again(lone: Base) -> None:
    """For a first-order agent any K and δ ≥ K ϑ_max above the thresholds hold, however large; the claim says which."""

    def enlarged(certificate: Json) -> None:
        claim = _agent(certificate, "claim")
        claim["K"], claim["delta"] = (_times(claim[key], Fraction(10) ** 900) for key in ("K", "delta"))

    certificate = copy.deepcopy(lone.certificate)
    enlarged(certificate)
    verdict = check(lone.plant, encode(certificate))
    assert verdict.status == "verified"
    assert why_not_proved(lone.plant, certificate) is None


def test_names_in_any_script_are_certified(lone: Base, tmp_path: Path) -> None:
    """The certificate is ASCII whatever the plant and the producer are called, and the digest is that of its claim."""
    plant = lone.plant.replace(b"one first-order agent", "Änderung ∞ 𝒙".encode())
    path = tmp_path / "plant.toml"
    path.write_bytes(plant)
    base = make_base(path)
    assert base is not None
    noted = {**base.certificate, "producer": {"ünïcode": "∞ 𝒙"}}
    verdict = check(plant, encode(noted))
    assert (verdict.status, verdict.claim_sha256) == ("verified", claim_digest(base.certificate))
    raw = json.dumps(noted, sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode() + b"\n"
    assert check(plant, raw).status == "malformed"


DEAR = {
    "many sines in many parameters": (
        'f = "p*x1"',
        "p*x1" + "".join(f" + 0*sin(q{k % 60}*x1 + {k})" for k in range(150)),
    ),
    "many logarithms": ('f = "p*x1"', "p*x1" + "".join(f" + 0*log(9 + q{k % 60}*x1)" for k in range(150))),
    "powers of sums": ('f = "p*x1"', "*".join(["p*x1", *(f"(1 + q{k}^2*x1^2)^64" for k in range(60))])),
    "a cost of many roots": ("(s - 1)^2/2", "s^2/2" + "".join(f" + sqrt({k} + s^2)/1000" for k in range(1, 200))),
    "a cost of many products": ("(s - 1)^2/2", "s^2/2 + " + "*".join(f"sin(s/{k})" for k in range(1, 25)) + "/10^9"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", DEAR)
def test_expressions_that_cost_much_end_within_the_budget(lone: Base, name: str) -> None:
    old, new = DEAR[name]
    boxes = ", ".join(f"q{k} = [-1, 1]" for k in range(60))
    new = f'f = "{new}"' if old.startswith("f") else new
    plant = lone.plant.replace(old.encode(), new.encode()).replace(b"p = [-1, 1]", f"p = [-1, 1], {boxes}".encode())
    digest = hashlib.sha256(plant).hexdigest()
    found = _status(lone, lambda c: c["claim"].update(plant_sha256=digest), plant)
    assert found == ("verified" if "sines" in name else "rejected")  # 0·sin is 0, and costs little to enclose
