"""The rule for direct/3: tiny certificates that hold, and beside them one that fails for every obligation."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Callable
from fractions import Fraction
from functools import cache

import direct_producer as producer
import pytest
from direct_producer import Json, Tiny

from certify.checker import Verdict, check

MAKERS = {
    "first": producer.first_order,
    "saturated": producer.saturated,
    "slow": producer.slow,
    "second": producer.second_order,
    "measured": producer.measured,
    "third": producer.third_order,
    "exosystem": producer.with_exosystem,
}
Change = Callable[[Json], object]


@cache
def tiny(name: str) -> tuple[Tiny, Json]:
    return MAKERS[name](), producer.produce(MAKERS[name]())


def judge(name: str, change: Change, plant: tuple[str, str] | None = None) -> Verdict:
    """The verdict on a changed certificate; ``change`` gets the agent's witness, ``plant`` is (old, new) text."""
    example, certificate = tiny(name)
    certificate, toml = copy.deepcopy(certificate), example.toml
    if plant:
        assert toml.decode().count(plant[0]) == 1
        toml = toml.decode().replace(*plant).encode()
        certificate["claim"]["plant_sha256"] = hashlib.sha256(toml).hexdigest()
    change(certificate)
    return check(toml, producer.encode(certificate))


def agent(certificate: Json) -> Json:
    entry: Json = certificate["witness"]["agents"][0]
    return entry


def put(key: str, value: object) -> Change:
    """Sets one field of the agent's witness; ``a.b`` is a field of a table in it."""

    def change(certificate: Json) -> None:
        *path, last = key.split(".")
        table = agent(certificate)
        for name in path:
            table = table[name]
        assert last in table
        table[last] = value

    return change


def scale(key: str, factor: Fraction | int, *index: int) -> Change:
    """Multiplies one number of the agent's witness, or all of them under the index."""

    def scaled(value: object) -> object:
        return [scaled(entry) for entry in value] if isinstance(value, list) else str(Fraction(str(value)) * factor)

    def change(certificate: Json) -> None:
        table, *path = agent(certificate), *key.split("."), *index
        for step in path[:-1]:
            table = table[step]
        table[path[-1]] = scaled(table[path[-1]])

    return change


def claim(key: str, value: object) -> Change:
    def change(certificate: Json) -> None:
        certificate["claim"]["agents"][0][key] = value

    return change


def nothing(certificate: Json) -> None:
    pass


@pytest.mark.parametrize("name", MAKERS)
def test_a_true_certificate_is_verified(name: str) -> None:
    verdict = judge(name, nothing)
    assert (verdict.status, verdict.detail) == ("verified", "")
    assert len(verdict.claim_sha256) == 64


def test_wider_boxes_and_a_smaller_set_are_verified_too() -> None:
    assert judge("second", scale("tail.box", Fraction(11, 10))).status == "verified"
    assert judge("second", nothing, ('x = ["-1/4", "1/4"]', 'x = ["-1/8", "1/8"]')).status == "verified"
    assert judge("first", nothing, ("p = [-0.1, 0.1]", "p = [-0.05, 0.1]")).status == "verified"


HALF, THOUSANDTH, SHORT = Fraction(1, 2), Fraction(1, 1000), Fraction(99, 100)


def drop_first_phase(certificate: Json) -> None:
    """As if the saturation were inactive from the start."""
    put("phase1", {"grid": ["0"], "boxes": [], "vartheta": []})(certificate)
    agent(certificate)["grid"][0] = "0"


