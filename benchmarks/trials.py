"""What one trial of gains of route "direct" costs, in milliseconds of processor time, and where it goes.

    python -m benchmarks.trials [PLANT …]

Every agent is tried at a few gains, some of which pass; the search for gains makes some dozen trials per agent. The
least of three repetitions counts. ``kernels`` are the majorants of the nominal loop, ``reaching`` and ``tube`` the two
phases over all saturation levels that were tried, ``share`` is the time of a trial over that of the first in the table.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any
from unittest.mock import patch

from certify.assumptions.check import check_assumptions
from certify.preparation import Stopped, prepare
from certify.tube import trial as parts
from certify.tube.loop import LoopGains
from certify.tube.reaching import Reaching
from certify.tube.trial import AgentTrials, Trial
from symbolic.plant_file import load_plant

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
GAINS = ((3, 300, 25), (3, 30, 25), (6, 12, 30), (8, 110, 8))  # g, K, h/K
REPETITIONS = 3


class Clock:
    """Wraps functions and adds up the processor time spent in them."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*arguments: Any) -> Any:
            begin = time.process_time()
            result = function(*arguments)
            self.spent[name] = self.spent.get(name, 0.0) + time.process_time() - begin
            return result

        return wrapped


def one_trial(trials: AgentTrials, gains: LoopGains) -> tuple[dict[str, float], str]:
    """Seconds by part, and what came of it."""
    clock = Clock()
    with (
        patch.object(parts, "kernels", clock.timed("kernels", parts.kernels)),
        patch.object(parts, "tube", clock.timed("tube", parts.tube)),
        patch.object(Reaching, "run", clock.timed("reaching", Reaching.run)),
    ):
        result = clock.timed("trial", trials.attempt)(gains)
    return clock.spent, f"delta = {float(result.delta):.4g}" if isinstance(result, Trial) else result.reason


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trials")
    parser.add_argument("plants", nargs="*", type=Path, default=[EXAMPLES / "five_agents.toml"])
    columns, unit = ("trial", "kernels", "reaching", "tube"), None
    print(f"{'agent':26}{'g, K, h':>14}" + "".join(f"{name:>10}" for name in columns) + f"{'share':>7}   result")
    for path in parser.parse_args(arguments).plants:
        plant = load_plant(path)
        prepared = prepare(plant, check_assumptions(plant), lambda message: None, frozenset({"A6"}))
        if isinstance(prepared, Stopped):
            print(f"{path.stem:26}{prepared.status}: {prepared.reason}")
            continue
        for index, model in enumerate(prepared.models):
            if isinstance(model, str):
                continue
            trials = AgentTrials(model, prepared.coordinator.envelope, index)
            for g, K, ratio in GAINS:
                gains = LoopGains(Fraction(g), Fraction(K), Fraction(K * ratio) if model.order > 1 else None)
                spent, result = min(
                    (one_trial(trials, gains) for _ in range(REPETITIONS)), key=lambda found: found[0]["trial"]
                )
                unit = unit or spent["trial"]
                named = f"{path.stem} {model.agent.id}"
                row = f"{named:26}{f'{g}, {K}, {gains.h}':>14}"
                row += "".join(f"{1e3 * spent.get(name, 0.0):10.1f}" for name in columns)
                print(f"{row}{spent['trial'] / unit:7.2f}   {result}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
