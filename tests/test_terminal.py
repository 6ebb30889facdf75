"""Messages on terminals that have no Greek."""

from __future__ import annotations

import codecs
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from reports.command_line.terminal import HANDLER, spell_out_what_is_missing

CASES = Path(__file__).parent / "cases"


@pytest.mark.parametrize(
    ("encoding", "text", "printed"),
    [
        ("ascii", "no pair α1, α2", "no pair alpha1, alpha2"),
        ("ascii", "c'' ≤ l, x̄1 → ∞, T⁻¹ 10⁻¹²", "c'' <= l, x_bar1 -> infinity, T^-1 10^-12"),
        ("ascii", "y → 東, 𝛂", "y -> \\u6771, alpha"),
        ("latin-1", "Σ c_i² ± é", "sum  c_i² ± é"),
        ("utf-8", "α1 ≤ α2", "α1 ≤ α2"),
    ],
)
def test_what_an_encoding_lacks_is_spelled_out(
    encoding: str, text: str, printed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    spell_out_what_is_missing()
    stream.write(text)
    stream.flush()
    assert stream.buffer.getvalue().decode(encoding) == printed


def test_every_character_of_the_messages_has_a_spelling() -> None:
    """Of the strings in the packages; JSON stays JSON."""
    spell_out_what_is_missing()
    root = Path(__file__).parent.parent
    used = {
        c
        for name in ("symbolic", "certify", "sims", "reports")
        for f in (root / name).rglob("*.py")
        for c in f.read_text()
    }
    for character in sorted(used - {"\u200b"}):
        printed = codecs.encode(character, "ascii", HANDLER).decode()
        assert "\\u" not in printed, (character, printed)
    assert json.loads(json.dumps("東", ensure_ascii=False).encode("ascii", HANDLER)) == "東"


def test_an_ascii_terminal_gets_the_outcome() -> None:
    command = [
        sys.executable,
        "-c",
        "import sys; from reports.command_line import main; sys.exit(main())",
        "check",
        str(CASES / "refusals" / "ascii-stdout.toml"),
    ]
    found = subprocess.run(command, env={**os.environ, "PYTHONIOENCODING": "ascii:strict"}, capture_output=True)
    assert found.returncode == 0 and found.stdout.isascii() and b"Traceback" not in found.stderr
