"""Sections 5 and 6 of docs/certificate-direct.md: the comparison system on the grid, and its tail.

``|output i| ≤ Σ_a p_ia``, ``p_ia' = −μ_a p_ia + Σ_j c_ija |q_j|``.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from flint import arb, arb_mat

from certify.checker.balls import BITS, above, ball, precision, shown
from certify.checker.certificate import AgentClaim, DirectAgentWitness
from certify.checker.intervals import Interval, enclose
from certify.checker.rules.increments import Increments, Slopes, increment
from certify.checker.rules.loop import Loop
from certify.checker.rules.surroundings import Outside, Surroundings
from certify.checker.verdict import Rejected, Undecided, require, spend


def prove(name: str, loop: Loop, claim: AgentClaim, witness: DirectAgentWitness, b: Interval, outside: Outside,
          increments: Increments, at_start: Sequence[Interval]) -> None:
    """From the magnitudes of ``Y`` at ``T1`` on, for ever. Raises ``Rejected``."""
    with precision(BITS):
        tube = _Tube(name, loop, claim, witness, b, increments, at_start)
        for k in range(len(witness.boxes)):
            tube.step(k, outside)
        tube.tail(outside)


class _Tube:
    def __init__(self, name: str, loop: Loop, claim: AgentClaim, witness: DirectAgentWitness, b: Interval,
                 increments: Increments, at_start: Sequence[Interval]) -> None:
        self.name, self.loop, self.claim, self.witness, self.increments = name, loop, claim, witness, increments
        self.nominal_f0 = [[-enclose(slope) for slope in row] for row in witness.nominal.f0]
        self.nominal_f1 = [-enclose(slope) for slope in witness.nominal.f1]
        self.surplus = (b - enclose(witness.nominal.b)).magnitude
        self.rates = [ball(rate) for rate in witness.rates]
        forced = loop.nz + 2
        spend(20 * len(witness.kernels) * len(witness.rates) * (len(at_start) + len(witness.boxes) * (forced + 10)))
        self.force = self.matrix(0, forced)
        initial = self.matrix(forced, forced + loop.size)
        self.p = _entries(initial * arb_mat([[above(size)] for size in at_start]))

    def matrix(self, first: int, last: int) -> arb_mat:
        """The coefficients ``c_ija`` of some columns, one row per output and rate."""
        return arb_mat([[ball(column[a]) for column in columns[first:last]]
                        for columns in self.witness.kernels for a in range(len(self.rates))])

    def sizes(self, box: Sequence[Fraction]) -> tuple[list[Interval], list[Interval]]:
        """Of ``z̄`` and ``x̄``."""
        sizes = [enclose(size).upper for size in box[: self.loop.nz + self.loop.n]]
        return sizes[: self.loop.nz], sizes[self.loop.nz :]

    def forcing(self, box: Sequence[Fraction], around: Surroundings, slopes: Slopes) -> list[arb]:
        """``Σ_j c_ija q_j`` with the ``q_j`` of section 3 over the box."""
        z, x = self.sizes(box)
        q = [increment(row, nominal, z, x, around.distance)
             for row, nominal in zip(slopes.f0, self.nominal_f0, strict=True)]
        q.append((increment(slopes.f1, self.nominal_f1, z, x, around.distance) + self.surplus * box[-1]).upper)
        q.append(around.speed)
        return _entries(self.force * arb_mat([[above(entry)] for entry in q]))

    def step(self, k: int, outside: Outside) -> None:
        start, end, box = self.witness.grid[k], self.witness.grid[k + 1], self.witness.boxes[k]
        name = f"{self.name}: tube: step {k + 1}"
        try:
            around, index = outside.during(start, end), len(self.witness.phase1.boxes) + k
            slopes = self.increments.on_step(index, end - start, around, *self.sizes(box))
            forcing = self.forcing(box, around, slopes)
        except Undecided as reason:
            raise Rejected(name, str(reason)) from None
        duration, largest, count = ball(end - start), [], len(self.rates)
        decays = [(-rate * duration).exp() for rate in self.rates]
        for index, (p, phi) in enumerate(zip(self.p, forcing, strict=True)):
            e, rate = decays[index % count], self.rates[index % count]
            after = e * p + (1 - e) * phi / rate
            largest.append(p.max(after))
            self.p[index] = after
        self.inside(name, largest, box)

    def tail(self, outside: Outside) -> None:
        """``d_ia = max(p_ia, Σ_j c_ija q̂_j/(μ_a − ρ))``"""
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
        self.inside(name, [p.max(phi / gaps[index % len(gaps)])
                           for index, (p, phi) in enumerate(zip(self.p, forcing, strict=True))], box)

    def inside(self, name: str, sizes: Sequence[arb], box: Sequence[Fraction]) -> None:
        """The sum over the rates is within the box for every output, and the saturation is not active in the box."""
        count = len(self.rates)
        for i, limit in enumerate(box):
            reached = sum(sizes[i * count : (i + 1) * count], arb(0))
            require(bool(reached <= ball(limit)), f"{name}: Σ_a p_ia ≤ B_i", output=i + 1, left=shown(reached),
                    box=limit)
        theta = box[self.loop.nz + self.loop.n]
        require(self.claim.K * theta <= self.claim.delta, f"{name}: K B_ϑ ≤ δ", left=self.claim.K * theta,
                delta=self.claim.delta)


def _entries(column: arb_mat) -> list[arb]:
    return [row[0] for row in column.tolist()]
