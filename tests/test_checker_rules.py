"""Every obligation of docs/certificate.md accepts a certificate that meets it and rejects, by its name, others."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from copy import deepcopy
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from certify.checker import Verdict, check
from certify.checker.rules import agent_recipe

CORPUS = Path(__file__).parent / "checker_corpus"
Json = Any
Change = Callable[[Json], object]


def load(name: str) -> tuple[str, Json]:
    return (CORPUS / f"{name}.toml").read_text(), json.loads((CORPUS / f"{name}.json").read_bytes())


def encode(certificate: Json) -> bytes:
    return (json.dumps(certificate, sort_keys=True, separators=(",", ":")) + "\n").encode()


def judge(plant: str, certificate: Json, bind: bool = True) -> Verdict:
    """The verdict; ``bind`` writes the plant's digest into the certificate, as a forger would."""
    certificate = deepcopy(certificate)
    if bind:
        certificate["claim"]["plant_sha256"] = hashlib.sha256(plant.encode()).hexdigest()
    return check(plant.encode(), encode(certificate))


def rejected(verdict: Verdict, obligation: str) -> None:
    assert verdict.status == "rejected", verdict
    assert obligation in verdict.obligation, verdict


def changed(certificate: Json, path: str, value: Json) -> Json:
    """A copy with the value at a path such as ``claim.agents.0.K``; a callable value gets the number that is there."""
    copy = deepcopy(certificate)
    *steps, last = (int(step) if step.isdigit() else step for step in path.split("."))
    place = copy
    for step in steps:
        place = place[step]
    place[last] = str(value(Fraction(place[last]))) if callable(value) else value
    return copy


@pytest.mark.parametrize("name", sorted(path.stem for path in CORPUS.glob("*.toml")))
def test_the_corpus_is_verified(name: str) -> None:
    plant, certificate = load(name)
    verdict = judge(plant, certificate, bind=False)
    claim = json.dumps(certificate["claim"], sort_keys=True, separators=(",", ":"))
    assert verdict == Verdict("verified", claim_sha256=hashlib.sha256(claim.encode()).hexdigest())


def test_slacker_witnesses_prove_the_same_claim() -> None:
    plant, certificate = load("mixed")
    for path, value in [
        ("witness.agents.0.a0", lambda a0: a0 * Fraction(99, 100)),
        ("witness.coordinator.rate", lambda rate: rate * Fraction(99, 100)),
        ("witness.coordinator.mixing_rate", lambda rate: rate * Fraction(99, 100)),
    ]:
        assert judge(plant, changed(certificate, path, value)).status == "verified", path


