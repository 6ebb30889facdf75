"""Interrupt commands of the command line at random moments and look at what is left.

    python -m tests.interruption [--moments N] [--seed S] [--only COMMAND …]

prints one row per command and signal: how often it was interrupted and how often it had finished before, the longest
time from the signal to the end in seconds, and what was wrong (nothing should be). A third of the moments lie in the
first 0.4 s, in which it imports. SIGKILL is for the process that was started, which can say nothing any more: all
others have to end by themselves, and earlier results to stay whole.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = "import sys; from reports.entry import main; sys.exit(main())"
TOKEN = "CERTIFY_TEST_TOKEN"
EARLIER = b"an earlier result\n"
PATIENCE = 60.0  # seconds until a test gives up: no statement on speed

COMMANDS: Mapping[str, tuple[str, ...]] = {
    "run": ("run", "{plant}", "-o", "{out}"),
    "check": ("check", "{plant}"),
    "derive": ("derive", "{plant}"),
    "gains": ("gains", "{plant}", "-o", "{out}/certificate.json"),
    "verify": ("verify", "{plant}", "{certificate}"),
    "simulate": ("simulate", "{plant}", "{certificate}", "-o", "{out}"),
    "falsify": ("falsify", "{plant}", "{certificate}", "-o", "{out}/witness.json"),
    "region": ("region", "{plant}", "{certificate}", "-o", "{out}"),
    "export": ("export", "{plant}", "{certificate}", "--to", "c", "-o", "{out}/code"),
    "report": ("report", "{plant}", "{certificate}", "-o", "{out}/report.pdf"),
    "init": ("init", "-o", "{out}/plant.toml"),
    "normal-form": ("normal-form", "{model}", "-o", "{out}/plant.toml"),
}
RESULTS = (
    "certificate.json",
    "report.pdf",
    "report.html",
    "summary.json",
    "region.svg",
    "witness.json",
    "trajectory.csv",
    "plant.toml",
)
MODEL = """
schema  = "consensus-model/1"
name    = "two-motors"
network = { agents = 2, edges = ["1 -> 2", "2 -> 1"] }
initial = { reference = 0, observer = 0, eta = 0 }
[[agent]]
ids       = [1, 2]
dynamics  = { theta = "omega", omega = "2*i - omega/10", i = "(u - R*i - omega/10)/L" }
output    = "theta"
initial   = { theta = [-0.1, 0.1], omega = 0, i = 0 }
constants = { L = 0.5 }
uncertain = { R = [1, 1.2] }
cost      = "(s - id)^2"
"""
ENDS = {".json": b"}", ".pdf": b"%%EOF", ".svg": b"</svg>"}  # of whole files
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
IMPORTING = 0.4  # seconds in which a third of the moments lie


@dataclass(frozen=True)
class Interrupted:
    """One interruption: exit code, seconds from the signal to the end, and what should not be."""

    code: int
    seconds: float
    faults: tuple[str, ...]

    @property
    def finished(self) -> bool:
        """Whether the command was over before the signal came."""
        return 0 <= self.code < 128


class Running:
    """A command in a process of its own, with a token by which all its processes are known."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.token, self.arguments = uuid.uuid4().hex, arguments
        self.temporary = folder / "tmp"
        self.temporary.mkdir(exist_ok=True)
        keep = {key: value for key, value in os.environ.items() if not key.startswith("MPL")}
        environment = keep | {TOKEN: self.token, "TMPDIR": str(self.temporary), "PYTHONPATH": str(ROOT)}
        self.process = subprocess.Popen(
            [sys.executable, "-c", SCRIPT, *arguments],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def wait_until_watched(self) -> None:
        """Until signals are the supervisor's business: before it has a child, the interpreter is only starting."""
        until(lambda: self.process.poll() is not None or len(self.processes()) > 1)

    def processes(self) -> list[int]:
        """All living processes of the command."""
        return marked(self.token)

    def interrupt(self, number: signal.Signals) -> float:
        """Send the signal; seconds until the command has ended."""
        begun = time.monotonic()
        self.process.send_signal(number)
        self.process.wait(PATIENCE)
        return time.monotonic() - begun


def interrupted(folder: Path, arguments: tuple[str, ...], number: signal.Signals, moment: float) -> Interrupted:
    """Run a command whose output folder ``folder/out`` holds earlier results, and interrupt it after ``moment``."""
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)  # with what an earlier command has written
    out.mkdir()
    for name in RESULTS:
        (out / name).write_bytes(EARLIER)
    running = Running(folder, *arguments)
    running.wait_until_watched()
    try:
        running.process.wait(moment)
    except subprocess.TimeoutExpired:
        seconds = running.interrupt(number)
        if number == signal.SIGKILL:
            seconds = _ended_alone(running)
    else:
        seconds = 0.0
    left = running.processes()
    output, said = running.process.communicate()
    code = running.process.returncode
    if number == signal.SIGKILL and code == -number:
        for name in os.listdir(running.temporary):  # nobody was left who could take them away
            shutil.rmtree(running.temporary / name)
        return Interrupted(code, seconds, tuple(_left_after_a_kill(out, left)))
    if 0 <= code < 128:
        return Interrupted(code, seconds, ())
    return Interrupted(code, seconds, tuple(_faults(running, out, number, code, output, said, left)))


