"""The readers under watch: what they raise, how long they take, and what they touch on the way."""

from __future__ import annotations

import resource
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from certify.checker import check
from certify.checker.certificate import read_certificate
from certify.checker.plant import Plant, read_plant
from certify.checker.theorems import kinds
from certify.checker.verdict import Malformed
from symbolic.errors import InputError
from symbolic.plant_file import parse_plant

from .agreement import difference, harmless
from .inputs import Input

ANOTHER = (Path(__file__).parents[1] / "checker_corpus" / "first_order.json").read_bytes()
SECONDS = 10
GIGABYTE = 1 << 30
FORBIDDEN = (
    "exec",
    "compile",
    "import",
    "open",
    "os.",
    "subprocess.",
    "socket.",
    "ctypes.",
    "shutil.",
    "tempfile.",
    "code.",
    "marshal.",
    "pickle.",
)


class TooLong(BaseException):
    """A reader took more than ``SECONDS`` of processor time."""


class Touched(BaseException):
    """A reader ran code, imported a module or opened a file."""


@dataclass
class Tally:
    """Outcomes by reader and kind of input; faults with the input that caused them; disagreements of the two plant
    readers; how many files the tool's reader refuses only because it will not compute with them."""

    outcomes: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    faults: list[tuple[str, bytes]] = field(default_factory=list)
    disagreements: list[tuple[str, bytes]] = field(default_factory=list)
    beyond_the_tool: int = 0
    slowest: float = 0.0
    memory: int = 0
    inputs: int = 0

    def add(self, other: Tally) -> None:
        self.outcomes += other.outcomes
        self.faults += other.faults
        self.disagreements += other.disagreements
        self.beyond_the_tool += other.beyond_the_tool
        self.slowest, self.memory = max(self.slowest, other.slowest), max(self.memory, other.memory)
        self.inputs += other.inputs


_watching = False


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    global _watching
    if _watching and event.startswith(FORBIDDEN):
        _watching = False
        raise Touched(f"{event} {arguments!r:.200}")


def watch() -> None:
    """Install the audit hook and the memory limit in this process. An audit hook cannot be removed."""
    sys.addaudithook(_audit)
    resource.setrlimit(resource.RLIMIT_AS, (_size_now() + GIGABYTE, resource.RLIM_INFINITY))


def _size_now() -> int:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[0]) * resource.getpagesize()


@contextmanager
def _limits() -> Iterator[None]:
    global _watching

    def stop(signum: int, frame: FrameType | None) -> None:
        raise TooLong

    previous = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    _watching = True
    try:
        yield
    finally:
        _watching = False
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, previous)


def read(
    name: str, reader: Callable[[bytes], Any], refusal: type[Exception], given: Input, tally: Tally
) -> tuple[str, Any]:
    """``accepted`` with what was read, ``refused`` with the reason, or ``fault``."""
    start, result = time.process_time(), None
    try:
        with _limits():
            result = reader(given.data)
        outcome = "accepted"
    except refusal as reason:
        outcome, result = "refused", str(reason)
        lines = getattr(reason, "lines", (str(reason),))
        if any("\n" in line or len(line) > 2000 for line in lines) or len(lines) > 51:
            outcome = "fault"
            tally.faults.append(
                (f"{name}: a message of {len(str(reason))} characters, not one line: {str(reason)!r:.200}", given.data)
            )
    except (TooLong, Touched) as fault:
        outcome = "fault"
        tally.faults.append((f"{name}: {type(fault).__name__}: {fault}", given.data))
    except Exception as fault:  # noqa: BLE001 - every exception that reaches a user is a fault to be counted
        outcome = "fault"
        tally.faults.append((f"{name}: {type(fault).__name__}: {fault}"[:300], given.data))
    tally.slowest = max(tally.slowest, time.process_time() - start)
    tally.outcomes[name, given.how, outcome] += 1
    return outcome, result


def checker_reads(data: bytes) -> Plant:
    """What the checker makes of a plant file, asked at its door with a certificate about another plant."""
    verdict = check(data, ANOTHER)
    if verdict.status == "malformed":
        raise Malformed(verdict.detail)
    if verdict.obligation == "unexpected":
        raise RuntimeError(verdict.detail)
    return read_plant(data)


def feed(given: Input, tally: Tally) -> None:
    """The input to the reader it is meant for; a plant file to both plant readers, which must agree."""
    tally.inputs += 1
    if given.kind == "certificate":
        read("certificate reader", lambda data: read_certificate(data, kinds()), Malformed, given, tally)
    else:
        mine = read("checker's plant reader", checker_reads, Malformed, given, tally)
        theirs = read("plant reader", lambda data: parse_plant(data, "fuzz.toml"), InputError, given, tally)
        if "fault" not in (mine[0], theirs[0]) and (reason := difference(mine, theirs)) is not None:
            if harmless(reason):
                tally.beyond_the_tool += 1
            else:
                tally.disagreements.append((reason, given.data))
    tally.memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
