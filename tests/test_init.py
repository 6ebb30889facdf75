"""``certify init`` and the gallery: files to begin with that can be used as they are."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import certify
from reports.command_line import main
from symbolic.agent_file import KEYS as AGENT_KEYS
from symbolic.gallery import gallery, gallery_text, summary
from symbolic.initial_file import KEYS as INITIAL_KEYS
from symbolic.plant import CoordinatorChoice, Implementation, RequestedGains, Requirements
from symbolic.plant_file import KEYS, parse_plant
from symbolic.requested_file import keys_of

ROOT = Path(__file__).resolve().parent.parent
SAMPLED = {"period", "delay", "noise", "input_resolution", "arithmetic", "region"}  # for those who have read further


def test_starter_explains_every_key() -> None:
    text = gallery_text()
    asked = {key for kind in (CoordinatorChoice, RequestedGains, Requirements, Implementation) for key in keys_of(kind)}
    for key in {*KEYS, *AGENT_KEYS, *INITIAL_KEYS, *asked} - SAMPLED:
        assert key in text, key


def test_starter_checks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "plant.toml"
    assert main(["init", "-o", str(path)]) == 0
    assert path.read_text().startswith("#:schema file://")
    assert main(["check", str(path)]) == 0
    assert "assumptions: holds" in capsys.readouterr().out


@pytest.mark.slow
def test_starter_certifies() -> None:
    plant = certify.example()
    assert certify.verify(plant, certify.gains(plant)).status == "verified"


def test_keys_that_are_commented_out_may_be_used() -> None:
    """Every commented table, in the file and without its comment signs, is read."""
    text = gallery_text()
    tables = [block for block in text.split("\n\n") if block.startswith("# [")]
    assert len(tables) == 4
    for block in tables:
        lines = [line.removeprefix("# ") for line in block.splitlines()]
        parse_plant(text.replace(block, "\n".join(lines)).encode(), "starter")


def test_gallery_is_listed_with_what_it_is_about(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["init", "--list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["gallery"]
    assert listed["pendulums"] == "Three driven pendulums that agree on an angle"
    assert set(listed) == set(gallery()) == set(certify.gallery())
    assert all(10 < len(summary(name)) < 200 for name in gallery())


def test_a_plant_of_the_gallery_goes_to_stdout(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["init", "rooms"]) == 0
    assert capsys.readouterr().out == (ROOT / "examples" / "rooms.toml").read_text()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["init", "pendulum"], "'pendulum' is no plant of the gallery; did you mean 'pendulums'?"),
        (["init", "-o", str(ROOT / "README.md")], "it exists already, and init overwrites nothing"),
        (["init", "rooms", "--list"], "--list: names the gallery"),
    ],
)
def test_refusals(arguments: list[str], reason: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    assert reason in capsys.readouterr().err


@pytest.mark.slow
def test_a_wheel_is_enough(tmp_path: Path) -> None:
    """The command and the door from the unpacked wheel alone, in an empty folder: init, check, gains, report."""
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-w", str(tmp_path), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    site, empty = tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        wheel.extractall(site)

    def run(code: str) -> str:
        script = f"import sys; sys.path.insert(0, {str(site)!r})\n{code}"
        done = subprocess.run([sys.executable, "-c", script], cwd=empty, capture_output=True, text=True, check=True)
        return done.stdout

    where = run("import reports, symbolic.gallery, certify; print(reports.__file__, certify.gallery())")
    assert str(site) in where and "five_agents" in where
    steps = (
        "['init', 'first_order', '-o', 'plant.toml'], ['check', 'plant.toml'], ['gains', 'plant.toml', '-o', 'c.json'],"
        "['verify', 'plant.toml', 'c.json'], ['report', 'plant.toml', 'c.json', '-o', 'report.pdf']"
    )
    run(f"from reports.command_line import main\nfor step in [{steps}]: assert main(step) == 0, step")
    assert (empty / "report.pdf").read_bytes().startswith(b"%PDF")