@pytest.mark.parametrize(
    ("name", "change", "obligation"),
    [
        ("first", put("rates", ["0"]), "0 < μ_1"),
        ("first", put("rates", ["-1"]), "0 < μ_1"),
        ("second", lambda c: agent(c)["rates"].reverse(), "0 < μ_1"),
        ("second", lambda c: agent(c)["rates"].__setitem__(1, agent(c)["rates"][0]), "0 < μ_1"),
        ("second", scale("kernels", -1, 0, 0, 0), "kernels: |(C e^(At) J)_ij|"),
        ("first", scale("kernels", -1), "kernels: |(C e^(At) J)_ij|"),
        ("second", scale("modes", 0, 1), "H is nonsingular"),
        ("second", lambda c: agent(c)["modes"].__setitem__(0, agent(c)["modes"][1]), "H is nonsingular"),
        ("second", scale("modes", Fraction(101, 100), 0, 0), "kernels"),
        ("first", scale("rates", Fraction(9, 8), 0), "kernels: μ_1 < σ − ε"),
        ("second", scale("rates", 3, 0), "kernels"),
        ("first", put("nominal.b", "-1"), "nominal b > 0"),
        ("first", put("nominal.b", "0"), "nominal b > 0"),
        ("first", put("nominal.b", "11/10"), "tube: step"),
        ("exosystem", put("nominal.f0", [["1", "1"]]), "kernels: μ_1 < σ − ε"),
        ("second", put("nominal.f1", ["0", "1"]), "kernels"),
        ("second", claim("K", "9"), "kernels"),
        ("second", claim("K", "-8"), "g, K, δ > 0"),
        ("second", claim("g", "-1/2"), "g, K, δ > 0"),
        ("second", claim("g", "2"), "kernels"),
        ("second", claim("h", "-1/2"), "h > 0"),
        ("second", claim("h", "257"), "kernels"),
        ("second", claim("delta", "0"), "g, K, δ > 0"),
        ("second", claim("delta", "1"), "phase 1: step 11: ϑ^+"),
        ("second", claim("delta", "60"), "phase 1: step 1: ϑ^+"),
        ("first", claim("delta", "1"), "tube: step 1: K B_ϑ ≤ δ"),
        ("second", claim("observer", ["2", "4"]), "kernels"),
        ("third", claim("gamma", ["-1", "2"]), "γ ≥ 0"),
        ("second", claim("gamma", ["2"]), "kernels"),
        ("exosystem", claim("psi", ["1", "4"]), "kernels"),
        ("exosystem", put("ell", ["-1", "1"]), "A5"),
        ("exosystem", put("steady_state", ["s + (v1 + v2)/2"]), "A3"),
        ("second", lambda c: agent(c)["phase1"]["grid"].__setitem__(0, "-1"), "phase 1: 0 = t_0 < t_1"),
        ("second", lambda c: agent(c)["phase1"]["grid"].__setitem__(0, "1/1000"), "phase 1: 0 = t_0 < t_1"),
        ("second", lambda c: agent(c)["phase1"]["grid"].__setitem__(3, agent(c)["phase1"]["grid"][2]), "0 = t_0 < t_1"),
        ("measured", put("phase1.grid", ["1"]), "phase 1: 0 = t_0 < t_1"),
        ("second", lambda c: agent(c)["phase1"]["grid"].__setitem__(-1, "1/10"), "t_0 = T1"),
        ("second", lambda c: agent(c)["grid"].__setitem__(0, "0"), "t_0 = T1"),
        ("first", lambda c: agent(c)["grid"].__setitem__(0, "-1"), "t_0 = T1"),
        ("second", scale("phase1.boxes", -1, 5, 1), "boxes ≥ 0"),
        ("second", scale("phase1.vartheta", -1, 5), "boxes ≥ 0"),
        ("second", scale("phase1.vartheta", SHORT, 0), "phase 1: step 1: ϑ^+ − ϑ ≥ Δ (P − b sat(K (ϑ − ε)))"),
        ("saturated", scale("phase1.vartheta", SHORT, 15), "phase 1: step 16: ϑ^+ − ϑ ≥ Δ (P − b sat(K (ϑ − ε)))"),
        ("third", scale("phase1.vartheta", SHORT, 30), "phase 1: step 31: ϑ^+ − ϑ ≥ Δ (P − b sat(K (ϑ − ε)))"),
        ("saturated", scale("phase1.vartheta", Fraction(101, 100), 3), "phase 1: step 5: ϑ^+"),
        ("exosystem", scale("phase1.boxes", SHORT, 0, 0), "phase 1: step 1: B_z ≥ z^+: i = 1"),
        ("second", scale("phase1.boxes", SHORT, 7, 0), "phase 1: step 8: B_x ≥ x^+: i = 1"),
        ("second", scale("phase1.boxes", SHORT, 7, 1), "phase 1: step 8: B_x ≥ x^+: i = 2"),
        ("third", scale("phase1.boxes", SHORT, 7, 0), "phase 1: step 8: B_x ≥ x^+: i = 1"),
        ("third", scale("phase1.boxes", SHORT, 7, 1), "phase 1: step 8: B_x ≥ x^+: i = 2"),
        ("third", scale("phase1.boxes", SHORT, 7, 2), "phase 1: step 8: B_x ≥ x^+: i = 3"),
        ("saturated", scale("phase1.boxes", SHORT, 3, 0), "phase 1: step 4: B_x ≥ x^+: i = 1"),
        ("saturated", scale("phase1.boxes", SHORT, 3, 1), "phase 1: step 4: B_ϑ ≥ ϑ, ϑ^+"),
        ("third", scale("phase1.boxes", SHORT, 2, 3), "phase 1: step 3: B_ϑ ≥ ϑ, ϑ^+"),
        ("exosystem", scale("phase1.boxes", SHORT, 4, 3), "phase 1: step 5: B_ζ ≥ ζ^+: i = 1"),
        ("exosystem", scale("phase1.boxes", SHORT, 4, 4), "phase 1: step 5: B_ζ ≥ ζ^+: i = 2"),
        ("third", scale("phase1.boxes", 1000, 4), "phase 1: step 5"),
        ("third", claim("delta", "10"), "tube: step 1: K B_ϑ ≤ δ"),
        ("second", drop_first_phase, "tube: step 1"),
        ("exosystem", put("ranges", [[["1", "-1"]]]), "ranges: lo ≤ hi"),
        ("exosystem", scale("ranges", SHORT, 3, 0, 1), "ranges: step 4: R_1^hi outruns z_1"),
        ("exosystem", scale("ranges", SHORT, 3, 0, 0), "ranges: step 4: R_1^lo outruns z_1"),
        ("exosystem", scale("ranges", SHORT, 29, 0, 1), "ranges: step 30: R_1^hi outruns z_1"),
        ("exosystem", scale("ranges", HALF, 29, 0, 0), "ranges: step 30: R_1^lo outruns z_1"),
        ("exosystem", put("ranges", [[["99", "100"]]]), "ranges: step 1: R_1^lo outruns z_1"),
        ("first", lambda c: agent(c)["grid"].__setitem__(3, agent(c)["grid"][2]), "t_0 < t_1"),
        ("first", lambda c: agent(c)["grid"].__setitem__(3, "0"), "t_0 < t_1"),
        (
            "first",
            lambda c: (
                agent(c)["grid"].pop(),
                agent(c)["grid"].pop(),
                agent(c)["grid"].__setitem__(-1, "19"),
                agent(c)["boxes"].pop(),
                agent(c)["boxes"].pop(),
            ),
            "t_m ≥ T0",
        ),
        ("first", lambda c: (put("grid", ["0"])(c), put("boxes", [])(c)), "t_m ≥ T0"),
        (
            "first",
            lambda c: (put("grid", ["0", "21"])(c), put("boxes", agent(c)["boxes"][:1])(c)),
            "tail: Σ_a p_ia ≤ B_i",
        ),
        ("second", scale("boxes", Fraction(9, 10), 0, 0), "tube: step 1: Σ_a p_ia ≤ B_i"),
        ("second", scale("boxes", HALF, 20, 1), "tube: step 21: Σ_a p_ia ≤ B_i"),
        ("exosystem", scale("boxes", HALF, 4, 0), "tube: step 5: Σ_a p_ia ≤ B_i"),
        ("second", scale("boxes", 100, 7), "tube: step 8"),
        ("first", scale("boxes", -1, 7, 0), "boxes ≥ 0"),
        ("first", scale("tail.box", -1, 0), "boxes ≥ 0"),
        ("first", scale("tail.box", THOUSANDTH, 0), "tail: Σ_a p_ia ≤ B_i"),
        ("second", scale("tail.box", 10**6), "tail"),
        ("exosystem", scale("tail.box", THOUSANDTH, 3), "tail: Σ_a p_ia ≤ B_i"),
        ("first", put("tail.rate", "0"), "tail: 0 < ρ ≤ λ'"),
        ("first", put("tail.rate", "-1"), "tail: 0 < ρ ≤ λ'"),
        ("first", put("tail.rate", "251/1000"), "tail: 0 < ρ ≤ λ'"),
        ("slow", lambda c: put("tail.rate", agent(c)["rates"][0])(c), "tail: ρ < μ_1"),
    ],
)
def test_what_does_not_hold_is_rejected(name: str, change: Change, obligation: str) -> None:
    verdict = judge(name, change)
    assert verdict.status == "rejected"
    assert obligation in f"{verdict.obligation}: {verdict.detail}"


