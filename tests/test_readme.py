"""What the README says can be done, can be done."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from reports.command_line import main
from reports.command_line.outcome import EXIT_CODES
from symbolic.plant_file import load_plant

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_two_commands_come_first_and_name_what_exists() -> None:
    first, second = (line.split("#")[0].split() for line in blocks("sh")[0].splitlines())
    assert README.index("```sh") < 100
    assert first[:5] == ["python3", "bootstrap.py", "certify", "run", "examples/five_agents.toml"]
    assert second == ["python3", "bootstrap.py", "test"]
    assert all((ROOT / name).is_file() for name in (first[1], first[4]))


def test_plant_file_can_be_read(tmp_path: Path) -> None:
    (text,) = blocks("toml")
    path = tmp_path / "plant.toml"
    path.write_text(text)
    plant = load_plant(path)
    assert (plant.name, len(plant.agents)) == ("two-agents", 2)


def test_every_command_is_described_and_every_description_is_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    described = re.findall(r"^\| `certify ([\w-]+)", README, flags=re.MULTILINE)
    assert main(["--help"]) == 0
    listed = capsys.readouterr().out.split("Commands:")[1]
    described = list(dict.fromkeys(described))  # one with several uses may have several rows
    assert described == re.findall(r"^  ([\w-]+)  ", listed, flags=re.MULTILINE)
    for name in described:
        assert main([name, "--help"]) == 0


def test_exit_codes_are_those_of_the_table() -> None:
    rows = re.findall(r"^\| (\d|130, 143) \|.*\| (.*) \|$", README, flags=re.MULTILINE)
    assert [code for code, _ in rows] == ["0", "1", "2", "3", "130, 143"]
    assert {status: int(code) for code, cell in rows[:4] for status in re.findall(r"`(\w+)`", cell)} == EXIT_CODES


def test_folders_exist() -> None:
    (layout,) = blocks("text")
    assert all((ROOT / folder).is_dir() for folder in re.findall(r"^(\w+)/", layout, flags=re.MULTILINE))


@pytest.mark.parametrize("arguments", [[], ["unknown"]])
def test_bootstrap_says_what_it_can_run(arguments: list[str]) -> None:
    command = [sys.executable, ROOT / "bootstrap.py", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "bootstrap: say what to run: certify, test, docs or setup\n"


@pytest.mark.parametrize("path", sorted((ROOT / "requirements").glob("*.lock")), ids=lambda path: path.name)
def test_locks_pin_and_hash_everything_and_name_no_index(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert "://" not in text
    assert not re.search(r"^--", text, flags=re.MULTILINE)
    entries = re.findall(r"^(\S+) \\\n((?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", text, flags=re.MULTILINE)
    names = [line.split()[0] for line in text.splitlines() if line and not line.startswith((" ", "#"))]
    assert [name for name, _ in entries] == names
    assert all("==" in name for name in names)
