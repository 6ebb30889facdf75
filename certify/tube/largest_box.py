"""Gains within the requirements for which the certified initial box of one agent is largest (``region = "largest"``).

The box grows step by step about its centre, and the gains follow: at each size the first change of one gain that passes
and meets the requirements is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction

from certify.tube.initial_boxes import LARGEST, scaled, starting_in
from certify.tube.loop import LoopGains
from certify.tube.performance import Performances
from certify.tube.requirements import STRIDES, Descent, Wanted, largest_h
from certify.tube.trial import AgentTrials, Trial
from symbolic.plant import RequestedGains, Requirements

MOST_TRIALS = 60  # about as many as the search before
GROWTHS = tuple(map(Fraction, ("2", "3/2", "5/4", "9/8")))


@dataclass(frozen=True)
class Largest:
    """The gains as a trial from the plant file's own box, and the factor by which that box may grow with them."""

    trial: Trial
    factor: Fraction
    tried: int


def largest_box(
    trials: AgentTrials,
    start: Trial,
    requested: RequestedGains,
    asked: Requirements,
    report: Callable[[str], None] = lambda message: None,
) -> Largest:
    """From a trial that meets the requirements; at worst it is what comes out."""
    performances, wanted = Performances(trials.model, trials.surroundings), Wanted(asked)
    initial, cap = trials.model.agent.initial, largest_h(performances, asked)
    best, factor, tried = start, Fraction(1), 0
    reached = [Largest(start, factor, 0)]
    for growth in GROWTHS:
        grows = True
        while grows and tried < MOST_TRIALS and factor < 2**LARGEST:
            grows = False
            size = factor * growth
            sides = tuple(Fraction(1) if side.is_point else size for side in (*initial.z, *initial.x))
            moved = starting_in(trials, scaled(initial, sides))
            report(f"box times {float(size):.3g}")
            for gains, delta in _candidates(Descent(moved, performances, requested, report, cap), best):
                tried += 1
                found = moved.attempt(gains, delta, best)
                if isinstance(found, Trial) and wanted.missed(performances.of(found)) and requested.delta is None:
                    found = moved.tightened(found)
                if isinstance(found, Trial) and not wanted.missed(performances.of(found)):
                    best, factor, grows = found, size, True
                    own = trials.attempt(found.gains, found.delta)
                    if isinstance(own, Trial) and not wanted.missed(performances.of(own)):
                        reached.append(Largest(own, factor, tried))
                    break
                if tried >= MOST_TRIALS:
                    break
    return max(reached, key=lambda one: one.factor)


def _candidates(descent: Descent, best: Trial) -> Iterator[tuple[LoopGains, Fraction | None]]:
    """The gains as they are, then one change."""
    yield best.gains, descent.requested.delta
    for stride in STRIDES[:2]:
        for gains, delta in descent.moves(best, stride, descent.cap):
            if gains != best.gains:
                yield gains, delta
