"""Sections 5 and 6 of docs/certificate-direct.md: the comparison system on the grid, and its tail.

``|output i| ≤ Σ_a p_ia``, ``p_ia' = −μ_a p_ia + Σ_j c_ija |q_j|``; the ``p_ia`` may be of either sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import reduce

from flint import arb, arb_mat

from certify.checker.balls import BITS, above, ball, precision, shown
from certify.checker.certificate import AgentClaim, DirectAgentWitness
from certify.checker.intervals import Interval, enclose
from certify.checker.rules.increments import Increments, Slopes, increment
from certify.checker.rules.loop import Loop
from certify.checker.rules.surroundings import Outside, Surroundings
from certify.checker.verdict import Rejected, Undecided, require, spend

ZERO, ONE = arb(0), arb(1)
SUBSTEPS = 10


def prove(
    name: str,
    loop: Loop,
    claim: AgentClaim,
    witness: DirectAgentWitness,
    b: Interval,
    outside: Outside,
    increments: Increments,
    at_start: Sequence[Interval],
) -> None:
    """From the magnitudes of ``Y`` at ``T1`` on, for ever. Raises ``Rejected``."""
    with precision(BITS):
        tube = _Tube(name, loop, claim, witness, b, increments, at_start)
        for k in range(len(witness.boxes)):
            tube.step(k, outside)
        tube.tail(outside)


class _Tube:
    def __init__(
        self,
        name: str,
        loop: Loop,
        claim: AgentClaim,
        witness: DirectAgentWitness,
        b: Interval,
        increments: Increments,
        at_start: Sequence[Interval],
    ) -> None:
        self.name, self.loop, self.claim, self.witness, self.increments = name, loop, claim, witness, increments
        self.nominal_f0 = [[-enclose(slope) for slope in row] for row in witness.nominal.f0]
        self.nominal_f1 = [-enclose(slope) for slope in witness.nominal.f1]
        self.surplus = (b - enclose(witness.nominal.b)).magnitude
        self.rates = [ball(rate) for rate in witness.rates]
        forced = loop.nz + 2
        spend(20 * len(witness.kernels) * len(witness.rates) * (len(at_start) + len(witness.boxes) * (forced + 10)))
        self.force = self.matrix(0, forced)
        initial = self.matrix(forced, forced + loop.size)
        self.p = self.by_output(initial * arb_mat([[above(size)] for size in at_start]))

    def matrix(self, first: int, last: int) -> arb_mat:
        """The coefficients ``c_ija`` of some columns, one row per output and rate."""
        return arb_mat(
            [
                [ball(column[a]) for column in columns[first:last]]
                for columns in self.witness.kernels
                for a in range(len(self.rates))
            ]
        )

    def by_output(self, column: arb_mat) -> list[list[arb]]:
        """The entries of one output after those of the other, one per rate."""
        entries, count = column.entries(), len(self.rates)
        return [entries[at : at + count] for at in range(0, len(entries), count)]

    def sizes(self, box: Sequence[Fraction]) -> tuple[list[Interval], list[Interval]]:
        """Of ``z̄`` and ``x̄``."""
        sizes = [enclose(size).upper for size in box[: self.loop.nz + self.loop.n]]
        return sizes[: self.loop.nz], sizes[self.loop.nz :]

    def forcing(self, box: Sequence[Fraction], around: Surroundings, slopes: Slopes) -> list[list[arb]]:
        """``Σ_j c_ija q_j`` with the ``q_j`` of section 3 over the box."""
        z, x = self.sizes(box)
        q = [
            increment(row, nominal, z, x, around.distance)
            for row, nominal in zip(slopes.f0, self.nominal_f0, strict=True)
        ]
        q.append((increment(slopes.f1, self.nominal_f1, z, x, around.distance) + self.surplus * box[-1]).upper)
        q.append(around.speed)
        return self.by_output(self.force * arb_mat([[above(entry)] for entry in q]))

    def step(self, k: int, outside: Outside) -> None:
        start, end, box = self.witness.grid[k], self.witness.grid[k + 1], self.witness.boxes[k]
        name = f"{self.name}: tube: step {k + 1}"
        try:
            around, index = outside.during(start, end), len(self.witness.phase1.boxes) + k
            slopes = self.increments.on_step(index, end - start, around, *self.sizes(box))
            forcing = self.forcing(box, around, slopes)
        except Undecided as reason:
            raise Rejected(name, str(reason)) from None
        limits = [[phi / rate for phi, rate in zip(phis, self.rates, strict=True)] for phis in forcing]
        apart = [[p - limit for p, limit in zip(*pair, strict=True)] for pair in zip(self.p, limits, strict=True)]
        left, over = self.instants(ball(end - start))
        sums = arb_mat(apart) * arb_mat(left).transpose()
        bends = arb_mat([[(-entry).max(ZERO) for entry in row] for row in apart]) * arb_mat(over).transpose()
        reached = []
        for i, limit in enumerate(limits):
            highest = [sums[i, at].max(sums[i, at + 1]) + bends[i, at] for at in range(SUBSTEPS)]
            reached.append(sum(limit, ZERO) + reduce(arb.max, highest))
        self.p = [
            [limit + entry * e for limit, entry, e in zip(*pair, left[-1], strict=True)]
            for pair in zip(limits, apart, strict=True)
        ]
        self.inside(name, reached, box)

    def instants(self, duration: arb) -> tuple[list[list[arb]], list[list[arb]]]:
        """Rows of ``e^(−μ_a τ_l)``, and of ``e^(−μ_a τ_l) min(1 − e^(−μ_a δ_l), (μ_a δ_l)²/8)``."""
        turns = [rate * duration / (1 << SUBSTEPS - 1) for rate in self.rates]  # 0, 1, 2, 4, … times these
        left, over = [[ONE] * len(turns), [(-turn).exp() for turn in turns]], []
        while len(left) <= SUBSTEPS:
            left.append([entry**2 for entry in left[-1]])
        bends = [turn**2 / 8 for turn in turns]
        for at in range(SUBSTEPS):
            both = zip(*left[at : at + 2], bends, strict=True)
            over.append([(now - later).min(now * bend) for now, later, bend in both])
            bends = [bend * 4 for bend in bends] if at else bends
        return left, over

    def tail(self, outside: Outside) -> None:
        """``Σ_a p_ia⁺ + Σ_a Σ_j c_ija q̂_j/(μ_a − ρ) ≤ D_i``"""
        box, rate, name = self.witness.tail.box, self.witness.tail.rate, f"{self.name}: tail"
        fastest = outside.reference.tail_rate
        require(0 < rate <= fastest, f"{name}: 0 < ρ ≤ λ'", rate=rate, reference=fastest)
        require(rate < self.witness.rates[0], f"{name}: ρ < μ_1", rate=rate, slowest=self.witness.rates[0])
        try:
            around = outside.in_tail()
            forcing = self.forcing(box, around, self.increments.in_tail(around, *self.sizes(box)))
        except Undecided as reason:
            raise Rejected(name, str(reason)) from None
        gaps = [own - ball(rate) for own in self.rates]
        self.inside(
            name,
            [
                sum((size.max(ZERO) + phi / gap for size, phi, gap in zip(p, phis, gaps, strict=True)), ZERO)
                for p, phis in zip(self.p, forcing, strict=True)
            ],
            box,
        )

    def inside(self, name: str, reached: Sequence[arb], box: Sequence[Fraction]) -> None:
        """Every output is within the box, and the saturation is not active in the box."""
        for i, (size, limit) in enumerate(zip(reached, box, strict=True), 1):
            if not size <= ball(limit):
                require(False, f"{name}: Σ_a p_ia ≤ B_i", output=i, left=shown(size), box=limit)
        theta = box[self.loop.nz + self.loop.n]
        require(
            self.claim.K * theta <= self.claim.delta,
            f"{name}: K B_ϑ ≤ δ",
            left=self.claim.K * theta,
            delta=self.claim.delta,
        )
