"""``python -m tests.promises [--count N] [--seed S]``: does the checker accept what the search thinks it proved?

Random plants without a planted defect through the direct route. A search may end inconclusive, but never because the
checker does not accept its certificate, and never by an exception. Exit 1 if one did.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

from certify import pipeline
from certify.pipeline import design_gains
from symbolic.plant_file import parse_plant

from .refutable.network import Network, healthy, number, oscillator
from .refutable.trial import TooLong

COSTS = (
    "{a}*(s - ({c}))^2",
    "(s - ({c}))^2/4 + log(cosh(s))/{a}",
    "(s - ({c}))^2 + sqrt(1 + s^2)/{a}",
    "{a}*(s - ({c}))^2 + exp(-s^2)/10",
    "s^2/(80*log(s^2 + 2)) + (s - ({c}))^2",
    "sqrt((s - ({c}))^2 + 1/100) + (s - ({c}))^2/{a}",
)
RIGHT_HAND_SIDES = ("p*x1", "p*x{n} - x1", "-x1^3/10 + p*x{n}", "sin(x1) + p*x{n}", "p*x1*x{n}/4", "-x{n} + tanh(p*x1)")
GAINS = ("1", "1 + p^2/4", "{a}", "1/{a}", "2 + sin(p)")


@contextmanager
def limit(seconds: int) -> Iterator[None]:
    """Of processor time, so that the outcome does not depend on what else the machine does."""

    def stop(signum: int, frame: FrameType | None) -> None:
        raise TooLong

    previous = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, previous)


def plant(rng: random.Random) -> Network:
    """One or two agents of order 1 or 2, with costs, gains and forces of several kinds."""
    network = healthy(rng, 1, 2)
    for agent in network.agents:
        agent.order = rng.choice([1, 1, 1, 2])
        choices = {"a": number(rng), "c": number(rng, -9), "n": agent.order}
        agent.cost = rng.choice(COSTS).format(**choices)
        agent.f = rng.choice(RIGHT_HAND_SIDES).format(**choices) + (" + z1" if agent.zero_dynamics else "")
        agent.b = rng.choice(GAINS).format(**choices)
        width = number(rng, 1, 4)
        agent.uncertain = {"p": (str(-width), str(width))}
    if rng.random() < 0.3:
        oscillator(network, rng)
    network.reference = rng.choice(["0", "1", '"-1/2"'])
    network.box = ("-1", "1") if rng.random() < 0.7 else ("-1/10", "1/5")
    return network


def outcome(text: str, seconds: int) -> tuple[str, str]:
    """The status and the reason; ``exception`` and ``too long`` are statuses too."""
    try:
        with limit(seconds):
            result = design_gains(parse_plant(text.encode(), "promise.toml"), "direct")
    except TooLong:
        return "too long", f"{seconds} s of processor time"
    except Exception as fault:  # noqa: BLE001 - that none escapes is what is tested
        return "exception", f"{type(fault).__name__}: {fault}"
    refused = "the checker does not accept" in result.reason
    return ("not accepted" if refused else result.status), result.reason


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.promises", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=int, default=60, help="of processor time per plant")
    options = parser.parse_args(arguments)
    pipeline.processors = lambda: 1  # so that the limit of a plant ends all that it started
    tally: Counter[str] = Counter()
    for k in range(options.count):
        text = plant(random.Random(f"{options.seed}/{k}")).text()
        status, reason = outcome(text, options.seconds)
        tally[status] += 1
        if sys.stderr.isatty() or k % 10 == 9:
            print(f"{k + 1}: {dict(tally)}", file=sys.stderr, flush=True)
        if status != "certified":
            print(f"{k}: {status}: {reason[:300]}", flush=True)
    print(dict(tally))
    return int(tally["not accepted"] + tally["exception"] > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
