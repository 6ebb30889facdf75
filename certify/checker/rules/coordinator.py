"""Section 2 of docs/certificate.md: how far the references are from the optimum, for all time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, isqrt

from certify.checker import linear
from certify.checker.certificate import Certificate
from certify.checker.intervals import Interval, enclose, maximum, total
from certify.checker.linear import Matrix
from certify.checker.plant import Plant
from certify.checker.rules.assumptions import Facts
from certify.checker.rules.mixing import SCALE, UNIT, Mixing, dot, fixed_down, fixed_up, point
from certify.checker.rules.reference import Reference, Step
from certify.checker.rules.trajectory import Segment, Stepper
from certify.checker.verdict import Malformed, Undecided, obligation, require, spend

DAMPING_BITS = 64
LARGEST_BITS = 2_000


@dataclass(frozen=True)
class AgentEnvelope:
    """``|y_i^r − s*| ≤ peak`` for ever, ``∫ (y_i^r − s*)² ≤ energy``, ``∫ (ẏ_i^r)² ≤ speed_energy``; each a point.

    ``reference`` is what they come from, step by step.
    """

    peak: Interval
    energy: Interval
    speed_energy: Interval
    reference: Reference


def prove(plant: Plant, certificate: Certificate, facts: Facts) -> tuple[AgentEnvelope, ...]:
    """The envelopes of all agents. Raises ``Rejected``."""
    with obligation("coordinator"):
        rule = _Coordinator(plant, certificate, facts)
        rule.mixing_inequality()
        rule.walk_mixing()
        rule.lyapunov_inequality()
        return rule.envelopes()


class Norm:
    """``‖e‖_P ≤ √(mag(e)ᵀ|P|mag(e))`` for vectors of fixed-point magnitudes."""

    def __init__(self, P: Matrix) -> None:
        self.weights = [[fixed_up(abs(entry)) for entry in row] for row in P]

    def __call__(self, sizes: Sequence[int]) -> int:
        square = sum(size * dot(row, sizes) for size, row in zip(sizes, self.weights, strict=True))
        return isqrt(square >> SCALE) + 1


class _Coordinator:
    def __init__(self, plant: Plant, certificate: Certificate, facts: Facts) -> None:
        self.L, self.r, self.facts = plant.laplacian, facts.r, facts
        self.a1, self.a2, witness = certificate.claim.alpha1, certificate.claim.alpha2, certificate.witness.coordinator
        self.P, self.multiplier, self.step, self.steps = witness.P, witness.multiplier, witness.step, witness.steps
        self.rate, self.mixing_rate = witness.rate, witness.mixing_rate
        self.boxes = [agent.reference_box for agent in plant.agents]
        n = self.size = len(self.L)
        if len(self.P) != 2 * n - 1 or len(self.multiplier) != n:
            raise Malformed("coordinator: P or the multiplier has the wrong size")
        require(min(self.a1, self.a2) > 0, "coordinator: α1, α2 > 0", alpha1=self.a1, alpha2=self.a2)
        require(min(self.rate, self.mixing_rate) > 0, "coordinator: λ0, λ̂ > 0", rate=self.rate, mixing=self.mixing_rate)
        self.B = [*linear.identity(n - 1), [-entry / self.r[-1] for entry in self.r[:-1]]]
        self.norm = Norm(self.P)
        self.optimum = fixed_down(facts.optimum), fixed_up(facts.optimum)

    def mixing_inequality(self) -> None:
        """``Rm L + LᵀRm − 2λ̂(Rm − r rᵀ) ⪰ 0``."""
        RL = [[weight * entry for entry in row] for weight, row in zip(self.r, self.L, strict=True)]
        spread = [[weight * ((i == j) - other) for j, other in enumerate(self.r)] for i, weight in enumerate(self.r)]
        left = linear.combine(1, linear.combine(1, RL, 1, linear.transpose(RL)), -2 * self.mixing_rate, spread)
        require(linear.is_nonnegative(left), "mixing: Rm L + LᵀRm ⪰ 2λ̂(Rm − r rᵀ)", rate=self.mixing_rate)

    def walk_mixing(self) -> None:
        """Every ``ξ_i^i`` on every step, its range over all time, and the box of ``D``."""
        n = self.size
        spend(self.steps * (n**2 * (4 * n + 150) + 2_000))  # time, and memory of what is kept of a step
        mixing = Mixing(self.L, self.step)
        self.mixing = [mixing.advance() for _ in range(self.steps)]
        self.at_end = mixing
        later = [mixing.range_later(i) for i in range(n)]
        self.xi_min = [min(later[i][0], *(step.low[i] for step in self.mixing)) for i in range(n)]
        require(min(self.xi_min) > 0, "mixing: ξ_min > 0", xi_min=[Fraction(low, UNIT) for low in self.xi_min])
        self.damping = []
        for i, cost in enumerate(self.facts.costs):
            high = max(later[i][1], *(step.high[i] for step in self.mixing))
            ends = cost.least * UNIT / high, cost.largest * UNIT / self.xi_min[i]
            self.damping.append((_short(ends[0], floor), _short(ends[1], ceil)))

    def system(self, damping: Sequence[Fraction]) -> Matrix:
        """``A(D) = [[−α1 L − D, −α2 B], [α1 L_(1…N−1), 0]]``."""
        n = self.size
        upper = [[-self.a1 * self.L[i][j] - (damping[i] if i == j else 0) for j in range(n)]
                 + [-self.a2 * entry for entry in self.B[i]] for i in range(n)]
        return upper + [[self.a1 * entry for entry in row] + [Fraction(0)] * (n - 1) for row in self.L[:-1]]

    def lyapunov_inequality(self) -> None:
        """``P ≻ 0`` and ``AᵀP + PA + 2λ0 P ⪯ 0`` for all ``A(D)``, ``D`` in the box, by the diagonal multiplier."""
        n, m, size = self.size, self.multiplier, 2 * self.size - 1
        require(linear.is_positive_definite(self.P), "coordinator: P ≻ 0")
        require(min(m) >= 0, "coordinator: multiplier ≥ 0", multiplier=m)
        PA = linear.product(self.P, self.system([(lo + hi) / 2 for lo, hi in self.damping]))
        PG = [[row[j] * (hi - lo) / 2 for j, (lo, hi) in enumerate(self.damping)] for row in self.P]
        AP = linear.combine(1, PA, 1, linear.transpose(PA))
        rows = [[-AP[i][j] - 2 * self.rate * self.P[i][j] - (m[i] if i == j < n else 0) for j in range(size)]
                + [-entry for entry in PG[i]] for i in range(size)]
        rows += [[-row[j] for row in PG] + [m[j] * (i == j) for i in range(n)] for j in range(n)]
        require(linear.is_nonnegative(rows), "coordinator: Lyapunov inequality", damping=self.damping, rate=self.rate)

    def envelopes(self) -> tuple[AgentEnvelope, ...]:
        """The walk along the grid: nominal trajectory, deviation from it, and the tail."""
        inverse = linear.inverse(self.P)
        self.kappa = [enclose(inverse[i][i]).sqrt().upper for i in range(self.size)]
        self.nu = [maximum(*(enclose(linear.dot(row, linear.apply(inverse, row))).sqrt() for row in self.rows_of(i)))
                   for i in range(self.size)]
        kappa, nu = [[fixed_up(entry) for entry in entries] for entries in (self.kappa, self.nu)]
        decay = enclose(-self.rate * self.step).exp()
        factors = fixed_down(decay), fixed_up(decay)
        consensus, feedback = ([[a * self.step * entry for entry in row] for row in matrix]
                               for a, matrix in ((self.a1, self.L), (self.a2, self.B)))
        stepper = Stepper(self.facts.costs, consensus, feedback, self.step)
        steps = [list[Step]() for _ in range(self.size)]
        y, omega = [floor((lo + hi) / 2 * UNIT) for lo, hi in self.boxes], [0] * (self.size - 1)
        radii = [max(ceil(hi * UNIT) - m, m - floor(lo * UNIT)) for (lo, hi), m in zip(self.boxes, y, strict=True)]
        w = self.norm(radii + omega)
        for mixing in self.mixing:
            segment = stepper.advance(mixing, y, omega)
            forced = self.norm(segment.defects) * self.rate.denominator // self.rate.numerator + 1
            for i, found in enumerate(steps):
                found.append(self.reach(segment, i, kappa[i], nu[i], max(w, forced)))
            w = max(e * w + (UNIT - e) * forced for e in factors) // UNIT + 1
            y, omega = [sum(poly) for poly in segment.y], [sum(poly) for poly in segment.omega]
            if max(map(int.bit_length, y + omega)) > LARGEST_BITS:
                raise Undecided("the nominal trajectory grows out of range")
        return self.tail(point(w), y, omega, steps)

    def rows_of(self, i: int) -> list[Sequence[Fraction]]:
        """Row ``i`` of ``A(D)`` at both ends of ``D_i``."""
        return [self.system([ends[side] for ends in self.damping])[i] for side in (0, 1)]

    def reach(self, segment: Segment, i: int, kappa: int, nu: int, deviation: int) -> Step:
        """``|ỹ_i| ≤ max|ŷ_i − s*| + κ_i W_k`` and ``|ẏ_i^r| ≤ max|ŷ_i'| + |ρ_i| + ν_i W_k`` on a step."""
        start, *rest = segment.y[i]
        spread = (kappa * deviation >> SCALE) + 1
        gap = max(start - self.optimum[0], self.optimum[1] - start)
        distance = gap + sum(map(abs, rest)) + spread
        climb = sum(j * abs(c) for j, c in enumerate(rest, 1)) * self.step.denominator // self.step.numerator + 1
        speed = climb + segment.defects[i] + (nu * deviation >> SCALE) + 1
        low, high = (start + sum(bound(c, 0) for c in rest) for bound in (min, max))
        return Step(low - spread, high + spread, distance, speed)

    def tail(self, w: Interval, y: list[int], omega: list[int], steps: list[list[Step]]) -> tuple[AgentEnvelope, ...]:
        """From ``T0`` on around the equilibrium: ``‖x‖_P ≤ M1 e^(−λ'(t−T0))``."""
        r, slopes, rate = self.r, self.facts.optimal_slopes, min(self.rate, self.mixing_rate) / 2
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
        result = []
        for found, kappa, nu, p in zip(steps, self.kappa, self.nu, forcing, strict=True):
            distance, speed = kappa * M1, nu * M1 + p
            reference = Reference(self.facts.optimum, self.step, found, distance.upper, speed.upper, rate)
            squares, speeds = (self.step * Interval(n, n, -2 * SCALE) for n in (
                sum(step.distance**2 for step in found), sum(step.speed**2 for step in found)))
            energy, speed_energy = squares + distance**2 / (2 * rate), speeds + speed**2 / (2 * rate)
            peak = maximum(point(max(step.distance for step in found)), distance)
            result.append(AgentEnvelope(peak, energy.upper, speed_energy.upper, reference))
        return tuple(result)


def _short(value: Fraction, rounding: Callable[[Fraction], int]) -> Fraction:
    return Fraction(rounding(value * (1 << DAMPING_BITS)), 1 << DAMPING_BITS)
