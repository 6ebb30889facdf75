"""The door: what ``import certify`` offers, what it loads, and that it answers as the command line does."""

from __future__ import annotations

import doctest
import importlib
import json
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import certify
from certify.assumptions.findings import CheckReport
from certify.results import GainsResult
from reports.command_line import main
from symbolic.answers import EXIT_CODES, MOST_LINES, Answer, agents_named
from symbolic.errors import InputError
from symbolic.plant import Plant, RequestedGains

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
FIRST_ORDER = EXAMPLES / "first_order.toml"
PACKAGES = ("symbolic", "certify", "sims", "reports")


@pytest.fixture(scope="module")
def plant() -> Plant:
    return certify.read_plant(FIRST_ORDER)


@pytest.fixture(scope="module")
def found(plant: Plant) -> GainsResult:
    return certify.gains(plant)


def loaded_after(code: str) -> set[str]:
    script = f"{code}\nimport sys\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_the_door_loads_nothing_heavy() -> None:
    assert not {"cvxpy", "matplotlib", "scipy", "sympy", "flint", "symbolic", "sims", "reports"} & loaded_after(
        "import certify"
    )


def test_reading_and_writing_a_plant_loads_neither_solver_nor_drawing_nor_simulator() -> None:
    code = f"import certify; certify.write_plant(certify.read_plant({str(FIRST_ORDER)!r}))"
    assert not {"cvxpy", "clarabel", "matplotlib", "sims", "reports"} & loaded_after(code)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_of_a_door_is_there(package: str) -> None:
    door = importlib.import_module(package)
    assert set(door.__all__) == set(door._HOMES) <= set(dir(door))
    assert all(getattr(door, name) is not None for name in door.__all__)
    assert (Path(str(door.__file__)).parent / "py.typed").is_file()
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = door.nothing


def test_rooms_of_the_same_name_do_not_take_the_place_of_functions() -> None:
    rooms = [
        importlib.import_module(f"certify.{name}") for name in ("gains.requested", "region", "gains", "export.package")
    ]
    assert callable(certify.gains) and callable(certify.region) and callable(certify.export)
    assert rooms[1].certified_region is not certify.region


@pytest.mark.parametrize(
    ("mine", "use", "said"),
    [
        (("reports", "sims"), "print(certify.check(certify.example('first_order')).status)", "holds"),
        (("reports",), "certify.report(certify.example('rooms'), b'')", "reports.py bears that name"),
        (("sims",), "certify.simulate(certify.example('rooms'))", "sims.py bears that name"),
        (("symbolic",), "certify.example()", "symbolic.py bears that name"),
    ],
)
def test_modules_of_the_user_are_left_alone(tmp_path: Path, mine: tuple[str, ...], use: str, said: str) -> None:
    """Before and after the door is used; where one is in the way of what is asked, that is said."""
    for name in mine:
        (tmp_path / f"{name}.py").write_text("OWN = True\n")
    script = tmp_path / "script.py"
    imports = f"import {', '.join(mine)}\n"
    script.write_text(
        f"import certify\ntry:\n    {use}\nexcept ImportError as error:\n    print(error)\n{imports}"
        f"assert all(module.OWN for module in ({', '.join(mine)},))\n"
    )
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert said in done.stdout


def test_docstrings_of_the_door_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES.parent)
    for module in (certify, importlib.import_module("certify.door")):
        assert doctest.testmod(module).failed == 0


def test_answers_are_short_and_say_the_exit_code(plant: Plant, found: GainsResult) -> None:
    answers: list[Answer] = [certify.check(plant), certify.derive(plant), found, certify.verify(plant, found)]
    for answer in answers:
        assert answer.exit_code == EXIT_CODES[answer.status] == 0
        assert len(repr(answer).splitlines()) <= MOST_LINES and len(repr(answer)) < 2000
        assert answer.status in answer._repr_html_()
    assert "<th>agent</th><th>g</th>" in found._repr_html_()
    assert r"\begin{align*}" in certify.derive(plant)._repr_latex_()