WITNESS_CHANGES: list[tuple[str, Json, str]] = [
    ("witness.optimum", ["1", "2"], "optimum: Σc'(lo) ≤ 0 ≤ Σc'(hi)"),
    ("witness.optimum", ["-1", "0"], "optimum: Σc'(lo) ≤ 0 ≤ Σc'(hi)"),
    ("witness.optimum", ["1", "0"], "optimum: lo ≤ hi"),
    ("witness.exosystem.Q", [["1", "0"], ["0", "2"]], "A4: SᵀQ + QS = 0"),
    ("witness.exosystem.Q", [["-1", "0"], ["0", "-1"]], "A4: Q ≻ 0"),
    ("witness.exosystem.Q", [["0", "0"], ["0", "0"]], "A4: Q ≻ 0"),
    ("witness.exosystem.Q", [["1", "1"], ["-1", "1"]], "A4: Q ≻ 0"),
    ("witness.coordinator.step", "1", "mixing: Δ > 0, ‖LΔ‖ ≤ 1"),
    ("witness.coordinator.step", "-1/64", "mixing: Δ > 0, ‖LΔ‖ ≤ 1"),
    ("witness.coordinator.step", "0", "mixing: Δ > 0, ‖LΔ‖ ≤ 1"),
    ("witness.coordinator.steps", "1", "coordinator: Lyapunov inequality"),
    ("witness.coordinator.mixing_rate", "3", "mixing: Rm βL + βLᵀRm ⪰ 2λ̂(Rm − r rᵀ)"),
    ("witness.coordinator.mixing_rate", "0", "coordinator: λ0, λ̂ > 0"),
    ("witness.coordinator.rate", "-1", "coordinator: λ0, λ̂ > 0"),
    ("witness.coordinator.rate", "3", "coordinator: Lyapunov inequality"),
    ("witness.coordinator.multiplier.0", "-1", "coordinator: multiplier ≥ 0"),
    ("witness.coordinator.multiplier", ["0", "0"], "coordinator: Lyapunov inequality"),
    ("witness.coordinator.P.0.0", lambda p: -p, "coordinator: P ≻ 0"),
    ("witness.coordinator.P.0.1", lambda p: 2 * p, "coordinator: P ≻ 0"),
    ("witness.agents.0.steady_state.0", "s/(2*w1)", "agent 1: A3: ∂z*/∂v·S v = f0(z*, s, v, w)"),
    (
        "witness.agents.0.steady_state.0",
        "s/(2*w1) + v1*w1/(4*w1**2 + 4) - v2/(4*w1**2 + 4) + 1",
        "agent 1: A3: z*(0, 0, w) = 0",
    ),
    ("witness.agents.0.steady_state.0", "s/(2*w1) + v1/(4*w1 - 6)", "agent 1: A3"),
    ("witness.agents.0.ell", ["0", "-4", "0"], "agent 1: A5: L_S^s u* = Σ ℓ_k L_S^(k−1) u*"),
    ("witness.agents.0.V0", [["0"]], "agent 1: V0 ≻ 0"),
    ("witness.agents.0.P1", [["1/3"]], "agent 1: A_cᵀP1 + P1 A_c ⪯ −I"),
    ("witness.agents.0.P1", [["-1/2"]], "agent 1: P1 ≻ 0"),
    ("witness.agents.0.P2", [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "1"]], "agent 1: MᵀP2 + P2 M ⪯ −I"),
    ("witness.agents.0.P2.0.0", "-1", "agent 1: P2 ≻ 0"),
    ("witness.agents.0.P3", [["1/2", "-1/2"], ["-1/2", "1"]], "agent 1: E3ᵀP3 + P3 E3 ⪯ −I"),
    ("witness.agents.0.P3.0.1", "0", "agent 1: P3 ≻ 0"),
    ("witness.agents.0.a0", "0", "agent 1: a0 > 0"),
    ("witness.agents.0.a0", "101/100", "agent 1: A6: V0 J + JᵀV0 ⪯ −a0 I"),
    ("witness.agents.0.slack", "0", "agent 1: slack > 0"),
    ("witness.agents.0.slack", "1/1000000", "agent 1: h2: e^(−hT/(2λ_M)) We(0) ≤ ϵ/4"),
    ("witness.agents.0.slack", "1/1000000000000000000000000", "agent 1: h1: 4 λ_M p3² X2²/h² ≤ ϵ/4"),
    ("witness.agents.0.level", "-1", "agent 1: level > 0"),
    ("witness.agents.0.weight_eta", "0", "agent 1: weight_eta > 0"),
    ("witness.agents.0.weight_theta", "-1", "agent 1: weight_theta > 0"),
    ("witness.agents.0.weight_eta", "1/1000000", "agent 1: a_z > 0"),
    ("witness.agents.1.weight_theta", "4", "agent 2: a_eta > 0"),
    ("witness.agents.0.level", lambda level: level / 100, "agent 1: w0 + ς10 I_y + ς11 I_d ≤ c"),
    ("witness.agents.1.level", lambda level: level / 100, "agent 2: w0 + ς10 I_y + ς11 I_d ≤ c"),
]

