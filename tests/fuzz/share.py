"""One worker's inputs, and a self-test of the watch."""

from __future__ import annotations

import random
import resource
import sys
import time
from pathlib import Path

from .inputs import Input, make
from .mutated_plants import mutated_plant
from .readers import Tally, Touched, _limits, feed, watch
from .valid_plants import valid_plant

ROOT = Path(__file__).parents[2]
CORPUS = (ROOT / "examples", ROOT / "tests" / "tamper" / "plants")


def plants() -> list[bytes]:
    return [path.read_bytes() for folder in CORPUS for path in sorted(folder.glob("*.toml"))]


def watched(certificates: list[bytes]) -> bool:
    """Start the watch after everything that is imported on demand has been imported; does it see what it should?"""
    warm = Tally()
    for data in plants():
        feed(Input("plant", "valid", data), warm)
    for data in certificates:
        feed(Input("certificate", "valid", data), warm)
    for number in range(300):
        feed(make(random.Random(f"warm/{number}"), plants(), certificates), warm)
    watch()
    try:
        with _limits():
            eval("1")  # noqa: S307 - the trap is shown to spring
    except Touched:
        return True
    return False


def meaning(rng: random.Random, number: int) -> Input:
    """In turn a whole plant file that is valid, or wrong only in a name, and one that is a few steps away from it."""
    if number % 2:
        return Input("plant", "mutated", mutated_plant(rng))
    return Input("plant", "meaning", valid_plant(rng))


def share(task: tuple[list[bytes], int, int, int, int, float, bool]) -> Tally:
    """Every ``workers``-th input, until the deadline; only whole plant files if ``meanings``."""
    certificates, count, seed, worker, workers, deadline, meanings = task
    tally, seeds, start = Tally(), plants(), time.monotonic()
    if not watched(certificates):
        raise RuntimeError("the audit hook does not see code that is run")
    for number in range(worker, count, workers):
        if time.monotonic() > deadline:
            break
        rng = random.Random(f"{seed}/{number}")
        feed(meaning(rng, number) if meanings else make(rng, seeds, certificates), tally)
        if tally.inputs % 5000 == 0:
            print(
                f"worker {worker}: {tally.inputs} after {time.monotonic() - start:.0f} s, {len(tally.faults)} faults, "
                f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10} MB",
                file=sys.stderr,
                flush=True,
            )

    return tally
