"""The command line as spec'd: exit codes, one JSON object, one line per error, nothing written elsewhere."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest

from certify.network_certificate import COORDINATOR_KEYS
from reports.command_line import main

TWO_AGENTS = """
schema = "consensus-plant/1"
name = "two-agents"
network = { agents = 2, edges = ["1 -> 2", "2 -> 1"] }
initial = { box = [-1, 1], reference = 0, observer = 0, eta = 0 }
[[agent]]
ids = [1, 2]
order = 1
f = "p*x1"
b = 1
cost = "(s - id)^2"
uncertain = { p = [-1, 1] }
"""

EXAMPLE = Path(__file__).parent.parent / "examples" / "five_agents.toml"


@dataclass(frozen=True)
class Answer:
    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """The one JSON object that stdout is; anything beside it fails."""
        assert self.out.count("\n") == 1
        return json.loads(self.out)


class Certify:
    """Runs the command line in this process."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __call__(self, *arguments: str | Path) -> Answer:
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main([str(argument) for argument in arguments])
        return Answer(code, out.getvalue(), err.getvalue())

    def plant(self, changes: Mapping[str, str] | None = None) -> Path:
        """Two agents of order 1, with parts of the file replaced."""
        text = TWO_AGENTS
        for old, new in (changes or {}).items():
            assert old in text
            text = text.replace(old, new)
        path = self.folder / "plant.toml"
        path.write_text(text)
        return path


@pytest.fixture
def certify(tmp_path: Path) -> Certify:
    return Certify(tmp_path)


@dataclass(frozen=True)
class Certified:
    """A plant, what ``certify run --json`` said about it, and the folder it wrote."""

    plant: Path
    answer: Answer
    folder: Path

    @property
    def certificate(self) -> Path:
        return self.folder / "certificate.json"


@pytest.fixture(scope="module")
def certified(tmp_path_factory: pytest.TempPathFactory) -> Certified:
    certify = Certify(tmp_path_factory.mktemp("certified"))
    plant = certify.plant()
    return Certified(
        plant, certify("run", plant, "-o", certify.folder / "out", "--json", "--budget", "300"), certify.folder / "out"
    )


def assert_one_complaint(answer: Answer, *words: str) -> None:
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.count("\n") == 1
    assert answer.err.startswith("certify: ")
    assert all(word in answer.err for word in words), answer.err


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ([], "Missing command"),
        (["prove"], "prove"),
        (["check"], "PLANT"),
        (["check", "a.toml", "b.toml"], "b.toml"),
        (["check", "a.toml", "--fast"], "--fast"),
        (["gains", "a.toml"], "-o"),
        (["gains", "a.toml", "-o"], "-o"),
        (["gains", "a.toml", "-o", "c.json", "--route", "guess"], "guess"),
        (["simulate", "a.toml", "-o", "d", "--horizon", "soon"], "--horizon"),
        (["verify", "a.toml"], "CERT"),
    ],
)
def test_usage_error_is_one_line(certify: Certify, arguments: list[str], word: str) -> None:
    assert_one_complaint(certify(*arguments), word)


COMMANDS_ON_A_PLANT = [
    ["run", "-o", "{folder}/out"],
    ["check"],
    ["derive"],
    ["gains", "-o", "{folder}/c.json"],
    ["simulate", "-o", "{folder}/out"],
]


