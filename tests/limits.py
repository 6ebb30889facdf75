"""Witnesses of direct/3 drawn in as far as the checker still accepts them: there a false rule would show first.

Every kernel is scaled down until it touches its response, and every box, line, range and tail is the fixed point of
what the rules themselves ask for. ``refine`` cuts every step in that many first, which brings the bounds close to the
truth. A fixed point may also lie above the witness: then the same design is tried on a larger claim.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import pairwise
from math import ceil
from typing import Any
from unittest import mock

from direct_producer import Json, encode
from scipy.optimize import brentq

from certify.checker.balls import BITS, ball, interval, precision
from certify.checker.certificate import AgentClaim, DirectAgentWitness, read_certificate
from certify.checker.intervals import Interval
from certify.checker.plant import Agent, read_plant
from certify.checker.rules import assumptions, coordinator, first_phase, kernels, loop, tube, zero_ranges
from certify.checker.rules.first_phase import FirstPhase, Sizes
from certify.checker.rules.increments import Increments
from certify.checker.rules.observer import tabulate
from certify.checker.rules.surroundings import Exosystem, Outside
from certify.checker.theorems import kinds
from certify.checker.verdict import start_meter

SLACK = Fraction(1, 2**28)  # relative, and more than what the last round of a fixed point still changes
TINY = Fraction(1, 2**48)
SETTLED = Fraction(1, 2**32)
LARGEST = 1 << 40
ROUNDS, HALVINGS = 400, 24
Row = tuple[Fraction, ...]


class Unsettled(Exception):
    """The rules ask for more and more: with these kernels, rates and grids there is no witness."""


def at_the_limit(plant: bytes, certificate: Json, number: int = 1, refine: int = 1) -> Json:
    """The certificate with the witness of agent ``number`` drawn in; the caller has the checker verify it.

    Raises ``Unsettled``; ``Rejected`` or ``Undecided`` where a rule gives up on the way.
    """
    start_meter(10**15)
    problem = _Problem(plant, certificate, number, refine)
    result = copy.deepcopy(certificate)
    entry, found = result["witness"]["agents"][number - 1], problem.drawn_in()
    entry["kernels"] = _texts(found.kernels)
    entry["phase1"] = {key: _texts(getattr(found.phase1, key)) for key in ("grid", "boxes", "vartheta")}
    entry.update(grid=_texts(found.grid), boxes=_texts(found.boxes), ranges=_texts(found.ranges))
    entry["tail"]["box"] = _texts(found.tail.box)
    return result


class _Problem:
    """Everything the rules for one agent are given, and the witness as far as it is drawn in."""

    def __init__(self, plant: bytes, certificate: Json, number: int, refine: int) -> None:
        model, read = read_plant(plant), read_certificate(encode(certificate), kinds())
        facts = assumptions.prove(model, read)
        witness = read.witness.agents[number - 1]
        assert isinstance(witness, DirectAgentWitness)
        self.name = f"agent {number}"
        self.agent: Agent = model.agents[number - 1]
        self.claim: AgentClaim = read.claim.agents[number - 1]
        self.known, self.optimum = facts.agents[number - 1], facts.optimum
        Q = read.witness.exosystem.Q if read.witness.exosystem else []
        reference = coordinator.prove(model, read, facts)[number - 1].reference
        self.outside = Outside(
            Exosystem(model.S or [], Q, facts.v_at_start, facts.v),
            reference,
            facts.agents[number - 1].steady_nodes,
            self.agent.parameters,
            facts.agents[number - 1].roots,
        )
        self.witness = _refined(witness, self.agent, refine)
        self.loop = loop.build(self.agent, self.claim, witness)

    def drawn_in(self) -> DirectAgentWitness:
        with precision(BITS):
            shares = iter(_Shrink(self.name, self.loop, self.witness).shares())
        table: Any = [
            [[entry * share for entry in c] for c, share in zip(row, shares, strict=False)]
            for row in self.witness.kernels
        ]
        self.witness = replace(self.witness, kernels=table)
        start = self.first_phase()
        self.tube(start)
        return self.witness

    def increments(self) -> Increments:
        ranges = zero_ranges.ZeroRanges(self.name, self.agent, self.witness.ranges)
        return Increments(self.agent, self.optimum, self.known.w, ranges)

    def first_phase(self) -> list[Interval]:
        """Draws in every step of phase 1; magnitudes of ``Y`` at its end."""
        increments = self.increments()
        rule = FirstPhase(
            self.name, self.agent, self.claim, self.witness, self.known, self.outside, increments, tabulate
        )
        X, fastest = rule.at_start(), Interval(0, 0)
        for k in range(len(self.witness.phase1.boxes)):
            X, fastest = self.first_step(rule, k, X, fastest)
        return rule.at_end()

    def first_step(self, rule: FirstPhase, k: int, X: Sizes, fastest: Interval) -> tuple[Sizes, Interval]:
        def needed(theta: float | None = None) -> tuple[float, list[Fraction], list[Fraction]]:
            """By how much the line of ``ϑ`` rises too little, the boxes, and the speeds of the ranges' ends."""
            if theta is not None:
                self.put(k, theta=Fraction(theta))
            rule.phase, rule.increments = self.witness.phase1, self.increments()
            with _asked() as asked:
                rule.step(k, X, fastest)
            by_range = [value for name, value in asked if "outruns" in name]
            rise, *boxes = [value for name, value in asked if "outruns" not in name]
            return float(X.theta.hi + rise - self.witness.phase1.vartheta[k]), boxes, by_range

        length = self.witness.phase1.grid[k + 1] - self.witness.phase1.grid[k]
        for _ in range(ROUNDS):
            before = self.reached_at(k)
            largest = 2 * float(max(before[-1], X.theta.hi))
            while needed(largest)[0] > 0:
                largest *= 2
                if largest > LARGEST:
                    raise Unsettled(f"the line of step {k + 1} of phase 1")
            root = 0.0 if needed(0.0)[0] <= 0 else brentq(lambda theta: needed(theta)[0], 0.0, largest, xtol=1e-13)
            self.put(k, theta=_above(Fraction(root)))
            _, boxes, by_range = needed()
            self.put(k, box=tuple(map(_above, boxes)))
            moved = self.put_range(k, by_range, length)
            if not moved and _same(before, self.reached_at(k)):
                rule.phase, rule.increments = self.witness.phase1, self.increments()
                return rule.step(k, X, fastest)
        raise Unsettled(f"step {k + 1} of phase 1")

    def reached_at(self, k: int) -> Row:
        return (*self.witness.phase1.boxes[k], self.witness.phase1.vartheta[k])

    def put(self, k: int, theta: Fraction | None = None, box: Row | None = None) -> None:
        phase = self.witness.phase1
        if theta is not None:
            phase = replace(phase, vartheta=_with(phase.vartheta, k, theta))
        if box is not None:
            phase = replace(phase, boxes=_with(phase.boxes, k, box))
        self.witness = replace(self.witness, phase1=phase)

    def put_range(self, step: int, speeds: Sequence[Fraction], length: Fraction) -> bool:
        """The ends of ``R`` after the step, and whether they change; ``speeds`` are how fast they have to part."""
        if not speeds:
            return False
        starts = [self.agent.z_box, *self.witness.ranges][step]
        ends = tuple(
            (lo - _above(length * down), hi + _above(length * up))
            for (lo, hi), down, up in zip(starts, speeds[::2], speeds[1::2], strict=True)
        )
        before = self.witness.ranges[step]
        self.witness = replace(self.witness, ranges=_with(self.witness.ranges, step, ends))
        return any(
            abs(a - b) > TINY / 4 for old, new in zip(before, ends, strict=True) for a, b in zip(old, new, strict=True)
        )

    def tube(self, start: list[Interval]) -> None:
        """Draws in every step of the tube, and the tail."""
        with precision(BITS):
            running = _Recorder(self.name, self.loop, self.claim, self.witness, self.known.b, self.increments(), start)
            for k, box in enumerate(self.witness.boxes):
                _settle(partial(self.tube_step, running, k, running.p), tuple(box))
            _settle(partial(self.tail, running), self.witness.tail.box)

    def tube_step(self, running: _Recorder, k: int, p: Any, box: Row) -> list[Fraction]:
        """What the outputs reach on step ``k`` from ``p``, in this box."""
        self.witness = replace(self.witness, boxes=_with(self.witness.boxes, k, box))
        step, length = len(self.witness.phase1.boxes) + k, self.witness.grid[k + 1] - self.witness.grid[k]
        moved = True
        while moved:
            running.witness, running.increments, running.p = self.witness, self.increments(), p
            with _asked() as asked:
                running.step(k, self.outside)
            moved = self.put_range(step, [value for _, value in asked], length)
        return running.reached

    def tail(self, running: _Recorder, box: Row) -> list[Fraction]:
        self.witness = running.witness = replace(self.witness, tail=replace(self.witness.tail, box=box))
        running.tail(self.outside)
        return running.reached


