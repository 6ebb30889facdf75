"""One worker's part of the corpus."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from itertools import islice

from .bases import Base
from .corpus import corpus, every_number
from .judge import Tally, judge


def share(task: tuple[Sequence[Base], int, int, int, int, float]) -> Tally:
    """Every ``workers``-th mutant; with a count of 0 those of ``every_number``."""
    bases, count, seed, worker, workers, deadline = task
    tally, start = Tally(), time.monotonic()
    mutants = corpus(bases, count, seed) if count else every_number(bases, seed)
    for mutant in islice(mutants, worker, None, workers):
        if time.monotonic() > deadline:
            break
        if judge(bases[mutant.base], mutant, tally) == "accepted wrongly":
            name, reason = bases[mutant.base].name, tally.wrong[-1][0]
            print(f"accepted: {name}: {mutant.operator} at {mutant.path}: {reason}", file=sys.stderr, flush=True)
        if tally.total % 1000 == 0:
            message = f"worker {worker}: {tally.total} after {time.monotonic() - start:.0f} s: {dict(tally.classes)}"
            print(message, file=sys.stderr, flush=True)
    return tally
