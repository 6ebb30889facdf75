"""``python -m certify.checker``: one line and exit code 0, 1 or 2, with nothing imported but itself."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from certify.checker import __main__ as command
from certify.checker import check

ROOT = Path(__file__).parent.parent
CORPUS = Path(__file__).parent / "checker_corpus"
FOREIGN = (
    "numpy",
    "scipy",
    "sympy",
    "cvxpy",
    "clarabel",
    "networkx",
    "matplotlib",
    "numba",
    "typer",
    "rich",
    "typst",
    "mpmath",
)


def run(*arguments: object, code: str = "") -> subprocess.CompletedProcess[str]:
    program = ["-c", code] if code else ["-m", "certify.checker"]
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    return subprocess.run(
        [sys.executable, *program, *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=environment,
    )


def test_success_is_one_line() -> None:
    plant, certificate = CORPUS / "mixed.toml", CORPUS / "mixed.json"
    done = run(plant, certificate)
    digest = check(plant.read_bytes(), certificate.read_bytes()).claim_sha256
    assert (done.returncode, done.stdout, done.stderr) == (0, f"VERIFIED {digest}\n", "")


def test_a_rejection_is_one_line_on_stderr(tmp_path: Path) -> None:
    certificate = tmp_path / "certificate.json"
    certificate.write_bytes((CORPUS / "mixed.json").read_bytes().replace(b'"a0":"1"', b'"a0":"2"'))
    done = run(CORPUS / "mixed.toml", certificate)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "rejected: agent 1: A6: V0 J + JᵀV0 ⪯ −a0 I: J = [[-3/2]], a0 = 2\n"


@pytest.mark.parametrize("content", [b"", b"{}\n", b"[" * 100_000, b"\x00\xff", b'{"a\\nb\\u001b[0m":"\\u2028"}\n'])
def test_bad_input_is_one_line_on_stderr(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "file").write_bytes(content)
    for arguments in ([tmp_path / "file", CORPUS / "mixed.json"], [CORPUS / "mixed.toml", tmp_path / "file"]):
        done = run(*arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert (
            done.stderr.startswith("malformed: ") and done.stderr.endswith("\n") and len(done.stderr.splitlines()) == 1
        )
        assert len(done.stderr) < 700 and "\x1b" not in done.stderr


@pytest.mark.parametrize("arguments", [[], ["a"], ["a", "b", "c"]])
def test_usage(arguments: list[str]) -> None:
    done = run(*arguments)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "usage: python -m certify.checker PLANT CERT\n")


@pytest.mark.parametrize("path", ["missing.toml", ".", "bad\0name"])
def test_files_that_cannot_be_read(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main([path, str(CORPUS / "mixed.json")]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.startswith("malformed: ")


LOADED = """
import sys
from certify.checker.__main__ import main
code = main(sys.argv[1:])
print(" ".join(sorted(sys.modules)))
sys.exit(code)
"""


def test_nothing_of_the_project_and_nothing_heavy_is_imported() -> None:
    done = run(CORPUS / "mixed.toml", CORPUS / "mixed.json", code=LOADED)
    assert done.returncode == 0
    modules = done.stdout.splitlines()[1].split()
    own = {name for name in modules if name.split(".")[0] in ("certify", "symbolic", "sims", "reports")}
    assert all(name == "certify" or name.startswith("certify.checker") for name in own)
    assert not [name for name in modules if name.split(".")[0] in FOREIGN]


def test_a_polynomial_plant_needs_the_standard_library_only() -> None:
    """Without sin, cos, tan, log and atan not even python-flint is loaded."""
    code = LOADED.replace("import sys", "import sys\nsys.modules['flint'] = None\n", 1)
    done = run(CORPUS / "polynomial.toml", CORPUS / "polynomial.json", code=code)
    assert done.returncode == 0, done.stderr
    blocked = run(CORPUS / "mixed.toml", CORPUS / "mixed.json", code=code)
    assert blocked.returncode == 1 and "ModuleNotFoundError" in blocked.stderr
