"""Numbers that floats cannot hold end in one line, whatever the command; no traceback, no warning."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from test_definedness import text

from certify.float_range import BEYOND, BeyondFloatsError, float_range
from reports.command_line.application import main

HUGE, TINY = "(1e250*1e150)", "(1e-250*1e-150)"  # the readers refuse what is too large as it is written


@pytest.mark.parametrize("command", ["check", "gains", "simulate"])
@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"f": f"{HUGE}*x1"}, BEYOND),
        ({"b": HUGE}, BEYOND),
        ({"cost": f"{HUGE}*s^2"}, BEYOND),
        ({"cost": f"(s - {HUGE})^2"}, BEYOND),
        ({"f": "exp(1000*x1) - 1"}, ""),
        ({"f": "z1", "f0": f"-{TINY}*z1 + x1"}, ""),
    ],
)
def test_numbers_beyond_floats_end_in_one_line(
    command: str, parts: dict[str, str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if command == "simulate" and not said:
        pytest.skip("floats hold its numbers")
    file = tmp_path / "plant.toml"
    file.write_text(text(**parts))
    code = main([command, str(file), *(["-o", str(tmp_path / "out")] if command != "check" else [])])
    out, err = capsys.readouterr()
    assert code == (0 if command == "check" else 3)
    assert "Traceback" not in err and "Warning" not in err
    assert command == "check" or said in out + err


@pytest.mark.parametrize(
    "fault",
    [
        lambda: float(Fraction(10) ** 400),
        lambda: Fraction(1) / Fraction(round(0.4)),
        lambda: Fraction(float("inf")),
        lambda: Fraction(float("nan")),
        lambda: np.linalg.eigvals(np.array([[np.nan]])),
    ],
)
def test_what_leaves_the_range_of_floats_is_one_kind_of_error(fault) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(BeyondFloatsError), float_range():
        fault()


def test_other_errors_pass() -> None:
    with pytest.raises(ValueError, match="another"), float_range():
        raise ValueError("another fault")