@pytest.mark.parametrize(
    ("name", "plant", "obligation"),
    [
        ("first", ("p = [-0.1, 0.1]", "p = [-9, 9]"), "tube: step 1"),
        ("first", ("q = [-0.1, 0.1]", "q = [-0.9, 0.1]"), "tube: step 1"),
        ("first", ("q = [-0.1, 0.1]", "q = [-1, 0.1]"), "A0: b > 0"),
        ("first", ("x1^3/10", "x1^3"), "tube: step 1"),
        ("first", ("x1^3/10", "x1^3/10 + x1/(1 + x1)"), "tube: step 1"),
        ("first", ('x = ["-1", "1"]', 'x = ["-2", "1"]'), "tube: step 1"),
        ("first", ('reference = ["-1/2", "1/2"]', 'reference = ["-1/2", 1]'), "tube: step 1"),
        ("second", ("p = [-0.1, 0.1]", "p = [-4, 4]"), "phase 1: step 1: ϑ^+"),
        ("second", ("observer = 0", "observer = 1000000"), "phase 1: step 7: ϑ^+"),
        ("second", ("x1*x2/10", "x1*x2^2*1000000"), "phase 1: step"),
        ("measured", ('observer = "measured"', "observer = 0"), "tube: step 1"),
        ("exosystem", ("v2 = 1", "v2 = 30"), "phase 1: step 1: the enclosures"),
        ("exosystem", ("z1*x1/10", "z1*x1*4"), "phase 1: step 1: ϑ^+"),
        ("exosystem", ("eta = 0", "eta = [-9, 9]"), "phase 1: step 1: B_ζ ≥ ζ^+"),
        ("exosystem", ("z = [-1, 1]", "z = [-30, 1]"), "ranges: step 1: R_1^lo outruns z_1"),
    ],
)
def test_the_same_certificate_for_a_harder_plant_is_rejected(
    name: str, plant: tuple[str, str], obligation: str
) -> None:
    verdict = judge(name, nothing, plant)
    assert verdict.status == "rejected"
    assert obligation in f"{verdict.obligation}: {verdict.detail}"


