"""One refutable plant through the whole tool, within a time limit."""

from __future__ import annotations

import random
import signal
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType

from certify.certificate import canonical
from certify.checker import check
from certify.pipeline import design_gains
from symbolic.errors import InputError
from symbolic.plant_file import parse_plant

from .defects import defect_of

SECONDS = 60


class TooLong(BaseException):
    """The tool took more than ``SECONDS``; not an ``Exception``, so that nothing in the tool takes it for its own."""


@dataclass
class Tally:
    """Outcomes by defect, and the plants that must be looked at: certified, or ended by an exception."""

    outcomes: Counter[tuple[str, str]] = field(default_factory=Counter)
    certified: list[tuple[str, str, str]] = field(default_factory=list)
    faults: list[tuple[str, str, str]] = field(default_factory=list)
    slowest: float = 0.0

    @property
    def total(self) -> int:
        return sum(self.outcomes.values())

    def add(self, other: Tally) -> None:
        self.outcomes += other.outcomes
        self.certified += other.certified
        self.faults += other.faults
        self.slowest = max(self.slowest, other.slowest)


def plant_text(seed: int, number: int) -> tuple[str, str]:
    """The defect and the plant file of one trial; the defects take turns."""
    defect = defect_of(number)
    return defect.__name__, defect(random.Random(f"{seed}/{number}")).text()


def attempt(text: str, route: str, seconds: int = SECONDS) -> tuple[str, str]:
    """``refuted``, ``inconclusive``, ``bad input``, ``too long``, ``exception``, ``certificate rejected`` or
    ``certified``, with a reason."""
    try:
        with _limit(seconds):
            result = design_gains(parse_plant(text.encode(), "refutable.toml"), route)
            if result.certificate is None:
                return result.status, result.reason
            verdict = check(text.encode(), canonical(result.certificate) + b"\n")
    except InputError as error:
        return "bad input", str(error)
    except TooLong:
        return "too long", f"more than {seconds} s"
    except Exception as error:  # noqa: BLE001 - a crash is an outcome to be counted
        return "exception", f"{type(error).__name__}: {error}"
    return ("certified" if verdict.status == "verified" else "certificate rejected"), f"{result.reason}; {verdict}"


def trial(seed: int, number: int, route: str, tally: Tally) -> None:
    name, text = plant_text(seed, number)
    start = time.perf_counter()
    outcome, reason = attempt(text, route)
    tally.slowest = max(tally.slowest, time.perf_counter() - start)
    tally.outcomes[name, outcome] += 1
    if outcome in ("certified", "certificate rejected"):
        tally.certified.append((name, reason, text))
    if outcome in ("exception", "bad input"):
        tally.faults.append((name, reason, text))


@contextmanager
def _limit(seconds: int) -> Iterator[None]:
    def stop(signum: int, frame: FrameType | None) -> None:
        raise TooLong

    previous = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)
