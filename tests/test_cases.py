"""Small inputs that once ended wrongly, and what is right: command, exit code, status, words of the reason."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reports.command_line.application import main

CASES = Path(__file__).parent / "cases"

TABLE = [
    # soundness
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
    output = ["-o", str(tmp_path / "certificate.json")] if command == "gains" else []
    assert main([command, str(CASES / f"{case}.toml"), *output, "--json"]) == code
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


def test_references_that_start_at_the_optimum_are_certified(tmp_path: Path) -> None:
    """The nominal curve has nowhere to go, and has one stretch all the same."""
    text = (CASES / "refusals" / "ascii-stdout.toml").read_text()
    file = tmp_path / "plant.toml"
    file.write_text(text.replace('"0.00028*s^2 + 8.1*s + 550"', '"s^2/2"').replace("p*x1", "-x1"))
    assert main(["gains", str(file), "-o", str(tmp_path / "certificate.json")]) == 0