def _ended_alone(running: Running) -> float:
    """Seconds until the processes that a killed one has left behind are gone."""
    begun = time.monotonic()
    until(lambda: not running.processes())
    return time.monotonic() - begun


def _left_after_a_kill(out: Path, left: list[int]) -> Iterator[str]:
    """Whole results, the earlier or the new, are asked for."""
    if left:
        yield f"{len(left)} processes left"
    for name in RESULTS:
        data = (out / name).read_bytes()
        whole = {".json": b"}\n", ".pdf": b"%%EOF", ".svg": b"</svg>\n", ".csv": b"\n", ".toml": b"\n"}
        if data != EARLIER and not data.rstrip().endswith(whole[(out / name).suffix].rstrip()):
            yield f"a part of {name}"


def _faults(
    running: Running, out: Path, number: signal.Signals, code: int, output: str, said: str, left: list[int]
) -> Iterator[str]:
    if code != 128 + number:
        yield f"exit code {code}"
    if left:
        yield f"{len(left)} processes left"
    lines = [line for line in said.splitlines() if line.startswith("certify: ")]
    if len(lines) != 1 or said.splitlines()[-1:] != lines:
        yield f"stderr ends with {said[-300:]!r}"
    if "Traceback" in said or "Error" in said or output:
        yield f"said {said[-300:]!r}, printed {output[:100]!r}"
    if os.listdir(running.temporary):
        yield f"temporary files {os.listdir(running.temporary)}"
    files = [path for path in out.rglob("*") if path.is_file()]
    if any(path.name.startswith(".") for path in files):
        yield f"files {sorted(path.name for path in files)}"
    new = {path.name for path in files if path.read_bytes() != EARLIER}
    if new and "run" in running.arguments and not {"report.pdf", "summary.json"} <= new:
        yield f"only {sorted(new)} are new"


def marked(token: str) -> list[int]:
    """The living processes with the token in their environment."""
    mark = f"{TOKEN}={token}".encode()
    return [pid for pid in _pids() if mark in _environment(pid)]


def until(condition: object) -> None:
    """Wait for a condition (a function without arguments) to hold."""
    begun = time.monotonic()
    while not condition():  # type: ignore[operator]
        if time.monotonic() - begun > PATIENCE:
            raise TimeoutError("the condition has not come true")
        time.sleep(0.005)


def _pids() -> list[int]:
    return [int(name) for name in os.listdir("/proc") if name.isdigit()]


def _environment(pid: int) -> bytes:
    dead = b") Z " in _read(f"/proc/{pid}/stat")
    return b"" if dead else _read(f"/proc/{pid}/environ")


def _read(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError:  # it has ended, or is someone else's
        return b""


def duration(folder: Path, arguments: tuple[str, ...]) -> float:
    """How long the command takes when nobody interrupts it."""
    begun = time.monotonic()
    running = Running(folder, *arguments)
    running.process.communicate()
    return time.monotonic() - begun


def arguments_of(command: str, plant: Path, certificate: Path, folder: Path) -> tuple[str, ...]:
    names = {"plant": plant, "certificate": certificate, "out": folder / "out", "model": folder / "model.toml"}
    names["model"].write_text(MODEL)
    return tuple(part.format(**names) for part in COMMANDS[command])


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--moments", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--plant", type=Path, default=ROOT / "examples" / "first_order.toml")
    parser.add_argument("--only", nargs="+", choices=list(COMMANDS), default=list(COMMANDS))
    options = parser.parse_args()
    generator, wrong = random.Random(options.seed), 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        certificate = folder / "certificate.json"
        duration(folder, ("gains", str(options.plant), "-o", str(certificate)))
        for command in options.only:
            arguments = arguments_of(command, options.plant, certificate, folder)
            usual = duration(folder, arguments)
            for number in SIGNALS:
                early = options.moments // 3
                moments = [generator.uniform(0.0, 0.95 * usual) for _ in range(options.moments - early)]
                moments += [generator.uniform(0.0, min(IMPORTING, usual)) for _ in range(early)]
                found = [interrupted(folder, arguments, number, moment) for moment in moments]
                stopped = [one for one in found if not one.finished]
                faults = [fault for one in found for fault in one.faults]
                wrong += len(faults)
                slowest = max((one.seconds for one in stopped), default=0.0)
                print(
                    f"| `{command}` | {number.name} | {len(stopped)} | {len(found) - len(stopped)} | {slowest:.2f} s | "
                    f"{'; '.join(faults) or 'nothing'} |",
                    flush=True,
                )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