class _Recorder(tube._Tube):
    """The rule of the tube, which says what its outputs reach instead of comparing it."""

    reached: list[Fraction]

    def inside(self, name: str, reached: Sequence[Any], box: Sequence[Fraction]) -> None:
        self.reached = [interval(size).hi for size in reached]


class _Shrink(kernels._Kernels):
    """The rule of the kernels, which finds by how much all coefficients of a pair may be scaled down."""

    def shares(self) -> list[Fraction]:
        full, low, high = self.c, [Fraction(0)] * len(self.pairs), [Fraction(1)] * len(self.pairs)
        for _ in range(HALVINGS):
            middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
            self.c = [[entry * ball(share) for entry in c] for c, share in zip(full, middle, strict=True)]
            self.failing: set[int] = set()
            self.check()
            for pair, share in enumerate(middle):
                (low if pair in self.failing else high)[pair] = share
        return high

    def reject(self, pair: int, *failure: object) -> None:
        self.failing.add(pair)


@contextmanager
def _asked() -> Iterator[list[tuple[str, Fraction]]]:
    """What the rules of phase 1 and of the ranges ask for, by obligation; nothing is rejected."""
    asked: list[tuple[str, Fraction]] = []

    def require(holds: bool, name: str, **numbers: Any) -> None:
        asked.append((name, numbers["needed"].hi))

    with mock.patch.object(first_phase, "require", require), mock.patch.object(zero_ranges, "require", require):
        yield asked


