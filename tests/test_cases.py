"""Small inputs that once ended wrongly, and what is right: command, exit code, status, words of the reason."""

from __future__ import annotations

import hashlib
import json
from fractions import Fraction
from pathlib import Path

import pytest

from certify.checker import check
from certify.checker.theorems import THEOREMS
from certify.routes import ROUTES
from reports.command_line.application import main

CASES = Path(__file__).parent / "cases"

TABLE = [
    # soundness: the certificates that lie beside the files are forged, or of a neighbour that is healthy
    ("verify soundness/state-named-box", 1, "rejected", "make the certificate anew"),
    ("verify soundness/narrow", 1, "rejected", "make the certificate anew"),
    ("falsify soundness/narrow", 1, "rejected", "the checker rejects the certificate"),
    ("simulate soundness/narrow", 1, "rejected", "the checker rejects the certificate"),
    ("gains soundness/state-named-box", 3, "inconclusive", ""),
    ("check soundness/agent-constant-in-initial", 2, "", "'a1' is a constant of one [[agent]] table"),
    # refusals: what holds, fails or cannot be decided, and the part that decides it
    ("check refusals/ascii-stdout", 0, "holds", ""),
    ("check refusals/b-almost-zero", 3, "unknown", "the independent checker refuses it: agent 1: A0: b > 0"),
    ("gains refusals/b-almost-zero", 3, "inconclusive", "A0, agent 1: proved here"),
    ("check refusals/b-sqrt-squared", 1, "fails", "the root of w1 needs w1 to be positive, but it is 0 at w1 = 0"),
    ("check refusals/cost-sqrt-power", 1, "fails", "the root of s needs s to be positive"),
    ("gains refusals/cost-sqrt-power", 1, "refuted", "A1, agent 1: the cost is not twice continuously differentiable"),
    ("check refusals/cost-s3-over-s", 1, "fails", "the denominator s needs s to be nonzero"),
    ("check refusals/cost-s-over-s", 1, "fails", "the denominator s needs s to be nonzero"),
    ("check refusals/f-sqrt-in-box", 1, "fails", "the root of x1 needs x1 to be positive, but it is 0 at x1 = 0"),
    ("gains refusals/f-sqrt-in-box", 1, "refuted", "A0, agent 1: f1 is not smooth on the initial box"),
    ("check refusals/f-pole-in-box", 1, "fails", "it is 0 at x1 = 1/2"),
    ("gains refusals/number-1e400", 2, "", "the number's exponent is beyond 300"),
    ("check refusals/smoothed-absolute-value", 0, "holds", '"l": "1000003"'),
    ("check refusals/cubic-zero-dynamics", 3, "unknown", "an equilibrium there may be, but none that is smooth at 0"),
]


OF_A_CERTIFICATE = ("verify", "falsify", "simulate")

# units and networks: the same plant in other units, rings and meshes; certified whatever they are
QUICK = ("units/input-gain-0.0018", "units/room-watt", "units/pole-meets-internal-model")
CERTIFIED = (
    *QUICK,
    *(f"units/cost-{name}" for name in ("30", "100", "1000", "per-megawatt")),
    *(
        f"units/{name}"
        for name in ("slow-zero-dynamics", "equal-lags", "friction-60-h-below-g", "cruise-control-newton")
    ),
    *(f"units/{name}" for name in ("dc-motor-volt", "dc-motor-order-3", "input-gain-2000")),
    *(f"networks/{name}" for name in ("ring-6", "alpha-100", "ten-machines-ring", "ten-machines-swing")),
    "networks/fifty-four-units",
)
ROWS = [pytest.param(*row, id=row[0]) for row in TABLE] + [
    pytest.param(
        f"gains {case}",
        0,
        "certified",
        "",
        id=f"gains {case}",
        marks=() if case in QUICK else pytest.mark.slow,
    )
    for case in CERTIFIED
]