def more(key: str, value: object) -> Change:
    return lambda certificate: agent(certificate).__setitem__(key, value)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("first", more("note", "1")),
        ("first", lambda c: agent(c).pop("blocks")),
        ("first", lambda c: agent(c)["tail"].pop("rate")),
        ("first", lambda c: agent(c)["nominal"].__setitem__("f2", [])),
        ("second", lambda c: agent(c)["phase1"].pop("vartheta")),
        ("first", lambda c: c.__setitem__("theorem", "direct/1")),
        ("first", lambda c: c.__setitem__("theorem", "recipe/2")),
        ("first", lambda c: c.__setitem__("theorem", ["direct/3"])),
        ("second", put("phase1", None)),
        ("second", put("phase1.grid", [])),
        ("second", put("phase1.grid", [str(k) for k in range(502)])),
        ("second", put("phase1.boxes", [["1"] * 3] * 501)),
        ("second", lambda c: agent(c)["phase1"]["grid"].pop()),
        ("second", lambda c: agent(c)["phase1"]["boxes"].pop()),
        ("second", lambda c: agent(c)["phase1"]["boxes"][3].pop()),
        ("second", lambda c: [box.pop() for box in agent(c)["phase1"]["boxes"]]),
        ("second", lambda c: agent(c)["phase1"]["vartheta"].pop()),
        ("first", put("ranges", [[]])),
        ("first", put("ranges", [[["-1", "1"]]])),
        ("exosystem", put("ranges", [[["-1", "0", "1"]]])),
        ("exosystem", put("ranges", [[["-1"]]])),
        ("exosystem", put("ranges", [[]])),
        ("exosystem", put("ranges", [[["-1", "1"], ["-1", "1"]]])),
        ("exosystem", put("ranges", [[["-99", "99"]]] * 1000)),
        ("exosystem", put("ranges", [[["-99", "99"]]] * 5501)),
        ("first", put("blocks", [])),
        ("first", put("blocks", ["2"])),
        ("first", put("blocks", ["1", "1"])),
        ("second", put("blocks", ["3", "1"])),
        ("second", put("blocks", ["0", "2", "2"])),
        ("first", put("modes", [])),
        ("first", put("modes", [["1", "0"]])),
        ("first", put("modes", [["1", "0"], ["0", "1"]])),
        ("second", put("modes", [["1"] * 4, ["1"] * 3])),
        ("first", put("modes", [["1"] * 65] * 65)),
        ("first", put("rates", [])),
        ("first", put("rates", [str(k) for k in range(1, 18)])),
        ("first", put("kernels", [])),
        ("first", lambda c: agent(c)["kernels"].pop()),
        ("first", lambda c: agent(c)["kernels"][0].pop()),
        ("first", lambda c: agent(c)["kernels"][0][0].pop()),
        ("first", lambda c: agent(c)["kernels"][0][0].append("0")),
        ("first", put("nominal.f0", [["0", "0"]])),
        ("first", put("nominal.f1", [])),
        ("exosystem", put("nominal.f0", [["-1"]])),
        ("exosystem", put("nominal.f0", [])),
        ("first", put("nominal.b", 1)),
        ("first", put("grid", [])),
        ("first", lambda c: agent(c)["grid"].pop()),
        ("first", lambda c: agent(c)["boxes"].pop()),
        ("first", lambda c: agent(c)["boxes"][3].pop()),
        ("first", put("boxes", [["1"] * 3] * 5001)),
        ("first", put("grid", [str(k) for k in range(5002)])),
        ("first", put("tail.box", ["1"])),
        ("first", put("tail.box", ["1"] * 4)),
        ("first", put("tail.rate", "2/10")),
        ("exosystem", put("ell", ["-1"])),
        ("exosystem", put("steady_state", [])),
        ("exosystem", put("steady_state", ["0", "0"])),
        ("exosystem", claim("M", [["0", "1"]])),
        ("second", claim("gamma", [])),
        ("second", claim("h", None)),
    ],
)
def test_what_is_no_certificate_is_malformed(name: str, change: Change) -> None:
    assert judge(name, change).status == "malformed"


def test_a_rejection_names_agent_step_output_and_numbers() -> None:
    verdict = judge("second", scale("boxes", HALF, 20, 1))
    assert verdict.obligation == "agent 1: tube: step 21: Σ_a p_ia ≤ B_i"
    assert verdict.detail.startswith("output = 2, left = ")
    verdict = judge("second", scale("kernels", HALF, 1, 3))
    assert verdict.obligation.startswith("agent 1: kernels: |(C e^(At) J)_ij| ≤")
    assert verdict.detail.startswith("i = 2, j = 4, from_t = ")


def test_too_much_work_is_rejected() -> None:
    example, certificate = tiny("second")
    verdict = check(example.toml, producer.encode(certificate), steps=1000)
    assert (verdict.status, "more work" in verdict.detail) == ("rejected", True)
