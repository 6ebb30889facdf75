"""``python -m tests.refutable [--count N] [--seed S] [--workers W]``: exit 0 if none was certified
and none ended in an exception, else 1."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from .defects import COSTLY, DEFECTS
from .share import share
from .trial import Tally


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.refutable", description="Ask for certificates that cannot be true."
    )
    parser.add_argument("--count", type=int, default=400, help="how many plants")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=max(1, min(2, os.cpu_count() or 1)))
    parser.add_argument(
        "--minutes", type=float, default=0, help="stop after this long (0: never) and say how many were tried"
    )
    parser.add_argument(
        "-o", "--output", type=Path, help="folder for plants that were certified or ended in an exception"
    )
    options = parser.parse_args(arguments)
    start = time.monotonic()
    deadline = start + 60 * options.minutes if options.minutes else float("inf")
    tasks = [(options.count, options.seed, worker, options.workers, deadline) for worker in range(options.workers)]
    total = Tally()
    with ProcessPoolExecutor(options.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for tally in pool.map(share, tasks):
            total.add(tally)
    _print(total, time.monotonic() - start)
    for number, (name, reason, text) in enumerate(total.certified + total.faults):
        print(f"{name}: {reason[:300]}", file=sys.stderr)
        if options.output:
            options.output.mkdir(parents=True, exist_ok=True)
            (options.output / f"{name}-{number}.toml").write_text(text)
    return 1 if total.certified or total.faults or not total.total else 0


def _print(tally: Tally, seconds: float) -> None:
    print(f"plants {tally.total} in {seconds:.0f} s, the slowest {tally.slowest:.1f} s")
    for defect in (*DEFECTS, *COSTLY):
        counts = {
            outcome: number for (name, outcome), number in sorted(tally.outcomes.items()) if name == defect.__name__
        }
        print(f"  {defect.__name__:34}" + "  ".join(f"{outcome} {number}" for outcome, number in counts.items()))
    outcomes: Counter[str] = Counter()
    for (_, outcome), number in tally.outcomes.items():
        outcomes[outcome] += number
    print(json.dumps({"plants": tally.total, **dict(sorted(outcomes.items())), "certified": outcomes["certified"]}))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
