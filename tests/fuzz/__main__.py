"""``python -m tests.fuzz [--count N] [--seed S] [--workers W] [--meanings]``: exit 0 if no reader failed, else 1."""

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

from tests.tamper.bases import encode, make_base, small_plants

from .readers import Tally
from .share import share


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description="Feed broken input to the readers.")
    parser.add_argument("--count", type=int, default=5_000, help="how many inputs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=max(1, min(2, os.cpu_count() or 1)))
    parser.add_argument(
        "--minutes", type=float, default=0, help="stop after this long (0: never) and say how many were read"
    )
    parser.add_argument("-o", "--output", type=Path, help="folder for inputs that caused a fault or a disagreement")
    parser.add_argument("--meanings", action="store_true", help="whole plant files only, whose readings are compared")
    options = parser.parse_args(arguments)
    certificates = [encode(base.certificate) for base in map(make_base, small_plants()) if base is not None]
    start = time.monotonic()
    deadline = start + 60 * options.minutes if options.minutes else float("inf")
    tasks = [
        (certificates, options.count, options.seed, worker, options.workers, deadline, options.meanings)
        for worker in range(options.workers)
    ]
    total = Tally()
    with ProcessPoolExecutor(options.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for tally in pool.map(share, tasks):
            total.add(tally)
    _print(total, time.monotonic() - start)
    for number, (reason, data) in enumerate(total.faults + total.disagreements):
        print(reason[:300], file=sys.stderr)
        if options.output:
            options.output.mkdir(parents=True, exist_ok=True)
            (options.output / f"{number}.bin").write_bytes(data)
    return 1 if total.faults or total.disagreements or not total.inputs else 0


def _print(tally: Tally, seconds: float) -> None:
    print(
        f"inputs {tally.inputs} in {seconds:.0f} s, the slowest {tally.slowest:.1f} s, "
        f"memory of a worker at most {tally.memory >> 10} MB"
    )
    for (reader, how, outcome), number in sorted(tally.outcomes.items()):
        print(f"  {reader:24}{how:12}{outcome:10}{number:8}")
    kinds = Counter(reason.partition(" (")[0].partition(": ")[0] for reason, _ in tally.disagreements)
    print(f"files that the tool's reader alone refuses, since it will not compute with them: {tally.beyond_the_tool}")
    print(f"the two plant readers disagree on {len(tally.disagreements)} files: {dict(kinds)}")
    print(
        json.dumps(
            {
                "inputs": tally.inputs,
                "faults": len(tally.faults),
                "disagreements": len(tally.disagreements),
                "beyond_the_tool": tally.beyond_the_tool,
                "slowest_seconds": round(tally.slowest, 2),
                "memory_megabytes": tally.memory >> 10,
            }
        )
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
