"""How far the initial box of one agent may grow, with gains that are given (theory.md section 6.3).

What the gains make of the loop (modes, kernels) does not depend on the box, so each trial is the two phases alone.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from certify.tube.loop import LoopGains
from certify.tube.performance import Performances
from certify.tube.reaching import initial_magnitudes
from certify.tube.requirements import Wanted
from certify.tube.trial import AgentTrials, Trial, TrialFailure
from symbolic.plant import InitialBox, Interval, Requirements

LARGEST = 10  # doublings of a side: a certified box a thousand times as wide is as good as the whole space
HALVINGS = 7  # of the last doubling: the factor is within 1 % of where the trials fail
BITS = 8  # of a factor

Factors = tuple[Fraction, ...]


@dataclass(frozen=True)
class Grown:
    """The largest factor of some sides that was found to pass, the box, and what stops a larger one (empty where
    nothing did); the rest is as in the plant file."""

    factor: Fraction
    box: InitialBox
    stopped: str


def scaled(initial: InitialBox, factors: Factors) -> InitialBox:
    """Each side of ``z`` and ``x`` about its centre; ``observer``, ``reference`` and ``eta`` are the designer's."""
    zeros = len(initial.z)
    sides = [_side(side, factor) for side, factor in zip((*initial.z, *initial.x), factors, strict=True)]
    return replace(initial, z=tuple(sides[:zeros]), x=tuple(sides[zeros:]))


def _side(side: Interval, factor: Fraction) -> Interval:
    middle, half = (side.lo + side.hi) / 2, (side.hi - side.lo) / 2
    return Interval(middle - factor * half, middle + factor * half)


def starting_in(trials: AgentTrials, box: InitialBox) -> AgentTrials:
    """The same trials from another box; everything else is shared."""
    moved = copy.copy(trials)
    moved.model = replace(trials.model, agent=replace(trials.model.agent, initial=box))
    moved.initial = initial_magnitudes(moved.model, trials.surroundings)
    return moved


class InitialBoxes:
    """Of one agent with given gains; ``asked`` has to hold from the larger box as well."""

    def __init__(self, trials: AgentTrials, gains: LoopGains, delta: Fraction, asked: Requirements) -> None:
        self.trials, self.gains, self.delta, self.wanted = trials, gains, delta, Wanted(asked)
        self.performances = Performances(trials.model, trials.surroundings)
        self.loop = trials.loop(gains)
        initial = trials.model.agent.initial
        self.stopped = ""
        self.wide = [not side.is_point for side in (*initial.z, *initial.x)]

    def passes(self, factors: Factors) -> Trial | None:
        """The trial from the scaled box, if it passes and meets the requirements."""
        if isinstance(self.loop, TrialFailure):
            self.stopped = self.loop.reason
            return None
        moved = starting_in(self.trials, scaled(self.trials.model.agent.initial, factors))
        found = moved.at(self.loop, self.delta)
        if not isinstance(found, Trial):
            self.stopped = found.reason
            return None
        missed = self.wanted.missed(self.performances.of(found))
        if missed:
            self.stopped = f"requirements.{missed[0].name} is missed"
            return None
        return found

    def uniform(self) -> Grown | None:
        """All sides that are no points, by one factor; ``None`` where not even the plant file's own box passes."""
        return self._largest(tuple(self.wide))

    def along(self, axis: int) -> Grown | None:
        """One side alone; ``None`` for a point."""
        sides = tuple(k == axis for k in range(len(self.wide)))
        return self._largest(sides) if self.wide[axis] else None

    def _largest(self, sides: Sequence[bool]) -> Grown | None:
        def grown(factor: Fraction) -> Factors:
            return tuple(factor if side else Fraction(1) for side in sides)

        self.stopped = ""
        best = largest_factor(lambda factor: self.passes(grown(factor)) is not None)
        if best is None:
            return None
        return Grown(best, scaled(self.trials.model.agent.initial, grown(best)), self.stopped)


def largest_factor(passes: Callable[[Fraction], bool], low: Fraction = Fraction(1)) -> Fraction | None:
    """By doubling, then by bisection; ``None`` where the first one fails. What passes between is not monotone in theory
    but in practice, so what is found is a factor that passes."""
    if not passes(low):
        return None
    high = low * 2
    for _ in range(LARGEST):
        if not passes(high):
            break
        low, high = high, high * 2
    else:
        return low
    for _ in range(HALVINGS):
        middle = _short((low + high) / 2)
        if passes(middle):
            low = middle
        else:
            high = middle
    return low


def _short(value: Fraction) -> Fraction:
    """With a few bits, rounded down."""
    unit = Fraction(2) ** (int(value).bit_length() - BITS)
    return value // unit * unit