def _settle(attempt: Callable[[Row], list[Fraction]], box: Row) -> None:
    for _ in range(ROUNDS):
        following = tuple(map(_above, attempt(box)))
        if _same(box, following):
            attempt(following)
            return
        box = following
        if max(box) > LARGEST:
            break
    raise Unsettled("a box of the tube")


def _refined(witness: DirectAgentWitness, agent: Agent, parts: int) -> DirectAgentWitness:
    """With every step of both phases, and what is known of ``z`` at its end, cut in equal parts."""

    def cut(grid: Row) -> Row:
        inner = [a + (b - a) * k / parts for a, b in pairwise(grid) for k in range(1, parts + 1)]
        return (grid[0], *inner)

    def repeated(rows: Sequence[Any]) -> tuple[Any, ...]:
        return tuple(row for row in rows for _ in range(parts))

    phase, ranges = witness.phase1, []
    for before, after in pairwise([agent.z_box, *witness.ranges]):
        for k in range(1, parts + 1):
            ranges.append(
                [
                    [a + (b - a) * Fraction(k, parts) for a, b in zip(*ends, strict=True)]
                    for ends in zip(before, after, strict=True)
                ]
            )
    phase = replace(phase, grid=cut(phase.grid), boxes=repeated(phase.boxes), vartheta=repeated(phase.vartheta))
    return replace(witness, phase1=phase, grid=cut(witness.grid), boxes=repeated(witness.boxes), ranges=tuple(ranges))


def _above(value: Fraction) -> Fraction:
    """A short number slightly above."""
    return Fraction(ceil((value + SLACK * abs(value)) * 2**64), 2**64) + TINY


def _with(rows: Sequence[Any], k: int, row: Any) -> Any:
    return (*rows[:k], row, *rows[k + 1 :])


def _same(old: Row, new: Row) -> bool:
    return all(abs(a - b) <= SETTLED * b + TINY / 4 for a, b in zip(old, new, strict=True))


def _texts(value: Any) -> Any:
    return str(value) if isinstance(value, Fraction) else [_texts(entry) for entry in value]