CLAIM_CHANGES: list[tuple[str, Json, str]] = [
    ("claim.alpha1", "-1", "coordinator: α1, α2, κ, β > 0"),
    ("claim.alpha2", "0", "coordinator: α1, α2, κ, β > 0"),
    ("claim.alpha1", "1/10", "coordinator: Lyapunov inequality"),
    ("claim.alpha2", "50", "coordinator: Lyapunov inequality"),
    ("claim.agents.0.psi.0", "7", "agent 1: A5: TΦ − MT = NΓ, Ψ = ΓT⁻¹"),
    ("claim.agents.0.N", ["0", "0", "2"], "agent 1: A5: TΦ − MT = NΓ, Ψ = ΓT⁻¹"),
    ("claim.agents.0.M.2.2", "6", "agent 1: MᵀP2 + P2 M ⪯ −I"),
    ("claim.agents.0.psi", ["0", "0", "0"], "agent 1: A5"),
    ("claim.agents.0.gamma", ["1/2"], "agent 1: A_cᵀP1 + P1 A_c ⪯ −I"),
    ("claim.agents.0.gamma", ["-1"], "agent 1: A_cᵀP1 + P1 A_c ⪯ −I"),
    ("claim.agents.0.observer", ["1", "1"], "agent 1: E3ᵀP3 + P3 E3 ⪯ −I"),
    ("claim.agents.0.observer", ["2", "1"], "agent 1: E3ᵀP3 + P3 E3 ⪯ −I"),
    ("claim.agents.0.g", "1/2", "agent 1: g ≥ 1, K > 0, δ > 0"),
    ("claim.agents.0.K", "-1", "agent 1: g ≥ 1, K > 0, δ > 0"),
    ("claim.agents.0.delta", "0", "agent 1: g ≥ 1, K > 0, δ > 0"),
    ("claim.agents.0.g", "2", "agent 1: a_x > 0"),
    ("claim.agents.0.K", "10", "agent 1: a_theta > 0"),
    ("claim.agents.1.K", "10", "agent 2: a_theta > 0"),
    ("claim.agents.0.delta", lambda delta: delta * Fraction(99, 100), "agent 1: δ ≥ K (ϑ_max + √(½ ϵ E2 P3⁻¹ E2ᵀ))"),
    ("claim.agents.1.delta", lambda delta: delta * Fraction(99, 100), "agent 2: δ ≥ K ϑ_max"),
    ("claim.agents.0.delta", lambda delta: delta * 10**6, "agent 1: h1: 4 λ_M p3² X2²/h² ≤ ϵ/4"),
    ("claim.agents.0.h", "2", "agent 1: h ≥ g"),
    ("claim.agents.0.h", "1000", "agent 1: h1: 4 λ_M p3² X2²/h² ≤ ϵ/4"),
    ("claim.agents.0.h", lambda h: h * Fraction(1, 20), "agent 1: h3: a_theta exceeds what ẋ_n costs"),
    ("claim.plant_sha256", "0" * 64, "plant_sha256"),
]


@pytest.mark.parametrize(("path", "value", "obligation"), WITNESS_CHANGES + CLAIM_CHANGES)
def test_each_obligation_rejects(path: str, value: Json, obligation: str) -> None:
    plant, certificate = load("mixed")
    rejected(judge(plant, changed(certificate, path, value), bind=False), obligation)


