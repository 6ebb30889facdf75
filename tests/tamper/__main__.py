"""``python -m tests.tamper [--count N] [--seed S] [--workers W] [PLANT …]``: exit 0 if no mutant was accepted wrongly
and none was rejected by a fault of the checker, else 1."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from .bases import make_bases, workers_default
from .judge import CLASSES, Tally
from .share import share


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.tamper", description="Tamper with certificates and count what is accepted."
    )
    parser.add_argument("plants", nargs="*", type=Path, help="plant files, by the route direct, in the place of all")
    parser.add_argument("--count", type=int, default=2_000, help="how many mutants")
    parser.add_argument("--every-number", action="store_true", help="instead: every number of every certificate once")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=workers_default())
    parser.add_argument(
        "--minutes", type=float, default=0, help="stop after this long (0: never) and say how many were tried"
    )
    parser.add_argument("-o", "--output", type=Path, help="folder for mutants that were accepted wrongly")
    options = parser.parse_args(arguments)
    start = time.monotonic()
    deadline = start + 60 * options.minutes if options.minutes else float("inf")
    bases = make_bases(options.plants)
    print("certificates:", ", ".join(base.name for base in bases), file=sys.stderr, flush=True)
    count = 0 if options.every_number else options.count
    tasks = [(bases, count, options.seed, worker, options.workers, deadline) for worker in range(options.workers)]
    total = Tally()
    with ProcessPoolExecutor(options.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for tally in pool.map(share, tasks):
            total.add(tally)
    _print(total, time.monotonic() - start)
    for number, (reason, mutant) in enumerate(total.wrong + total.faults):
        print(f"{bases[mutant.base].name}: {mutant.operator} at {mutant.path}: {reason}", file=sys.stderr)
        if options.output:
            options.output.mkdir(parents=True, exist_ok=True)
            (options.output / f"{number}.json").write_bytes(mutant.certificate)
            (options.output / f"{number}.toml").write_bytes(mutant.plant or bases[mutant.base].plant)
    return 1 if total.wrong or total.faults or not total.total else 0


def _print(tally: Tally, seconds: float) -> None:
    print(f"mutants {tally.total} in {seconds:.0f} s, the slowest check {tally.slowest:.1f} s")
    for name in CLASSES:
        print(f"{name:28}{tally.classes[name]:8}")
    print("by part:")
    for part in sorted({part for part, _ in tally.parts}):
        counts = {name: tally.parts[part, name] for name in CLASSES}
        print(f"  {part:24}" + "  ".join(f"{name} {number}" for name, number in counts.items() if number))
    print("rejected by:")
    for obligation, number in tally.obligations.most_common():
        print(f"  {number:7}  {obligation}")
    print(f"faults inside the checker (all of them rejections): {len(tally.faults)}")
    print(
        json.dumps(
            {"mutants": tally.total, **{name: tally.classes[name] for name in CLASSES}, "faults": len(tally.faults)}
        )
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
