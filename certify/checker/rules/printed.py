"""Section 2 of docs/certificate.md: the coordinator that starts at once and divides by a ``ξ`` that still mixes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, isqrt

from certify.checker import linear
from certify.checker.certificate import Claim, PrintedWitness
from certify.checker.intervals import Interval, enclose, maximum, total
from certify.checker.linear import Matrix, dot
from certify.checker.plant import Plant
from certify.checker.rules.assumptions import Facts
from certify.checker.rules.mixing import SCALE, UNIT, Mixing, fixed_down, fixed_up, point
from certify.checker.rules.reference import AgentEnvelope, Reference, Step
from certify.checker.rules.trajectory import Segment, Stepper
from certify.checker.verdict import Malformed, Undecided, require, spend

DAMPING_BITS = 64
LARGEST_BITS = 2_000


def envelopes(plant: Plant, claim: Claim, witness: PrintedWitness, facts: Facts) -> tuple[AgentEnvelope, ...]:
    """The envelopes of all agents. Raises ``Rejected``."""
    rule = _Printed(plant, claim, witness, facts)
    rule.mixing_inequality()
    rule.walk_mixing()
    rule.lyapunov_inequality()
    return rule.envelopes()


@dataclass(frozen=True)
class Reached:
    """One agent on one step, in units: its bounds, and the roots of the mean squares of distance and speed."""

    step: Step
    mean_distance: int
    mean_speed: int


class Norm:
    """``‖e‖_P ≤ √(mag(e)ᵀ|P|mag(e))`` for vectors of fixed-point magnitudes."""

    def __init__(self, P: Matrix) -> None:
        self.weights = [[fixed_up(abs(entry)) for entry in row] for row in P]

    def __call__(self, sizes: Sequence[int]) -> int:
        square = sum(size * dot(row, sizes) for size, row in zip(sizes, self.weights, strict=True))
        return isqrt(square >> SCALE) + 1


def extremes(polynomial: Sequence[int]) -> tuple[int, int]:
    """Bounds of the polynomial on ``[0, 1]``."""
    low, *rest = polynomial
    high = low
    for c in rest:
        if c < 0:
            low += c
        else:
            high += c
    return low, high


def root_mean_square(polynomial: Sequence[int]) -> int:
    """No less than the root of the mean square on ``[0, 1]``: the terms up to ``σ²`` exactly, the others by size."""
    a, b, c, *rest = polynomial
    square = 30 * a * (a + b) + 10 * (b * b + 2 * a * c) + 15 * b * c + 6 * c * c
    return isqrt(square // 30 + 1) + 1 + sum(map(abs, rest))


class _Printed:
    def __init__(self, plant: Plant, claim: Claim, witness: PrintedWitness, facts: Facts) -> None:
        self.L, self.r, self.facts = plant.laplacian, facts.r, facts
        self.a1, self.a2, self.kappa = claim.alpha1, claim.alpha2, claim.gradient_gain
        self.mixing_laplacian = [[claim.mixing_gain * entry for entry in row] for row in self.L]
        self.P, self.multiplier, self.step, self.steps = witness.P, witness.multiplier, witness.step, witness.steps
        self.rate, self.mixing_rate = witness.rate, witness.mixing_rate
        self.boxes = [agent.reference_box for agent in plant.agents]
        n = self.size = len(self.L)
        if len(self.P) != 2 * n - 1 or len(self.multiplier) != n:
            raise Malformed("coordinator: P or the multiplier has the wrong size")
        require(claim.softening == 0, "coordinator: a soft start needs t_mix > 0", softening=claim.softening)
        require(min(self.rate, self.mixing_rate) > 0, "coordinator: λ0, λ̂ > 0", rate=self.rate, mixing=self.mixing_rate)
        self.B = [*linear.identity(n - 1), [-entry / self.r[-1] for entry in self.r[:-1]]]
        self.norm = Norm(self.P)
        self.optimum = fixed_down(facts.optimum), fixed_up(facts.optimum)

    def mixing_inequality(self) -> None:
        """``Rm βL + βLᵀRm − 2λ̂(Rm − r rᵀ) ⪰ 0``."""
        RL = [[weight * entry for entry in row] for weight, row in zip(self.r, self.mixing_laplacian, strict=True)]
        spread = [[weight * ((i == j) - other) for j, other in enumerate(self.r)] for i, weight in enumerate(self.r)]
        left = linear.combine(1, linear.combine(1, RL, 1, linear.transpose(RL)), -2 * self.mixing_rate, spread)
        require(linear.is_nonnegative(left), "mixing: Rm βL + βLᵀRm ⪰ 2λ̂(Rm − r rᵀ)", rate=self.mixing_rate)

    def walk_mixing(self) -> None:
        """Every ``ξ_i^i`` on every step, its least value ever, and the box of ``D``. The largest is 1, at ``t = 0``."""
        n = self.size
        spend(self.steps * (n**2 * (4 * n + 150) + 2_000))  # time, and memory of what is kept of a step
        mixing = Mixing(self.mixing_laplacian, self.step)
        self.mixing = [mixing.advance() for _ in range(self.steps)]
        self.at_end = mixing
        self.xi_min = [min(mixing.low_later(i), *(step.low[i] for step in self.mixing)) for i in range(n)]
        require(min(self.xi_min) > 0, "mixing: ξ_min > 0", xi_min=[Fraction(low, UNIT) for low in self.xi_min])
        self.damping = [
            (_short(self.kappa * cost.least, floor), _short(self.kappa * cost.largest * UNIT / low, ceil))
            for cost, low in zip(self.facts.costs, self.xi_min, strict=True)
        ]

    def system(self, damping: Sequence[Fraction]) -> Matrix:
        """``A(D) = [[−α1 L − D, −α2 B], [α1 L_(1…N−1), 0]]``."""
        n = self.size
        upper = [
            [-self.a1 * self.L[i][j] - (damping[i] if i == j else 0) for j in range(n)]
            + [-self.a2 * entry for entry in self.B[i]]
            for i in range(n)
        ]
        return upper + [[self.a1 * entry for entry in row] + [Fraction(0)] * (n - 1) for row in self.L[:-1]]

    def lyapunov_inequality(self) -> None:
        """``P ≻ 0`` and ``AᵀP + PA + 2λ0 P ⪯ 0`` for all ``A(D)``, ``D`` in the box, by the diagonal multiplier."""
        n, m, size = self.size, self.multiplier, 2 * self.size - 1
        require(linear.is_positive_definite(self.P), "coordinator: P ≻ 0")
        require(min(m) >= 0, "coordinator: multiplier ≥ 0", multiplier=m)
        PA = linear.product(self.P, self.system([(lo + hi) / 2 for lo, hi in self.damping]))
        PG = [[row[j] * (hi - lo) / 2 for j, (lo, hi) in enumerate(self.damping)] for row in self.P]
        AP = linear.combine(1, PA, 1, linear.transpose(PA))
        rows = [
            [-AP[i][j] - 2 * self.rate * self.P[i][j] - (m[i] if i == j < n else 0) for j in range(size)]
            + [-entry for entry in PG[i]]
            for i in range(size)
        ]
        rows += [[-row[j] for row in PG] + [m[j] * (i == j) for i in range(n)] for j in range(n)]
        require(linear.is_nonnegative(rows), "coordinator: Lyapunov inequality", damping=self.damping, rate=self.rate)

    def envelopes(self) -> tuple[AgentEnvelope, ...]:
        """The walk along the grid: nominal trajectory, deviation from it, and the tail."""
        inverse = linear.inverse(self.P)
        self.reach_of = [enclose(inverse[i][i]).sqrt().upper for i in range(self.size)]
        forms = [self.dual_forms(inverse, ends) for ends in zip(*self.damping, strict=True)]
        self.nu = [maximum(*(enclose(form).sqrt() for form in pair)) for pair in zip(*forms, strict=True)]
        reaches, nu = [[fixed_up(entry) for entry in entries] for entries in (self.reach_of, self.nu)]
        decay = enclose(-self.rate * self.step).exp()
        factors = fixed_down(decay), fixed_up(decay)
        consensus, feedback = (
            [[a * self.step * entry for entry in row] for row in matrix]
            for a, matrix in ((self.a1, self.L), (self.a2, self.B))
        )
        stepper = Stepper(self.facts.costs, consensus, feedback, self.step, self.kappa)
        reached = [list[Reached]() for _ in range(self.size)]
        y, omega = [floor((lo + hi) / 2 * UNIT) for lo, hi in self.boxes], [0] * (self.size - 1)
        radii = [max(ceil(hi * UNIT) - m, m - floor(lo * UNIT)) for (lo, hi), m in zip(self.boxes, y, strict=True)]
        w = self.norm(radii + omega)
        for mixing in self.mixing:
            segment = stepper.advance(mixing, y, omega)
            forced = self.norm(segment.defects) * self.rate.denominator // self.rate.numerator + 1
            for i, found in enumerate(reached):
                found.append(self.reach(segment, i, reaches[i], nu[i], max(w, forced)))
            w = max(e * w + (UNIT - e) * forced for e in factors) // UNIT + 1
            y, omega = [sum(poly) for poly in segment.y], [sum(poly) for poly in segment.omega]
            if max(map(int.bit_length, y + omega)) > LARGEST_BITS:
                raise Undecided("the nominal trajectory grows out of range")
        return self.tail(point(w), y, omega, reached)

    def dual_forms(self, inverse: Matrix, damping: Sequence[Fraction]) -> list[Fraction]:
        """``a P⁻¹ aᵀ`` for every row ``a`` of ``A(D)`` that belongs to a ``y_i``."""
        rows = self.system(damping)[: self.size]
        return [dot(row, image) for row, image in zip(rows, linear.product(rows, inverse), strict=True)]

    def reach(self, segment: Segment, i: int, kappa: int, nu: int, deviation: int) -> Reached:
        """``|ỹ_i| ≤ |ŷ_i − s*| + κ_i W_k`` and ``|ẏ_i^r| ≤ |ŷ_i'| + |ρ_i| + ν_i W_k`` on a step."""
        y, (lowest, highest) = segment.y[i], self.optimum
        rate = [j * c * self.step.denominator // self.step.numerator for j, c in enumerate(y[1:], 1)]
        (low, high), (least, most) = extremes(y), extremes(rate)
        spread = (kappa * deviation >> SCALE) + 1
        drift = segment.defects[i] + (nu * deviation >> SCALE) + len(y)  # and the rounding of the rate
        step = Step(low - spread, high + spread, max(high - lowest, highest - low) + spread, max(-least, most) + drift)
        mean_distance = root_mean_square([y[0] - lowest, *y[1:]]) + highest - lowest + spread
        return Reached(step, mean_distance, root_mean_square(rate) + drift)

    def tail(
        self, w: Interval, y: list[int], omega: list[int], reached: list[list[Reached]]
    ) -> tuple[AgentEnvelope, ...]:
        """From ``T0`` on around the equilibrium: ``‖x‖_P ≤ M1 e^(−λ'(t−T0))``."""
        r, slopes = self.r, [self.kappa * slope for slope in self.facts.optimal_slopes]
        rate = min(self.rate, self.mixing_rate) / 2
        forcing = []
        for i in range(self.size):
            entries = [point(entry, self.at_end.error) for entry in self.at_end.column(i)]
            q = (total(weight * (entry - r[i]) ** 2 for weight, entry in zip(r, entries, strict=True)) / r[i]).sqrt()
            forcing.append((slopes[i].magnitude * q / (r[i] * point(self.xi_min[i]))).upper)
        gaps = [point(value) - self.facts.optimum for value in y]
        gaps += [point(value) + slopes[i] / (self.a2 * r[i]) for i, value in enumerate(omega)]
        gap = point(self.norm([fixed_up(entry.magnitude) for entry in gaps]))
        forced = point(self.norm([fixed_up(entry) for entry in forcing] + [0] * (self.size - 1)))
        M1 = (w + gap + forced / (self.rate - rate)).upper
        times, result = [self.step * k for k in range(self.steps + 1)], []
        for found, kappa, nu, p in zip(reached, self.reach_of, self.nu, forcing, strict=True):
            distance, speed = kappa * M1, nu * M1 + p
            steps = [entry.step for entry in found]
            reference = Reference(self.facts.optimum, times, steps, distance.upper, speed.upper, rate)
            squares, speeds = (
                self.step * Interval(n, n, -2 * SCALE)
                for n in (sum(entry.mean_distance**2 for entry in found), sum(entry.mean_speed**2 for entry in found))
            )
            energy, speed_energy = squares + distance**2 / (2 * rate), speeds + speed**2 / (2 * rate)
            peak = maximum(point(max(step.distance for step in steps)), distance)
            result.append(AgentEnvelope(peak, energy.upper, speed_energy.upper, reference))
        return tuple(result)


def _short(value: Fraction, rounding: Callable[[Fraction], int]) -> Fraction:
    return Fraction(rounding(value * (1 << DAMPING_BITS)), 1 << DAMPING_BITS)