def test_html_escapes_what_plant_files_say() -> None:
    report = CheckReport((replace(certify.check(FIRST_ORDER).findings[0], reason="<script>"),))
    assert "<script>" not in report._repr_html_() and "&lt;script&gt;" in report._repr_html_()


def test_door_and_command_line_say_the_same(
    plant: Plant, found: GainsResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "certificate.json"
    found.save(path)
    assert main(["verify", str(FIRST_ORDER), str(path)]) == 0
    assert capsys.readouterr().out == f"{certify.verify(FIRST_ORDER, path)}\n"
    assert main(["check", str(FIRST_ORDER), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == certify.check(plant).as_json()
    assert main(["simulate", str(FIRST_ORDER), str(path), "-o", str(tmp_path), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    run = certify.simulate(plant, found)
    assert (printed["reason"], printed["final_error"], printed["status"]) == (run.reason, run.final_error, run.status)


def test_a_plant_that_was_changed_in_memory_is_certified_as_it_is(plant: Plant, found: GainsResult) -> None:
    """The certificate is about the changed plant, and about no other."""
    asked = tuple(RequestedGains(K=law.thresholds["K"]) for law in found.agents)
    changed = replace(plant, gains=asked)
    again = certify.gains(changed)
    assert again.status == "certified"
    assert certify.verify(changed, again).status == "verified"
    assert certify.verify(plant, again).status == "rejected"


def test_search_and_simulation(plant: Plant, found: GainsResult) -> None:
    heard: list[str] = []
    searched = certify.falsify(plant, found, budget=20, agents=[1], progress=heard.append)
    assert (searched.status, searched.exit_code) == ("survived", 0)
    assert heard and searched.rows()[1][0] == "1"
    run = certify.simulate(plant, horizon=0.1)
    for signal in ("outputs", "references", "inputs", "tracking_error"):
        axes = run.plot(signal=signal)
        assert axes is run.plot(ax=axes, signal=signal)
    with pytest.raises(InputError, match="'speed' is not one of outputs"):
        run.plot(signal="speed")


def test_export(plant: Plant, found: GainsResult, tmp_path: Path) -> None:
    made = certify.export(plant, found, tmp_path / "code", to="python", period=0.001)
    assert made.status == "verified" and made.package is not None
    assert made.package.digest == certify.verify(plant, found).claim_sha256
    assert {program.period for program in made.package.programs} == {Fraction(1, 1000)}
    assert {path.name for path in (tmp_path / "code").iterdir()} == set(made.files)
    with pytest.raises(InputError, match="export: to is one of c, python, fmi"):
        certify.export(plant, found, to="fortran")  # type: ignore[arg-type]


def test_refusals() -> None:
    with pytest.raises(InputError, match="route: 'shortest' is not one of"):
        certify.gains(FIRST_ORDER, route="shortest")
    with pytest.raises(InputError, match=r"nowhere\.json: cannot be read"):
        certify.verify(FIRST_ORDER, "nowhere.json")
    none = GainsResult("inconclusive", "too hard", "direct", None, {"gains": None})
    with pytest.raises(InputError, match="there is no certificate: inconclusive: too hard"):
        certify.verify(FIRST_ORDER, none)
    with pytest.raises(InputError, match="there is no certificate to write"):
        none.save("x.json")


def test_what_is_no_plant_and_no_certificate_is_refused(plant: Plant) -> None:
    with pytest.raises(InputError, match="a plant, a Network or the path of a plant file is needed, found dict"):
        certify.check({})  # type: ignore[arg-type]
    with pytest.raises(InputError, match="the path of a certificate, is needed, found int"):
        certify.verify(plant, 5)  # type: ignore[arg-type]


def test_long_reasons_are_wrapped_and_not_cut() -> None:
    reason = "word " * 100 + "end"
    shown = repr(GainsResult("inconclusive", reason, "direct", None, {"gains": None}))
    assert shown.endswith("end") and max(map(len, shown.splitlines())) <= 160


def test_agents_are_named_in_runs() -> None:
    assert agents_named([]) == "network"
    assert agents_named([4]) == "agent 4"
    assert agents_named([1, 2]) == "agents 1, 2"
    assert agents_named([5, 1, 2, 3]) == "agents 1–3, 5"