PLANT_CHANGES: list[tuple[str, str, str]] = [
    ('edges  = ["1 -> 2", ["2 -> 1", "3/2"]]', 'edges  = ["1 -> 2"]', "A2: strongly connected"),
    ('["2 -> 1", "3/2"]', '["2 -> 1", "1/100"]', "A2: rᵀL = 0"),
    ("[[0, 1], [-1, 0]]", '[[0, 1], [-1, "-1/1000000000000000000"]]', "A4: SᵀQ + QS = 0"),
    ("[[0, 1], [-1, 0]]", "[[0, 1], [0, 0]]", "A4: SᵀQ + QS = 0"),
    ("[[0, 1], [-1, 0]]", '[[0, "sqrt(2)"], ["-sqrt(2)", 0]]', "A4: S is rational"),
    ("[[0, 1], [-1, 0]]", "[[0, 2], [-2, 0]]", "agent 1: A3: ∂z*/∂v·S v = f0(z*, s, v, w)"),
    ('cost          = "(s - 1)^2/2"', 'cost = "s^4"', "agent 1: A1"),
    ('cost          = "(s - 1)^2/2"', 'cost = "0 - (s - 1)^2/2"', "agent 1: A1"),
    ('cost          = "(s - 1)^2/2"', 'cost = "s"', "agent 1: A1"),
    ('cost          = "(s - 1)^2/2"', 'cost = "log(1 + exp(s))"', "agent 1: A1"),
    ('cost          = "(s - 1)^2/2"', 'cost = "s^2 + sin(s^2)/1000"', "agent 1: A1"),
    ('cost          = "(s - 1)^2/2"', 'cost = "exp(s) + exp(-s)"', "agent 1: A1"),
    ('cost          = "(s - 1)^2/2"', 'cost = "s^2 - sqrt(s)"', "agent 1: A1"),
    ('cost          = "(s - 1)^2/2"', 'cost = "(s - 1)^2/2 + 0*log(s)"', "agent 1: A1"),
    ('cost          = "(s - 1)^2/2"', 'cost = "(s - 1)^2/2 + 0/s"', "agent 1: A1"),
    ('cost          = "(s - 1)^2/2"', 'cost = "(s - 2)^2/2"', "optimum: Σc'(lo) ≤ 0 ≤ Σc'(hi)"),
    ('cost          = "(s - 1)^2/2"', 'cost = "50*(s - 1)^2"', "optimum: Σc'(lo) ≤ 0 ≤ Σc'(hi)"),
    ('"z1*x1/4 + w1*x2 + sin(x1) + v1"', '"z1*x1/4 + w1*x2 + cos(x1) + v1"', "agent 1: A0: f(0, 0, 0, w) = 0"),
    ('"-w1*z1 + x1/2 + v1/4"', '"-w1*z1 + x1/2 + v1/4 + 1/1000"', "agent 1: A0: f(0, 0, 0, w) = 0"),
    ('"1 + w1/10"', '"w1 - 1"', "agent 1: A0: b > 0"),
    ('"1 + w1/10"', '"0 - 1 - w1/10"', "agent 1: A0: b > 0"),
    ('"1 + w1/10"', '"1/(w1 - 3/2)"', "agent 1: A0"),
    ('"1 + w1/10"', '"100 + w1/10"', "agent 1: a_eta > 0"),
    ('"-w1*z1 + x1/2 + v1/4"', '"-2*w1*z1 + x1/2 + v1/4"', "agent 1: A3"),
    ('"w1*x1 + v2"', '"w1*x1 + v2 + v2^2 - v2^2*exp(v2)*exp(-v2)"', "agent 2: A5"),
    ('"w1*x1 + v2"', '"w1*x1 + v2^2"', "agent 2: A5: L_S^s u* = Σ ℓ_k L_S^(k−1) u*"),
    ('"w1*x1 + v2"', '"w1*x1 + sin(v2)"', "agent 2: A5: L_S^s u* = Σ ℓ_k L_S^(k−1) u*"),
    ("uncertain     = { w1 = [1, 2] }", 'uncertain     = { w1 = ["99/100", 2] }', "agent 1: A6: V0 J + JᵀV0 ⪯ −a0 I"),
    ("uncertain     = { w1 = [1, 2] }", "uncertain     = { w1 = [0, 2] }", "agent 1: A3: z* is smooth"),
    ("uncertain = { w1 = [-1, 1] }", "uncertain = { w1 = [-1000, 1000] }", "agent 2: a_theta > 0"),
    ('box       = ["-1/2", "1/2"]', "box       = [-100, 100]", "agent 1: w0 + ς10 I_y + ς11 I_d ≤ c"),
    ("reference = 0", "reference = [-100, 100]", "agent 1: w0 + ς10 I_y + ς11 I_d ≤ c"),
    ("eta       = 0", "eta       = 10000", "agent 1: w0 + ς10 I_y + ς11 I_d ≤ c"),
    ('v1 = [0, "1/2"]', "v1 = [0, 100000]", "agent 1: a_x > 0"),
    ('f         = "w1*x1 + v2"', 'f         = "w1*x1 + v2 + 1/(1 + x1/2) - 1 - 0*x1"', "agent 2"),
]


@pytest.mark.parametrize(("old", "new", "obligation"), PLANT_CHANGES)
def test_a_certificate_for_another_plant_is_rejected(old: str, new: str, obligation: str) -> None:
    plant, certificate = load("mixed")
    assert plant.count(old) == 1
    rejected(judge(plant.replace(old, new), certificate, bind=False), "plant_sha256")
    rejected(judge(plant.replace(old, new), certificate), obligation)


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ("[gains]\nK = 12345\n", "K"),
        ("[gains]\nh = 12345\n", "h"),
        ("[gains]\ng = 3\n", "g"),
        ("[gains]\ndelta = 3\n", "delta"),
        ("alpha1 = 4\n", "alpha1"),
        ("alpha2 = 4\n", "alpha2"),
        ("gradient_gain = 2\n", "gradient_gain"),
        ("mixing_gain = 2\n", "mixing_gain"),
        ("softening = 2\n", "softening"),
    ],
)
def test_what_the_plant_file_fixes_must_be_claimed(table: str, key: str) -> None:
    plant, certificate = load("mixed")  # whose last table is [coordinator]
    rejected(judge(plant + table, certificate), f"{key} is fixed by the plant file")