@pytest.mark.parametrize(("line", "code", "status", "words"), ROWS)
def test_case(
    line: str, code: int, status: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command, case = line.split()
    arguments = [command, str(CASES / f"{case}.toml")]
    arguments += [str(file) for file in CASES.glob(f"{case}*.json") if command in OF_A_CERTIFICATE]
    output = {"gains": ["-o", str(tmp_path / "certificate.json")], "simulate": ["-o", str(tmp_path)]}
    assert main([*arguments, *output.get(command, []), "--json"]) == code
    out, err = capsys.readouterr()
    assert "Traceback" not in err and "Warning" not in err
    if code == 2:
        assert out == "" and words in err and err.count("\n") == 1
        return
    assert json.loads(out)["status"] == status
    assert words in out


def test_every_case_is_in_the_table() -> None:
    listed = {line.split()[1] for line, *_ in TABLE} | set(CERTIFIED)
    assert {f"{file.parent.name}/{file.stem}" for file in CASES.glob("*/*.toml")} == listed


@pytest.mark.parametrize(
    ("case", "lines"),
    [
        ("units/dc-motor-volt", "g = 1\nK = 0.05\nh = 5"),
        pytest.param("units/input-gain-2000", "K = 0.0005", marks=pytest.mark.slow),
    ],
)
def test_small_gains_of_inputs_with_a_large_effect_are_certified_as_given(
    case: str, lines: str, tmp_path: Path
) -> None:
    file, certificate = tmp_path / "plant.toml", tmp_path / "certificate.json"
    file.write_text(f"{(CASES / f'{case}.toml').read_text()}\n[gains]\n{lines}\n")
    assert main(["gains", str(file), "-o", str(certificate)]) == 0
    asked = dict(line.split(" = ") for line in lines.splitlines())
    for agent in json.loads(certificate.read_text())["claim"]["agents"]:
        assert all(Fraction(agent[key]) == Fraction(value) for key, value in asked.items())


def test_references_that_start_at_the_optimum_are_certified(tmp_path: Path) -> None:
    """The nominal curve has nowhere to go, and has one stretch all the same."""
    text = (CASES / "refusals" / "ascii-stdout.toml").read_text()
    file = tmp_path / "plant.toml"
    file.write_text(text.replace('"0.00028*s^2 + 8.1*s + 550"', '"s^2/2"').replace("p*x1", "-x1"))
    assert main(["gains", str(file), "-o", str(tmp_path / "certificate.json")]) == 0


NAMED_BOX = """
schema = "consensus-plant/1"
name = "named-box"
network = {{ agents = 2, edges = ["1 -> 2", "2 -> 1"] }}
[initial]
box = [-{default}, {default}]
z = {z}
x = [-0.2, 0.2]
reference = 0
observer = 0
eta = 0
[[agent]]
ids = [1, 2]
order = 1
zero_dynamics = {{ box = "-box + x1", z2 = "{flow}" }}
f = "box/4 + z2/2"
b = 1
cost = "(s - id + 3/2)^2/2"
"""
NARROW, DEFAULT, BOTH = "{ box = [-0.1, 0.1] }", "{ z2 = [-0.1, 0.1] }", "{ box = [-0.1, 0.1], z2 = [-0.1, 0.1] }"
FLOWS = {  # what is claimed of z2 beyond 1/10 is false (it escapes), or more than the witness's level proves
    "direct/3": ("-z2 + z2^3", 2),
    "recipe/2": ("-z2", 10**6),
}


@pytest.mark.parametrize("theorem", list(THEOREMS))
@pytest.mark.parametrize("z", [NARROW, DEFAULT])
def test_a_state_called_box_has_its_own_box_and_no_other(theorem: str, z: str, tmp_path: Path) -> None:
    """A certificate of starts in [-1/10, 1/10] is none of a file that writes so for one state only, whatever the name
    of that state: the other one starts in the default."""
    flow, default = FLOWS[theorem]
    route = next(route.name for route in ROUTES.values() if route.theorem == theorem)
    proved, claimed = (NAMED_BOX.format(default=default, z=states, flow=flow).encode() for states in (BOTH, z))
    plant, file = tmp_path / "plant.toml", tmp_path / "certificate.json"
    plant.write_bytes(proved)
    assert main(["gains", str(plant), "--route", route, "-o", str(file)]) == 0
    assert check(proved, file.read_bytes()).status == "verified"
    digests = [hashlib.sha256(data).hexdigest() for data in (proved, claimed)]
    forged = file.read_bytes().replace(*(digest.encode() for digest in digests))
    assert digests[1].encode() in forged
    verdict = check(claimed, forged)
    assert verdict.status == "rejected" and verdict.obligation.startswith("agent 1"), verdict
