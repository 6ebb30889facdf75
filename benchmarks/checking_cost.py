"""What checking a certificate costs beside producing it, as a ratio of processor time: the goal is at most 5 %.

    python -m benchmarks.checking_cost [--route recipe|direct|both] [PLANT …]

Producing is everything from the parsed plant file to the certificate, as ``certify gains`` does it, in this process
and in those that it starts; the self-check that it ends with is measured apart and not counted as production.
Checking is ``certify.checker.check`` from the bytes of both files to the verdict. Imports are left out on both sides
(they would flatter the checker: it imports next to nothing).
"""

from __future__ import annotations

import argparse
import resource
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from certify.certificate import canonical
from certify.checker import check
from certify.pipeline import design_gains
from symbolic.plant_file import load_plant

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
GOAL = 0.05
REPETITIONS = 3


def seconds(action: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time of this process and of its children that have ended."""
    start = _processor_time()
    result = action()
    return _processor_time() - start, result


def _processor_time() -> float:
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.checking_cost")
    parser.add_argument("--route", choices=["recipe", "direct", "both"], default="both")
    parser.add_argument("plants", nargs="*", type=Path, default=[EXAMPLES / "five_agents.toml"])
    options = parser.parse_args(arguments)
    routes = ["recipe", "direct"] if options.route == "both" else [options.route]
    warm = EXAMPLES / "first_order.toml"
    design_gains(load_plant(warm))  # imports on demand and caches of the libraries
    print(f"{'plant':24}{'route':8}{'produce s':>11}{'check s':>9}{'ratio':>8}{'bytes':>10}   verdict")
    worst = 0.0
    for path in options.plants:
        for route in routes:
            plant = load_plant(path)
            total, result = seconds(lambda plant=plant, route=route: design_gains(plant, route))
            if result.certificate is None:
                print(f"{path.stem:24}{route:8}{total:11.2f}{'':27}   {result.status}")
                continue
            files = path.read_bytes(), canonical(result.certificate) + b"\n"
            found = [seconds(lambda files=files: check(*files)) for _ in range(REPETITIONS)]
            checking, verdict = min(elapsed for elapsed, _ in found), found[0][1]
            producing = total - (checking if SELF_CHECK else 0)
            worst = max(worst, checking / producing)
            print(
                f"{path.stem:24}{route:8}{producing:11.2f}{checking:9.2f}{checking / producing:8.1%}"
                f"{len(files[1]):10}       {verdict.status}"
            )
    print(f"worst ratio {worst:.1%}, goal {GOAL:.0%}")
    return 0


SELF_CHECK = True  # ``design_gains`` gives out no certificate that the checker does not accept


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