@pytest.mark.parametrize(
    "line",
    [
        "gamma = [2]",
        "observer = [1, 3]",
        "internal_model = { M = [[-1, 0, 0], [0, -2, 0], [0, 0, -3]], N = [1, 1, 1] }",
    ],
)
def test_a_design_that_the_plant_file_fixes_must_be_claimed(line: str) -> None:
    plant, certificate = load("mixed")
    other = plant.replace("order         = 2\n", f"order         = 2\n{line}\n")
    rejected(judge(other, certificate), "fixed by the plant file")


def test_what_the_plant_file_fixes_and_the_claim_repeats_is_accepted() -> None:
    plant, certificate = load("mixed")
    other = plant.replace("order         = 2\n", "order         = 2\ngamma = [1]\nobserver = [1, 2]\n") + "alpha1 = 5\n"
    assert judge(other, certificate).status == "verified"


def test_the_saturation_lets_the_observer_start_anywhere_near() -> None:
    plant, certificate = load("mixed")
    assert judge(plant.replace("observer  = 0", 'observer  = "1e300"'), certificate).status == "verified"


def test_a_gain_barely_above_its_threshold_leaves_nothing_for_the_observer() -> None:
    plant, certificate = load("mixed")
    path, weight = "claim.agents.0.K", Fraction(certificate["witness"]["agents"][0]["weight_theta"])
    verdict = judge(plant, changed(certificate, path, "10"))
    value = float(
        verdict.detail.removeprefix("value = [").split(",")[0]
    )  # a_theta = (b_min K − 1)/weight − …, b_min = 11/10
    threshold = 10 - Fraction(value) * weight * Fraction(10, 11)
    rejected(judge(plant, changed(certificate, path, str(threshold * Fraction(9999, 10000)))), "agent 1: a_theta > 0")
    rejected(judge(plant, changed(certificate, path, str(threshold * Fraction(10001, 10000)))), "agent 1: h3: a_theta")


def test_the_last_phase_rejects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every inequality of (h3), with a block that dissipates less than it does, or a stronger drift."""
    plant, certificate = load("mixed")
    monkeypatch.setattr(agent_recipe, "CUTS", 0)
    original = agent_recipe._Recipe.state_feedback

    def harsher(field: str, factor: int) -> None:
        def state_feedback(rule: agent_recipe._Recipe) -> None:
            original(rule)
            setattr(rule, field, getattr(rule, field) * factor)

        monkeypatch.setattr(agent_recipe._Recipe, "state_feedback", state_feedback)

    for field, factor, obligation in [
        ("a_z", Fraction(1, 10**16), "h3: a_z exceeds"),
        ("a_x", Fraction(1, 10**16), "h3: a_x exceeds"),
        ("a_eta", Fraction(1, 10**16), "h3: a_eta exceeds"),
        ("a_theta", Fraction(1, 10**4), "h3: a_theta exceeds"),
        ("f_y", 10**9, "h3: β ς_f² I_y ≤ ϵ/8"),
    ]:
        harsher(field, factor)
        rejected(judge(plant, certificate), f"agent 1: {obligation}")


def test_more_work_than_allowed_is_no_success() -> None:
    plant, certificate = load("mixed")
    data = plant.encode(), encode(certificate)
    assert check(*data, steps=1_000).status == "rejected"
    assert check(*data, steps=100_000).obligation == "coordinator"


def test_what_the_checker_does_not_expect_is_no_success(monkeypatch: pytest.MonkeyPatch) -> None:
    plant, certificate = load("mixed")

    def broken(*arguments: object) -> None:
        raise MemoryError("no room")

    monkeypatch.setattr("certify.checker.rules.coordinator.prove", broken)
    verdict = judge(plant, certificate, bind=False)
    assert (verdict.status, verdict.obligation, verdict.claim_sha256) == ("rejected", "unexpected", "")
    assert "MemoryError: no room" in verdict.detail
