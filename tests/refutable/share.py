"""One worker's part of the trials."""

from __future__ import annotations

import sys
import time
from collections import Counter

from certify import pipeline

from .trial import Tally, trial

DIRECT_EVERY = 7  # plants of every kind go through the route "direct" too: 7 has no factor in common with the turns


def share(task: tuple[int, int, int, int, float]) -> Tally:
    """Every ``workers``-th trial, until the deadline."""
    count, seed, worker, workers, deadline = task
    pipeline.processors = lambda: (
        1
    )  # no processes of its own, so that the time limit of a trial ends all that it started
    tally, start = Tally(), time.monotonic()
    for number in range(worker, count, workers):
        if time.monotonic() > deadline:
            break
        trial(seed, number, "direct" if number % DIRECT_EVERY == 0 else "recipe", tally)
        if tally.total % 250 == 0:
            outcomes = sorted(Counter(outcome for _, outcome in tally.outcomes.elements()).items())
            message = f"worker {worker}: {tally.total} after {time.monotonic() - start:.0f} s: {dict(outcomes)}"
            print(message, file=sys.stderr, flush=True)
    return tally
