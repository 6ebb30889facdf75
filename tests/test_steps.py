"""What is seen of a step: a bar on a terminal, lines elsewhere, nothing on stdout."""

from __future__ import annotations

import io
import re

import pytest

from reports.command_line.steps import Steps


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_a_bar_and_keeps_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    with Steps().step("gains") as report:
        report.progress("agent 2: [g, K] = [1, 2]")
        for done in (0.25, 0.5, 1.0):
            report.share(done)
        report("certified")
    shown = screen.getvalue()
    assert "\x1b[?25l" in shown and shown.count("\x1b[?25h") == 1  # the cursor is back
    assert "gains: agent 2: [g, K] = [1, 2]" in shown and "━" in shown
    assert re.search(r"gains +\d+\.\d s  certified$", shown.splitlines()[-1])


def test_a_file_gets_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with Steps().step("check") as report:
        report.share(0.5)
        report("holds")
    captured = capsys.readouterr()
    assert captured.out == "" and re.fullmatch(r"check +\d+\.\d s  holds\n", captured.err)
