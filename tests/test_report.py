"""The PDF report: numbers without floats, mathematics without code, a document for every verdict."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import date
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import sympy
import typst
from hypothesis import given
from hypothesis import strategies as st

from certify.assumptions.findings import CheckReport, Finding
from certify.certificate import claim_digest
from certify.results import GainsResult
from certify.statement.claim import certified_gains
from certify.statement.numbers import floor_log10, fraction, log10, scientific, shown, with_log10
from reports import cells, tables
from reports.document import MAIN, TEMPLATES, build_report, typeset
from reports.paper_notes import NOTES, notes_for
from reports.provenance import portable
from reports.sections import document_data
from reports.study import Study, conclusion, source_date
from reports.typst_math import matrix, number_text, symbol_text
from reports.typst_math import typst as typst_math
from symbolic.derivation import derive
from symbolic.errors import InputError
from symbolic.plant import Interval, Plant, symbol
from symbolic.plant_file import parse_plant

HUGE = Fraction(7, 3) * 10**44
WHEN = date(2025, 1, 2)

SMALL = """
schema = "consensus-plant/1"
name = {name}
[network]
agents = 2
edges = ["1 -> 2", ["2 -> 1", "3/2"]]
[initial]
box = [-1, 1]
[[agent]]
ids = [1, 2]
order = {order}
f = {f}
b = 1
cost = "(s - id)^2"
"""

# --- numbers ----------------------------------------------------------------------------------------------------------

positive = st.builds(
    lambda mantissa, denominator, exponent: Fraction(mantissa, denominator) * Fraction(10) ** exponent,
    st.integers(1, 10**12), st.integers(1, 10**12), st.integers(-400, 400),
)  # fmt: skip


def decimal_value(text: str) -> Fraction:
    """The rational that a decimal such as ``-1.25e-3`` names; integers only, as the module under test."""
    digits, _, exponent = text.partition("e")
    whole, _, part = digits.partition(".")
    return Fraction(int(whole + part), 10 ** len(part)) * Fraction(10) ** int(exponent or 0)


@given(positive)
def test_log10_is_within_half_a_unit_of_the_last_digit(x: Fraction) -> None:
    """``|100·log₁₀ x − n| ≤ ½`` is ``10^(2n−1) ≤ x^200 ≤ 10^(2n+1)``: integers alone."""
    n = int(decimal_value(log10(x, 2)) * 100)
    assert Fraction(10) ** (2 * n - 1) <= x**200 <= Fraction(10) ** (2 * n + 1)


@given(st.integers(-3000, 3000))
def test_powers_of_ten_have_exact_logarithms(k: int) -> None:
    assert decimal_value(log10(Fraction(10) ** k)) == k
    assert floor_log10(Fraction(10) ** k) == k


@given(positive, st.integers(1, 9))
def test_scientific_is_within_half_a_unit_and_directed_roundings_enclose(x: Fraction, significant: int) -> None:
    unit = Fraction(10) ** (floor_log10(x) + 1 - significant)
    nearest, up, down = (decimal_value(scientific(x, significant, way)) for way in ("nearest", "up", "down"))  # type: ignore[arg-type]  # literals
    assert abs(nearest - x) <= unit / 2
    assert x <= up < x + unit
    assert x - unit < down <= x


@given(positive, st.sampled_from([1, -1]))
def test_a_number_shown_as_exact_is_exact_and_others_are_close(x: Fraction, sign: int) -> None:
    result = shown(sign * x)
    assert (decimal_value(result.text) == sign * x) == result.exact or not result.exact
    assert abs(decimal_value(result.text) - sign * x) <= x / 1000


def test_more_digits_than_python_prints_are_no_obstacle() -> None:
    x = Fraction(3**100_000, 7**30_001)  # 47 713 digits over 25 354
    assert log10(x) == "22358.34"
    assert shown(x).text == "2.184e22358"
    assert shown(Fraction(10) ** 5000 / 3, rounding="up").text == "3.334e4999"


def test_numbers_read_as_an_engineer_writes_them() -> None:
    assert [shown(Fraction(x)).text for x in ("0", "40000", "1/16", "-3/2", "1/3", "1e44", "12345678")] == [
        "0", "40000", "0.0625", "-1.5", "0.3333", "1e44", "1.235e7",
    ]  # fmt: skip
    assert with_log10(HUGE) == "2.333e44 (log10 44.37)"
    assert with_log10(Fraction(1, 3 * 10**18)) == "3.333e-19 (log10 -18.48)"
    assert fraction(Fraction(2, 11)).text == "2/11"
    assert fraction(HUGE).text == "2.333e44"


@pytest.mark.parametrize("value", [0, -1, Fraction(-1, 3)])
def test_log10_refuses_what_has_none(value: Fraction) -> None:
    with pytest.raises(ValueError, match="log10 needs a positive number, not"):
        log10(value)


def test_floor_log10_refuses_zero() -> None:
    with pytest.raises(ValueError, match="zero has no logarithm"):
        floor_log10(0)


# --- mathematics ------------------------------------------------------------------------------------------------------

x1, x2, theta = symbol("x1"), symbol("x2"), symbol("theta")


@pytest.mark.parametrize(
    ("expr", "expected"),
    [
        (x1**2 * sympy.Rational(1, 2), "frac(1, 2) x_(1)^(2)"),
        (-x1 / (theta**2 + 1), "-frac(x_(1), theta^(2) + 1)"),
        (x1 - 2 * x2, "x_(1) - 2 x_(2)"),
        (2 * 3**x1, "2 dot 3^(x_(1))"),
        (sympy.sin(theta * x1) ** 2, 'op("sin")^(2) (theta x_(1))'),
        (sympy.log(1 + sympy.exp(x1)), 'op("ln") (upright(e)^(x_(1)) + 1)'),
        (sympy.sqrt(x1 + 1), "sqrt(x_(1) + 1)"),
        (x1 ** sympy.Rational(3, 2), "x_(1)^(frac(3, 2))"),
        ((x1 + 1) ** 2 * -3, "-3 (x_(1) + 1)^(2)"),
        (1 / x1**2, "frac(1, x_(1)^(2))"),
        (sympy.pi * x1, "pi x_(1)"),
        (sympy.Integer(10) ** 30, "10^(30)"),
        (sympy.Matrix([[0, 1], [-sympy.Rational(16, 25), 0]]), 'mat(delim: "[", 0, 1; -frac(16, 25), 0)'),
    ],
)
def test_expressions_print_as_typst_mathematics(expr: sympy.Expr, expected: str) -> None:
    assert typst_math(expr) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("p12", "p_(12)"), ("theta", "theta"), ("A_w1", 'A_("w1")'), ("zbar1", "overline(z)_(1)"), ("mass", '"mass"'),
        ("omega0", "omega_(0)"), ("vartheta", "theta.alt"), ("e", "e"), ("sin", '"sin"'), ("table", '"table"'),
        ('x"#panic()', '"x\\"#panic()"'), ("x#1", '"x#"_(1)'), ("$", '"$"'), ("\\", '"\\\\"'),
    ],
)  # fmt: skip
def test_names_are_letters_or_quoted(name: str, expected: str) -> None:
    assert symbol_text(name) == expected


def test_an_enclosure_is_shown_as_one() -> None:
    third = Interval(Fraction(1, 3) - Fraction(1, 10**13), Fraction(1, 3) + Fraction(1, 10**12))
    shown_optimum = document_data(Study(small_plant(), optimum_enclosure=third))["optimum"]["math"]
    middle, radius = shown_optimum.removeprefix("in ").split(" plus.minus ")
    m = decimal_value(middle.replace(" times 10^(", "e").rstrip(")"))
    r = decimal_value(radius.replace(" times 10^(", "e").rstrip(")"))
    assert m - r <= third.lo < third.hi <= m + r
    assert r < Fraction(1, 10**11)


def test_a_power_of_a_named_symbol_is_bracketed() -> None:
    assert typst_math(x1**2, {x1: "y^r"}) == "(y^r)^(2)"


def test_every_printed_expression_is_accepted_by_typst() -> None:
    names = [
        "alpha",
        "lambda",
        "sum",
        "integral",
        "dif",
        "mat",
        'a"b',
        "x#1",
        "x_y_z1",
        "etatilde1",
        "sqrt",
        "Omega",
        "T_1_",
    ]
    variables = [symbol(name) for name in names]
    expressions = [
        sympy.Add(*variables),
        sympy.Mul(*variables) / 7,
        sympy.tanh(variables[0]) ** 3,
        variables[1] ** -variables[2],
    ]
    codes = [typst_math(expr) for expr in expressions] + [
        matrix([["1", number_text("-2/3")], [number_text("4.2e44"), "0"]])
    ]
    page = b'#let codes = json(bytes(sys.inputs.codes))\n#for code in codes { eval(code, mode: "math") }'
    assert typst.compile(page, format="pdf", ignore_system_fonts=True, sys_inputs={"codes": json.dumps(codes)})


# --- the study --------------------------------------------------------------------------------------------------------


def small_plant(name: str = "small", order: int = 1, f: str = "-x1") -> Plant:
    text = SMALL.format(name=json.dumps(name), order=order, f=json.dumps(f))
    return parse_plant(text.encode(), "small.toml")


def findings(verdict: str, reason: str = "shown") -> CheckReport:
    return CheckReport(
        (Finding("A2", None, verdict, reason, {"r": ["1/2", "1/2"]}), Finding("A0", 1, "holds", "f(0) = 0"))
    )  # type: ignore[arg-type]  # a literal


def certificate(plant: Plant, h: Fraction | None = HUGE) -> dict[str, object]:
    agents = [
        {"id": str(a.id), "g": "43/10", "K": "5", "delta": "7", "h": None if h is None else str(h)}
        for a in plant.agents
    ]
    square = [["1/3", "0"], ["0", "2"]]
    witness = [{"id": str(a.id), "level": "10", "V0": [], "P1": [["1"]], "P2": [], "P3": square} for a in plant.agents]
    coordinator = {
        "P": square, "multiplier": ["1", "1"], "rate": "2/5", "mixing_rate": "1/3", "step": "1/64", "steps": "64"
    }  # fmt: skip
    claim = {
        "plant_sha256": plant.sha256, "alpha1": "3", "alpha2": "2", "gradient_gain": "1", "mixing_gain": "1",
        "mixing_time": "0", "softening": "0", "agents": agents,
    }  # fmt: skip
    r = ["1/" + str(len(plant.agents))] * len(plant.agents)
    proof = {"left_null_vector": r, "optimum": ["3/2", "3/2"], "coordinator": coordinator, "agents": witness}
    return {"theorem": "recipe/2", "claim": claim, "witness": proof}


def gains(status: str, reason: str = "", linear: object = None) -> SimpleNamespace:
    agent = SimpleNamespace(
        id=1, status=status, reason=reason, linear=linear, matrices={"P1": ((Fraction(1, 3),),)},
        constants={"varsigma1": Fraction(2), "F_z": HUGE, "new_one": Fraction(1)},
        thresholds={"g": Fraction(4), "T": 1 / HUGE},
    )  # fmt: skip
    return SimpleNamespace(
        status=status, reason=reason, route="recipe", certificate=None, envelope=None, agents=(agent,),
        summary={"gains": None}, coordinator=None,
    )  # fmt: skip


def text_of(study: Study) -> str:
    return str(document_data(study))


# --- conclusions ------------------------------------------------------------------------------------------------------


def test_a_failed_assumption_refutes_and_names_itself() -> None:
    ended = conclusion(Study(small_plant(), check=findings("fails", "no edge enters the agents {1}")))
    assert (ended.status, ended.reason) == ("refuted", "A2: no edge enters the agents {1}")


def test_an_undecided_assumption_is_inconclusive() -> None:
    assert conclusion(Study(small_plant(), check=findings("unknown", "not found"))).reason == "A2: not found"


def test_nothing_done_is_inconclusive() -> None:
    assert conclusion(Study(small_plant())).status == "inconclusive"


def test_a_certificate_counts_as_verified_only_with_the_checkers_digest() -> None:
    plant = small_plant()
    found = certificate(plant)
    study = Study(plant, check=findings("holds"), certificate=found)
    digest = claim_digest(found)
    assert conclusion(study) == conclusion(replace(study, verification=None))
    assert not conclusion(study).verified
    assert conclusion(replace(study, verification={"status": "verified", "claim_sha256": digest})).verified
    assert not conclusion(replace(study, verification={"status": "verified", "claim_sha256": "0" * 64})).verified
    rejected = conclusion(
        replace(study, verification={"status": "rejected", "claim_sha256": digest, "reason": "P1 is not positive"})
    )
    assert (rejected.status, rejected.verified) == ("rejected", False)
    assert "P1 is not positive" in rejected.reason


def test_the_date_follows_source_date_epoch() -> None:
    assert source_date({"SOURCE_DATE_EPOCH": "1735776000"}) == WHEN
    for wrong in ("yesterday", "-1", "1" * 13, "999999999999", ""):
        with pytest.raises(InputError, match="SOURCE_DATE_EPOCH"):
            source_date({"SOURCE_DATE_EPOCH": wrong})


# --- the document -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("status", ["certified", "refuted", "inconclusive"])
def test_a_report_builds_for_every_verdict(status: str) -> None:
    plant = small_plant()
    linear = SimpleNamespace(
        status="refuted",
        reason="determinant 3 is negative",
        smallest_h=Fraction(20001),
        determinant_index=3,
        determinant=-HUGE,
    )
    study = Study(
        plant,
        check=findings("holds"),
        optimum=Fraction(3, 2),
        derivation=derive(plant, sympy.Rational(3, 2)),
        gains=gains(
            status, "" if status == "certified" else "the level runs away", linear if status == "refuted" else None
        ),  # type: ignore[arg-type]  # by hand
        certificate=certificate(plant, None) if status == "certified" else None,
        date=WHEN,
    )
    assert conclusion(study).status == status
    assert build_report(study).startswith(b"%PDF-")


def test_a_report_builds_from_nothing_but_a_plant() -> None:
    assert build_report(Study(small_plant(order=3, f="sin(x1)*x2"))).startswith(b"%PDF-")


def test_the_paper_example_builds_reproducibly_and_differs_with_the_date(five_agents: Plant, tmp_path: Path) -> None:
    plant = five_agents
    study = Study(plant, derivation=derive(plant, sympy.Integer(2)), certificate=certificate(plant), date=WHEN, seed=3)
    first = build_report(study, tmp_path / "report.pdf")
    assert first == build_report(study)
    assert first == (tmp_path / "report.pdf").read_bytes()
    assert first != build_report(replace(study, date=date(2025, 1, 3)))


@pytest.mark.parametrize(
    ("changed", "shown", "kept_out"),
    [
        ({}, "alpha_1 = 3, alpha_2 = 2", ["kappa", "beta", "nu", '"mix"']),
        ({"gradient_gain": "1/4"}, "kappa = 0.25", ["beta", "nu", '"mix"']),
        ({"mixing_gain": "32"}, "beta = 32", ["kappa", "nu", '"mix"']),
        ({"mixing_time": "1/2"}, 't_"mix" = 0.5', ["kappa", "beta", "nu"]),
        ({"mixing_time": "1/2", "softening": "6"}, "nu = 6", ["kappa", "beta"]),
    ],
)
def test_constants_that_are_not_the_papers_are_shown_with_the_equations_they_are_in(
    changed: dict[str, str], shown: str, kept_out: list[str]
) -> None:
    plant = small_plant()
    proof: Any = certificate(plant, None)
    proof["claim"] |= changed
    study = Study(plant, certificate=proof, derivation=derive(plant, sympy.Rational(3, 2)))
    data = document_data(study)["coordinator"]
    assert shown in ", ".join(data["constants"])
    written = "\n".join([*data["lines"], data["error"], *data["constants"]])
    assert [name for name in kept_out if name in written] == []
    symbols = {"gradient_gain": "kappa", "mixing_gain": "beta", "softening": "nu"}
    assert all(symbols[key] in "".join(data["lines"]) for key in changed if key in symbols)
    assert (data["held"], data["soft"]) == ("mixing_time" in changed, "softening" in changed)
    build_report(study)


def test_a_network_of_fifty_agents_breaks_its_tables_over_pages() -> None:
    edges = ", ".join(f'"{k} -> {k % 50 + 1}"' for k in range(1, 51))
    text = SMALL.format(name='"fifty"', order=2, f='"-id*x2"').replace("agents = 2", "agents = 50")
    text = text.replace('edges = ["1 -> 2", ["2 -> 1", "3/2"]]', f"edges = [{edges}]").replace("[1, 2]", '["1-50"]')
    plant = parse_plant(text.encode(), "fifty.toml")
    study = Study(plant, certificate=certificate(plant), derivation=derive(plant, sympy.Rational(51, 2)))
    types = document_data(study)["types"]["list"]
    assert len(types) == 1
    assert "same structure" in str(types[0]["remark"])
    assert build_report(study).startswith(b"%PDF-")


def test_a_cut_network_says_which_agents_hear_nobody() -> None:
    text = (
        SMALL.format(name='"cut"', order=1, f='"-x1"')
        .replace('["2 -> 1", "3/2"]', "")
        .replace('"1 -> 2", ', '"1 -> 2"')
    )
    study = Study(parse_plant(text.encode(), "cut.toml"))
    assert "no edge enters the agents {1}" in text_of(study)
    assert build_report(study).startswith(b"%PDF-")


@pytest.mark.parametrize("name", ['#panic("x")', '"#panic()', "$ x $ *b* `c` <l> @r", "\\", "]#sys.inputs", "ſ漢字"])
def test_strings_of_a_plant_file_are_shown_and_not_run(name: str) -> None:
    study = Study(
        small_plant(name),
        check=findings("unknown", name),
        gains=gains("inconclusive", name),  # type: ignore[arg-type]  # by hand
        commands=(f"certify run {name}",),
        versions={name: name},
    )
    assert build_report(study).startswith(b"%PDF-")


def test_templates_compile_without_warnings() -> None:
    data = json.dumps(document_data(Study(small_plant(), check=findings("holds"))))
    _, warnings = typst.compile_with_warnings(
        str(MAIN), root=str(TEMPLATES), format="pdf", ignore_system_fonts=True, sys_inputs={"data": data}
    )
    assert warnings == []


def test_the_templates_do_evaluate_what_is_not_data() -> None:
    """The other way round: had a name been evaluated, the build would have failed."""
    data = document_data(Study(small_plant()))
    data["plant"]["rows"][0][0] = {"math": '#panic("evaluated")'}
    with pytest.raises(typst.TypstError, match="evaluated"):
        typeset(data, 0)


# --- parts ------------------------------------------------------------------------------------------------------------


def test_agents_are_listed_in_runs() -> None:
    assert cells.agents([5, 1, 2, 3]) == "1–3, 5"
    assert cells.agents([1, 2]) == "1, 2"
    assert cells.agents_named([4]) == "Agent 4"


def test_findings_that_say_the_same_share_a_row() -> None:
    report = CheckReport(tuple(Finding("A0", k, "holds", "b ≥ 1" if k < 4 else "b ≥ 2") for k in range(1, 5)))
    assert [row["who"] for row in tables.assumptions_table(report)] == ["1–3", "4"]


def test_quantities_come_in_blocks_of_five_columns() -> None:
    agents = [(k, {"g": Fraction(k), "T": None if k == 1 else Fraction(k)}) for k in range(1, 13)]
    blocks = tables.quantity_blocks(agents, tables.THRESHOLDS)
    assert [len(block["agents"]) for block in blocks] == [5, 5, 2]
    assert [row["sign"] for row in blocks[0]["rows"]] == ["g", "T"]
    assert blocks[0]["rows"][1]["cells"][0] == {"text": "–"}


@pytest.mark.parametrize("damage", ["1e999999999", "1/0", "nan", 5, None, "٣"])
def test_a_certificate_with_strange_numbers_is_not_shown(damage: object) -> None:
    found = certificate(small_plant())
    assert certified_gains(found) is not None
    found["claim"]["alpha1"] = damage  # type: ignore[index]  # JSON
    assert certified_gains(found) is None
    assert build_report(Study(small_plant(), certificate=found)).startswith(b"%PDF-")


def test_notes_are_those_that_concern_the_plant(five_agents: Plant) -> None:
    assert [note.id for note in notes_for(five_agents)] == [note.id for note in NOTES]
    few = {note.id for note in notes_for(small_plant())}
    assert few.isdisjoint({"F1", "F7", "F8", "F18", "F19", "F20"})
    assert {"F2", "F4", "F5", "F13"} <= few


@pytest.mark.parametrize("route", ["direct", "recipe"])
def test_notes_speak_of_the_route_that_was_tried_and_claim_nothing(route: str) -> None:
    gains = GainsResult("inconclusive", "nothing passed", route, None, {"gains": None, "claim": None}, ())
    notes = {note["id"]: note["consequence"] for note in document_data(Study(small_plant(), gains=gains))["notes"]}
    assert notes["F2"].startswith("No level set is used" if route == "direct" else "The level is found")
    assert not any("is certified" in text for text in notes.values())


def test_evidence_is_words_and_exact_numbers() -> None:
    cut = {"agents": [1], "hears_nobody": True}
    report = CheckReport((Finding("A2", None, "fails", "two parts", {"cuts": [cut]}),))
    (row,) = tables.assumptions_table(report)
    assert row["evidence"] == cells.text("cuts: [{agents: [1]; hears nobody: yes}]")


def test_commands_lose_the_paths_of_the_machine() -> None:
    assert portable("certify run /home/someone/plants/a.toml -o /tmp/out") == "certify run a.toml -o out"
    assert portable("certify run examples/a.toml -o out/") == "certify run examples/a.toml -o out/"
    assert portable("certify run ~/a.toml -o ../out") == "certify run a.toml -o ../out"