@pytest.mark.parametrize("command", COMMANDS_ON_A_PLANT, ids=lambda command: command[0])
@pytest.mark.parametrize("flags", [[], ["--json"]], ids=["text", "json"])
def test_unreadable_plant_is_one_line_and_writes_nothing(
    certify: Certify, tmp_path: Path, command: list[str], flags: list[str]
) -> None:
    name, *options = [part.format(folder=tmp_path) for part in command]
    plant = tmp_path / "missing.toml"
    assert_one_complaint(certify(name, plant, *options, *flags), str(plant), "cannot be read")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "schema: missing, the file is empty"),
        (b"\xff\xfe", "UTF-8"),
        (b"schema = ", "not valid TOML"),
        (TWO_AGENTS.replace("p*x1", "p*x1 +").encode(), "agent[1].f: column"),
        (TWO_AGENTS.replace("p*x1", "__import__('os')").encode(), "agent[1].f: column"),
        (TWO_AGENTS.replace("order", "ordre").encode(), "ordre"),
        (b"x" * 2_000_000, "larger than"),
    ],
)
def test_bad_plant_is_one_line_with_file_and_key(certify: Certify, tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "plant.toml"
    path.write_bytes(content)
    assert_one_complaint(certify("check", path), str(path), reason)


def test_folder_in_place_of_a_plant(certify: Certify, tmp_path: Path) -> None:
    assert_one_complaint(certify("check", tmp_path), str(tmp_path), "Is a directory")


def test_design_error_found_late_still_names_the_file(certify: Certify) -> None:
    plant = certify.plant({"order = 1": "order = 2\ngamma = [-1]"})
    for command in (["derive", plant], ["check", plant], ["simulate", plant, "-o", plant.parent / "out"]):
        answer = certify(*command)
        if answer.code == 2:
            assert_one_complaint(Answer(2, answer.out, answer.err), f"{plant}: ", "gamma")
    assert certify("derive", plant).code == 2


@pytest.mark.parametrize(
    ("content", "reason"),
    [(None, "cannot be read"), ("{", "JSON"), ("[]", "schema"), ('{"schema": "consensus-certificate/9"}', "schema")],
)
@pytest.mark.parametrize("command", ["falsify", "verify", "report", "simulate"])
def test_bad_certificate_is_one_line_with_the_file(
    certify: Certify, tmp_path: Path, command: str, content: str | None, reason: str
) -> None:
    path = tmp_path / "c.json"
    if content is not None:
        path.write_text(content)
    options = {"report": ["-o", tmp_path / "r.pdf"], "simulate": ["-o", tmp_path / "out"]}.get(command, [])
    answer = certify(command, certify.plant(), path, *options)
    assert_one_complaint(answer, str(path))
    assert command == "verify" or reason in answer.err


@pytest.mark.parametrize(
    ("place", "reason"), [("plant.toml/c.json", "plant.toml is not a folder"), (".", "it is a folder")]
)
def test_place_for_the_certificate_is_looked_at_before_the_work(
    certify: Certify, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, reason: str
) -> None:
    def must_not_run(*_: object, **__: object) -> None:
        raise AssertionError("the work has started")

    monkeypatch.setattr("certify.pipeline.design_gains", must_not_run)
    assert_one_complaint(certify("gains", certify.plant(), "-o", tmp_path / place), reason)


def test_file_in_place_of_the_output_folder(certify: Certify, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    assert_one_complaint(certify("run", certify.plant(), "-o", tmp_path / "out"), "out: cannot be made a folder")


def test_check_that_holds(certify: Certify) -> None:
    answer = certify("check", certify.plant(), "--json")
    assert answer.code == 0
    assert answer.json["status"] == "holds"
    findings = answer.json["assumptions"]
    assert {finding["id"] for finding in findings} == {"A0", "A1", "A2", "A3", "A4", "A5", "A6"}
    assert all(set(finding) == {"id", "agent", "verdict", "reason", "evidence"} for finding in findings)
    assert {finding["agent"] for finding in findings if finding["id"] == "A1"} == {1, 2}
    assert {finding["agent"] for finding in findings if finding["id"] == "A2"} == {None}


@pytest.mark.parametrize(
    ("changes", "failing"),
    [
        ({', "2 -> 1"': ""}, "A2"),
        ({"(s - id)^2": "s^4"}, "A1"),
        ({"p*x1": "p*x1 + 1"}, "A0"),
        ({"b = 1": 'b = "p"'}, "A0"),
    ],
)
def test_check_that_fails(certify: Certify, changes: dict[str, str], failing: str) -> None:
    answer = certify("check", certify.plant(changes), "--json")
    assert (answer.code, answer.json["status"]) == (1, "fails")
    assert failing in {finding["id"] for finding in answer.json["assumptions"] if finding["verdict"] == "fails"}


def test_check_as_text_has_a_line_per_reason_with_its_agents(certify: Certify) -> None:
    plant = certify.plant({'cost = "(s - id)^2"': 'cost = "(s - id)^(2*id)"'})
    findings = certify("check", plant, "--json").json["assumptions"]
    *lines, last = [re.split(" {2,}", line) for line in certify("check", plant).out.splitlines()]
    assert last == ["assumptions: fails"]
    assert {name: where for name, where, *_ in lines if name != "A1"} == {
        "A2": "network", "A4": "network", **dict.fromkeys(("A0", "A3", "A5", "A6"), "agents 1, 2")
    }  # fmt: skip
    assert [line[1:3] for line in lines if line[0] == "A1"] == [["agent 1", "holds"], ["agent 2", "fails"]]
    assert {line[3] for line in lines} == {finding["reason"] for finding in findings}


def test_derive(certify: Certify) -> None:
    plant = certify.plant()
    answer = certify("derive", plant, "--json")
    assert (answer.code, answer.json["status"], answer.json["s_star"]) == (0, "holds", "3/2")
    assert "ϑ" in certify("derive", plant).out
    assert r"\vartheta" in certify("derive", plant, "--latex").out


def test_crash_is_not_mistaken_for_a_refutation(certify: Certify, monkeypatch: pytest.MonkeyPatch) -> None:
    def crash(*_: object) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("certify.assumptions.check.check_assumptions", crash)
    answer = certify("check", certify.plant(), "--json")
    assert (answer.code, answer.json["status"]) == (3, "inconclusive")
    assert answer.err.splitlines()[-1] == "certify: internal error: ZeroDivisionError: a bug"


def test_interruption_has_its_own_code(certify: Certify, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("certify.assumptions.check.check_assumptions", interrupt)
    assert certify("check", certify.plant()).code == 130


def test_reader_that_has_gone_does_not_change_the_exit_code(certify: Certify) -> None:
    script = "import sys; from reports.command_line import main; sys.exit(main())"
    command = [sys.executable, "-c", script, "check", str(certify.plant({', "2 -> 1"': ""})), "--json"]
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr


SCRIPT = "import sys; from reports.command_line import main; sys.exit(main())"


def in_a_bare_process(folder: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """The command with an empty home, working folder and folder for temporary files."""
    places = {name: folder / name for name in ("home", "cwd", "tmp")}
    for place in places.values():
        place.mkdir(exist_ok=True)
    keep = {key: value for key, value in os.environ.items() if not key.startswith(("MPL", "XDG_"))}
    own = {"HOME": places["home"], "TMPDIR": places["tmp"], "PYTHONPATH": EXAMPLE.parent.parent}
    environment = keep | {key: str(path) for key, path in own.items()}
    command = [sys.executable, "-c", SCRIPT, *map(str, arguments)]
    return subprocess.run(command, cwd=places["cwd"], env=environment, capture_output=True, text=True, check=False)


def test_simulate_writes_its_folder_and_nothing_else(certify: Certify, tmp_path: Path) -> None:
    done = in_a_bare_process(tmp_path, "simulate", certify.plant(), "-o", tmp_path / "out", "--json", "--horizon", "10")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["status"] == "simulated"
    assert all(os.listdir(tmp_path / place) == [] for place in ("home", "cwd", "tmp"))
    assert sorted(os.listdir(tmp_path / "out")) == [
        "inputs.png",
        "outputs.png",
        "references.png",
        "tracking_error.png",
        "trajectory.csv",
    ]


@pytest.mark.parametrize("arguments", [["--help"], ["verify", "--help"], ["verify", "a.toml", "b.json"]])
def test_what_does_not_compute_imports_nothing_heavy(tmp_path: Path, arguments: list[str]) -> None:
    script = SCRIPT.replace("sys.exit(main())", "main(); sys.exit(any(m in sys.modules for m in ('sympy', 'numpy')))")
    command = [sys.executable, "-c", script, *arguments]
    assert subprocess.run(command, cwd=EXAMPLE.parent.parent, capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize("plant", ["first_order", "five_agents"])
def test_check_imports_no_solver_and_nothing_that_draws(plant: str) -> None:
    """They take longer to import than these assumptions to decide."""
    heavy = ("cvxpy", "scipy", "numpy", "matplotlib", "networkx", "typst", "rich", "multiprocessing")
    script = SCRIPT.replace("sys.exit(main())", f"main(); sys.exit(sum(name in sys.modules for name in {heavy}))")
    command = [sys.executable, "-c", script, "check", str(EXAMPLE.parent / f"{plant}.toml")]
    assert subprocess.run(command, cwd=EXAMPLE.parent.parent, capture_output=True, check=False).returncode == 0


def test_a_command_finds_the_optimum_and_derives_once(
    certify: Certify, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The optimum of the plant, and every agent once with each design that it is given."""
    import symbolic.derivation
    from certify import optimum

    optima: list[Any] = []
    derived: list[Any] = []
    curvature, one = optimum.cost_curvature, symbolic.derivation.derive_agent
    monkeypatch.setattr(optimum, "cost_curvature", lambda cost: optima.append(cost) or curvature(cost))
    monkeypatch.setattr(
        symbolic.derivation, "derive_agent", lambda agent, *rest: derived.append(agent) or one(agent, *rest)
    )
    plant = certify.plant({"two-agents": "derived once"})
    assert certify("run", plant, "-o", tmp_path / "out", "--budget", "32").code == 0
    assert len(optima) == 2
    assert 2 <= len(derived) <= 4 and len(set(derived)) == len(derived)


def test_run_writes_its_files_and_says_what_the_summary_says(certified: Certified) -> None:
    assert certified.answer.code == 0, certified.answer.err
    assert sorted(os.listdir(certified.folder)) == ["certificate.json", "report.html", "report.pdf", "summary.json"]
    summary = json.loads((certified.folder / "summary.json").read_text())
    assert summary == certified.answer.json
    assert {"status", "route", "gains", "claim"} <= set(summary)
    assert (summary["status"], summary["route"], summary["verified"]) == ("certified", "direct", True)
    assert set(summary["gains"]) == {*COORDINATOR_KEYS, "agents"}
    for agent in summary["gains"]["agents"]:
        assert set(agent) == {"id", "g", "K", "delta", "h", "level", "rate"}
        assert all(isinstance(agent[key], str) for key in ("g", "K", "delta", "level", "rate"))
        assert agent["h"] is None
    assert (certified.folder / "report.pdf").read_bytes().startswith(b"%PDF-")


def test_run_names_its_steps_on_stderr(certified: Certified) -> None:
    steps = [line.split()[0] for line in certified.answer.err.splitlines()]
    once = [name for name, _ in groupby(steps)]
    assert once == "check derive gains verify simulate region runs attraction falsify report".split()


def test_gains_writes_the_certificate_that_run_wrote(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    answer = certify("gains", certified.plant, "-o", tmp_path / "c.json", "--json")
    assert answer.code == 0
    assert (tmp_path / "c.json").read_bytes() == certified.certificate.read_bytes()
    assert {key: answer.json[key] for key in ("status", "route", "gains", "claim")} == {
        key: certified.answer.json[key] for key in ("status", "route", "gains", "claim")
    }


def test_verify_prints_one_line_on_success(certify: Certify, certified: Certified) -> None:
    answer = certify("verify", certified.plant, certified.certificate)
    digest = certified.answer.json["claim"]["sha256"]
    assert (answer.code, answer.out, answer.err) == (0, f"VERIFIED {digest}\n", "")
    in_json = certify("verify", certified.plant, certified.certificate, "--json")
    assert (in_json.code, in_json.json) == (0, {"status": "verified", "claim_sha256": digest, "reason": ""})


def tampered(certified: Certified, folder: Path) -> Path:
    """The certificate with a gain for the first agent that is too small to stabilise it."""
    content = json.loads(certified.certificate.read_text())
    content["claim"]["agents"][0]["K"] = "1/2"
    path = folder / "tampered.json"
    path.write_text(json.dumps(content, sort_keys=True, separators=(",", ":")) + "\n")
    return path


def test_verify_rejects_without_a_word_on_stdout(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    path = tampered(certified, tmp_path)
    answer = certify("verify", certified.plant, path)
    assert (answer.code, answer.out, answer.err.count("\n")) == (1, "", 1)
    assert answer.err.startswith("certify: rejected: ")
    in_json = certify("verify", certified.plant, path, "--json")
    assert (in_json.code, in_json.json["status"], in_json.json["claim_sha256"]) == (1, "rejected", None)


def test_verify_rejects_another_plant(certify: Certify, certified: Certified) -> None:
    answer = certify("verify", certify.plant({"two-agents": "two others"}), certified.certificate)
    assert (answer.code, answer.out) == (1, "")
    assert "another plant file" in answer.err


def test_falsify_tells_the_margin_it_found(certify: Certify, certified: Certified) -> None:
    answer = certify("falsify", certified.plant, certified.certificate, "--budget", "8", "--json")
    assert (answer.code, answer.json["status"], answer.json["result"]) == (0, "survived", "survived")
    assert 0 <= answer.json["margin"] < 1 and answer.json["witness"] is None
    assert [tried["agent"] for tried in answer.json["tried"]] == [1, 2]


def test_falsify_searches_the_agents_and_the_time_it_is_told(certify: Certify, certified: Certified) -> None:
    chosen = ("falsify", certified.plant, certified.certificate, "--budget", "8", "--json", "--agent", "2")
    answer = certify(*chosen, "--horizon", "30")
    assert (answer.code, [tried["agent"] for tried in answer.json["tried"]]) == (0, [2])
    assert certify(*chosen).json["tried"][0]["worst"] != answer.json["tried"][0]["worst"]
    assert_one_complaint(certify(*chosen[:-1], "7"), "there is no agent 7")
    assert_one_complaint(certify(*chosen, "--horizon", "-1"), "--horizon")


def test_run_searches_on_the_scheduler_it_is_given(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    answer = certify("run", certified.plant, "-o", tmp_path, "--scheduler", "nothing://here")
    assert answer.code == 2 and "no Dask scheduler answers at 'nothing://here'" in answer.err


def test_falsify_refuses_a_scheduler_that_is_not_there(certify: Certify, certified: Certified) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    answer = certify("falsify", certified.plant, certified.certificate, "--scheduler", "nothing://here")
    assert (answer.code, answer.out) == (2, "")
    assert "no Dask scheduler answers at 'nothing://here'" in answer.err.splitlines()[-1]


def test_falsify_writes_the_witness_only_where_it_is_told(
    certify: Certify, certified: Certified, tmp_path: Path
) -> None:
    path, file = tampered(certified, tmp_path), tmp_path / "witness.json"
    answer = certify("falsify", certified.plant, path, "--budget", "8", "--json")
    assert (answer.code, answer.json["status"]) == (1, "refuted")
    assert answer.json["witness"]["schema"] == "consensus-witness/1"
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    again = certify("falsify", certified.plant, path, "--budget", "8", "-o", file)
    assert again.code == 1 and again.out.startswith("refuted: agent 1 ")
    assert json.loads(file.read_text()) == answer.json["witness"]


def test_simulate_runs_the_certified_gains(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    answer = certify("simulate", certified.plant, certified.certificate, "-o", tmp_path / "out", "--json")
    assert (answer.code, answer.json["status"], answer.json["optimum"]) == (0, "simulated", 1.5)
    assert answer.json["certificate"]["status"] == "verified"
    header, *rows = (tmp_path / "out" / "trajectory.csv").read_text().splitlines()
    assert header == "t,y1,y2,yr1,yr2,u1,u2"
    assert float(rows[-1].split(",")[1]) == pytest.approx(1.5, abs=1e-2)


def test_simulate_refuses_the_certificate_of_another_plant(
    certify: Certify, certified: Certified, tmp_path: Path
) -> None:
    plant = certify.plant({"two-agents": "two others"})
    answer = certify("simulate", plant, certified.certificate, "-o", tmp_path / "out", "--json")
    assert (answer.code, answer.json["status"]) == (1, "rejected")
    assert "another plant file" in answer.json["reason"] and not (tmp_path / "out").exists()


def test_report_on_a_certificate(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    answer = certify("report", certified.plant, certified.certificate, "-o", tmp_path / "r.pdf", "--json")
    assert (answer.code, answer.json["status"], answer.json["verified"]) == (0, "certified", True)
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF-")


def test_a_report_that_is_named_html_is_the_page(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    answer = certify("report", certified.plant, certified.certificate, "-o", tmp_path / "r.HTML", "--json")
    assert (answer.code, answer.json["status"], answer.json["verified"]) == (0, "certified", True)
    assert (tmp_path / "r.HTML").read_bytes().startswith(b"<!DOCTYPE html>")


def test_report_on_a_rejected_certificate_says_so(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    answer = certify("report", certified.plant, tampered(certified, tmp_path), "-o", tmp_path / "r.pdf", "--json")
    assert (answer.code, answer.json["status"], answer.json["verified"]) == (1, "rejected", False)
    assert (tmp_path / "r.pdf").exists()


@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="pdftotext reads the pages")
def test_the_pages_on_a_rejected_certificate_claim_nothing(
    certify: Certify, certified: Certified, tmp_path: Path
) -> None:
    """Of what a report on a certificate says is proved nothing is left but that nothing is."""
    pages = {}
    for name, proof in (("good", certified.certificate), ("bad", tampered(certified, tmp_path))):
        certify("report", certified.plant, proof, "-o", tmp_path / f"{name}.pdf")
        command = ["pdftotext", str(tmp_path / f"{name}.pdf"), "-"]
        pages[name] = " ".join(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())
    claims = (
        "Proved",
        "provably",
        "proved bound",
        "certified gains",
        "certificate proves",
        "certified region",
        "Not claimed",
    )
    found = {name: [word for word in claims if word in text] for name, text in pages.items()}
    assert len(found["good"]) == len(claims) and found["bad"] == []
    assert "Nothing is proved about these gains" in pages["bad"]
    assert "Nothing is claimed about the gains" in pages["bad"]


NARROW = ('"-a*x1 + tanh(x1)/2 + v1"', '"-a*x1 + tanh(x1)/2 + v1 + 1000*x1*exp(-(100000*(a-1.03712345))^2)"')


@pytest.fixture
def narrow(tmp_path: Path) -> tuple[Path, Path]:
    """Three tanks that run away near a = 1.03712345 only, which no random search meets, with the certificate of tanks
    that do not, about this file."""
    text = (EXAMPLE.parent / "first_order.toml").read_text()
    assert NARROW[0] in text
    healthy, plant, proof = tmp_path / "healthy.toml", tmp_path / "narrow.toml", tmp_path / "narrow.json"
    healthy.write_text(text)
    plant.write_text(text.replace(*NARROW))
    assert main(["gains", str(healthy), "-o", str(proof)]) == 0
    content = json.loads(proof.read_text())
    content["claim"]["plant_sha256"] = hashlib.sha256(plant.read_bytes()).hexdigest()
    proof.write_text(json.dumps(content, sort_keys=True, separators=(",", ":")) + "\n")
    return plant, proof


def test_a_search_that_finds_nothing_does_not_outweigh_the_checker(
    certify: Certify, narrow: tuple[Path, Path], tmp_path: Path
) -> None:
    for command in (["falsify", *narrow, "--budget", "12"], ["simulate", *narrow, "-o", tmp_path / "out"]):
        answer = certify(*command, "--json")
        assert (answer.code, answer.json["status"]) == (1, "rejected")
        assert answer.json["certificate"]["status"] == "rejected" and answer.json["certificate"]["reason"]
        assert answer.json["reason"].startswith("the checker rejects the certificate: ")
        assert answer.err.splitlines()[0].split()[0] == "verify"
        assert "holds" not in answer.out
        if command[0] == "falsify":
            assert answer.json["result"] == "survived" and "none breaks the claim" in answer.json["searched"]
    assert certify(*command).out.startswith("rejected: ")


def test_a_certificate_of_a_theorem_that_is_not_known_is_rejected(
    certify: Certify, certified: Certified, tmp_path: Path
) -> None:
    content = json.loads(certified.certificate.read_text())
    for theorem, code in (("direct/1", 1), ("guess/1", 1), ("direct/3; rm", 2), (3, 2)):
        path = tmp_path / "c.json"
        path.write_text(json.dumps({**content, "theorem": theorem}, sort_keys=True, separators=(",", ":")) + "\n")
        answer = certify("verify", certified.plant, path)
        assert (answer.code, answer.out, answer.err.count("\n")) == (code, "", 1)
        assert (f"theorem {theorem} is none that this checker knows" in answer.err) == (code == 1)


def test_a_simulation_that_escapes_refutes_a_claim_and_nothing_else(
    certify: Certify, certified: Certified, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a claim an escape is what was simulated; with one it contradicts it; what fails says nothing."""
    from sims import deadline

    real = deadline.settled_run
    for status, with_claim, without in (
        ("escaped", (1, "refuted"), (0, "simulated")),
        ("failed", (3, "inconclusive"), (3, "inconclusive")),
        ("completed", (0, "simulated"), (0, "simulated")),
    ):
        monkeypatch.setattr(
            deadline, "settled_run", lambda *a, status=status, **k: dataclasses.replace(real(*a, **k), status=status)
        )
        for given, expected in (([certified.certificate], with_claim), ([], without)):
            answer = certify("simulate", certified.plant, *given, "-o", tmp_path / "out", "--json")
            assert (answer.code, answer.json["status"], answer.json["run"]) == (*expected, status)


def test_standard_input_and_output_stand_for_files(
    certify: Certify, certified: Certified, monkeypatch: pytest.MonkeyPatch
) -> None:
    def piped(path: Path, *arguments: str | Path) -> Answer:
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(path.read_bytes())))
        return certify(*arguments)

    assert piped(certified.plant, "check", "-").out.endswith("assumptions: holds\n")
    assert piped(certified.plant, "verify", "-", certified.certificate).code == 0
    assert piped(certified.certificate, "verify", certified.plant, "-").code == 0
    assert_one_complaint(piped(certified.plant, "verify", "-", "-"), "only one of PLANT and CERT")
    broken = certify.folder / "broken.toml"
    broken.write_text(certified.plant.read_text().replace("consensus-plant/1", "consensus-plant/0"))
    assert_one_complaint(piped(broken, "check", "-"), "<stdin>", "schema")
    assert_one_complaint(certify("gains", certified.plant, "-o", "-", "--json"), "-o -", "--json")
    assert_one_complaint(certify("run", certified.plant, "-o", "-"), "-o -", "name a folder")


def test_a_certificate_on_standard_output_is_the_file(certified: Certified) -> None:
    command = [sys.executable, "-c", SCRIPT, "gains", str(certified.plant), "-o", "-"]
    done = subprocess.run(command, cwd=EXAMPLE.parent.parent, capture_output=True, check=False)
    assert done.returncode == 0 and done.stdout == certified.certificate.read_bytes()
    assert b"certified: every obligation" in done.stderr


@pytest.mark.parametrize("name", ["r.txt", "r", "r.pdf.svg"])
def test_a_report_is_a_pdf_or_a_page(certify: Certify, certified: Certified, tmp_path: Path, name: str) -> None:
    answer = certify("report", certified.plant, certified.certificate, "-o", tmp_path / name)
    assert_one_complaint(answer, "has to end in .pdf or .html")
    assert list(tmp_path.iterdir()) == []


def test_folders_of_results_are_made(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    place = tmp_path / "new" / "deeper" / "r.pdf"
    assert certify("report", certified.plant, certified.certificate, "-o", place).code == 0
    assert place.read_bytes().startswith(b"%PDF-")


def test_an_interrupted_run_changes_nothing(
    certify: Certify, certified: Certified, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    shutil.copytree(certified.folder, tmp_path / "out")
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    monkeypatch.setattr("reports.document.build_report", interrupt)
    for folder in ("out", "new"):
        plant = certify.plant({"(s - id)^2": "(s - id)^2/3"})
        assert certify("run", plant, "-o", tmp_path / folder, "--budget", "32").code == 130
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    assert not (tmp_path / "new").exists()


def test_run_says_how_much_a_time_limit_has_left(certify: Certify, tmp_path: Path) -> None:
    limited = ("--budget", "1000", "--time-limit", "0.001")
    answer = certify("run", certify.plant(), "-o", tmp_path / "out", "--json", *limited)
    searched = answer.json["falsify"]
    assert answer.code == 0 and (searched["asked"], searched["limited"]) == (1000, True)
    assert [agent["trajectories"] for agent in searched["agents"]] == [256, 256]  # one part of each
    assert "the time limit left out the rest of 2000" in searched["reason"]


def test_run_that_refutes_reports_it_and_drops_the_old_certificate(
    certify: Certify, certified: Certified, tmp_path: Path
) -> None:
    shutil.copytree(certified.folder, tmp_path / "out")
    answer = certify("run", certify.plant({', "2 -> 1"': ""}), "-o", tmp_path / "out", "--json")
    assert (answer.code, answer.json["status"]) == (1, "refuted")
    assert answer.json["reason"].startswith("A2")
    assert (answer.json["gains"], answer.json["claim"], answer.json["verified"]) == (None, None, False)
    assert sorted(os.listdir(tmp_path / "out")) == ["report.html", "report.pdf", "summary.json"]


def test_run_that_cannot_decide_reports_it(certify: Certify, tmp_path: Path) -> None:
    plant = certify.plant({"p*x1": "p*x1 + exp(p*x1^2) - 1"})
    answer = certify("run", plant, "-o", tmp_path / "out", "--route", "recipe", "--json")
    assert (answer.code, answer.json["status"]) == (3, "inconclusive")
    assert answer.json["reason"]
    assert sorted(os.listdir(tmp_path / "out")) == ["report.html", "report.pdf", "summary.json"]


def test_gains_without_a_certificate_writes_nothing(certify: Certify, tmp_path: Path) -> None:
    answer = certify("gains", certify.plant({', "2 -> 1"': ""}), "-o", tmp_path / "c.json", "--json")
    assert (answer.code, answer.json["status"]) == (1, "refuted")
    assert not (tmp_path / "c.json").exists()


def test_simulate_without_strong_connection_says_why_and_stops(certify: Certify, tmp_path: Path) -> None:
    answer = certify("simulate", certify.plant({', "2 -> 1"': ""}), "-o", tmp_path / "out", "--json")
    assert (answer.code, answer.json["status"]) == (3, "inconclusive")
    assert "A2 fails" in answer.json["reason"]


def test_export_carries_the_digest_of_the_claim(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    digest = certified.answer.json["claim"]["sha256"]
    for to, names in (("c", ["agent1.c", "agent2.c"]), ("python", ["agent1.py", "agent2.py"])):
        answer = certify("export", certified.plant, certified.certificate, "--to", to, "-o", tmp_path / to, "--json")
        assert (answer.code, answer.json["status"], answer.json["claim_sha256"]) == (0, "verified", digest)
        assert answer.json["files"] == sorted(os.listdir(tmp_path / to)) and set(names) < set(answer.json["files"])
        for name in names:
            assert digest in (tmp_path / to / name).read_text()
    assert "Nothing is proved about sampling" in (tmp_path / "c" / "consensus.h").read_text()


def test_export_takes_exact_periods(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    words = ["export", certified.plant, certified.certificate, "--to", "python", "-o", tmp_path / "out", "--json"]
    answer = certify(*words, "--period", "1/700", "--coordinator-period", "0.02")
    assert (answer.json["periods"], answer.json["coordinator_period"]) == ({"1": "1/700", "2": "1/700"}, "1/50")
    for option in ("--period", "--coordinator-period"):
        for text in ("0", "-1", "1/0", "soon", "1e999999"):
            assert_one_complaint(certify(*words, option, text), option, "a positive number")
    unfit = certify(*words, "--period", "1/700", "--coordinator-period", "1/701")
    assert (unfit.code, unfit.out) == (2, "") and "coordinator.period: 1/701 is no whole multiple" in unfit.err
    assert_one_complaint(certify(*words, "--arithmetic", "half"), "--arithmetic", "double, single")
    assert_one_complaint(certify(*words[:4], "rust", *words[5:]), "--to", "c, python, fmi")


def test_export_refuses_what_does_not_verify(certify: Certify, certified: Certified, tmp_path: Path) -> None:
    path = tampered(certified, tmp_path)
    answer = certify("export", certified.plant, path, "--to", "c", "-o", tmp_path / "out", "--json")
    assert (answer.code, answer.json["status"]) == (1, "rejected")
    assert "the checker does not accept" in answer.json["reason"] and not (tmp_path / "out").exists()
