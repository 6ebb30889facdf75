"""The coordinator that waits until its mixing layer has settled (docs/coordinator.md), in integers.

Numbers of the output's kind are integers that stand for multiples of ``unit/2^64``, ``unit`` the witness's: nothing
here depends on what the output is measured in. Bounds are rounded up, and every floored quotient is paid for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import ceil, floor, isqrt

from certify.checker.certificate import Claim, HeldWitness
from certify.checker.cholesky import is_positive_definite
from certify.checker.intervals import Interval, between, enclose, maximum
from certify.checker.plant import Plant
from certify.checker.rules import chebyshev
from certify.checker.rules.assumptions import Facts
from certify.checker.rules.curve import Curve, Stretch
from certify.checker.rules.mixing import fixed_down, fixed_up, point
from certify.checker.rules.reference import AgentEnvelope, Reference, Step
from certify.checker.verdict import Malformed, require, spend

GUARD = 64  # bits of the integers below the witness's unit
DIGITS = 64  # significant bits of the ends of the damping
TAIL_SHARE = Fraction(7, 8)  # of the slower of the two rates: the tail pays 1/(1 − 7/8) times the late forcing


def envelopes(plant: Plant, claim: Claim, witness: HeldWitness, facts: Facts) -> tuple[AgentEnvelope, ...]:
    """The envelopes of all agents. Raises ``Rejected``."""
    rule = _Held(plant, claim, witness, facts)
    rule.mixing_inequality()
    rule.lyapunov_inequality()
    return rule.envelopes()


@dataclass(frozen=True)
class Deviation:
    """On one stretch: ``defects ≥ |ρ_i|·Δ/2``, and ``bound ≥ ‖(y − ŷ, ζ − ζ̂)‖_P``."""

    defects: list[int]
    bound: int


class _Held:
    def __init__(self, plant: Plant, claim: Claim, witness: HeldWitness, facts: Facts) -> None:
        self.L, self.r, self.facts, self.claim, self.witness = plant.laplacian, facts.r, facts, claim, witness
        n = self.size = len(self.L)
        if len(witness.B) != n or len(witness.times) != len(witness.curve) + 1 or len(witness.times) < 2:
            raise Malformed("coordinator: B, times or the curve has the wrong length")
        if any(len(step) != n for step in witness.curve):
            raise Malformed("coordinator: a step of the curve has the wrong number of agents")
        require(witness.times[0] == claim.mixing_time, "coordinator: the curve begins at t_mix", start=witness.times[0])
        require(all(a < b for a, b in pairwise(witness.times)), "coordinator: times increase")
        positive = (witness.c, witness.rate, witness.mixing_rate, witness.unit)
        require(min(positive) > 0, "coordinator: c, λ, λ̂, unit > 0", numbers=positive)
        require(witness.shift >= 0, "coordinator: μ ≥ 0", shift=witness.shift)
        self.unit = witness.unit / (1 << GUARD)
        self.boxes = [agent.reference_box for agent in plant.agents]
        self.optimum = between(facts.optimum.lo, facts.optimum.hi)

    def mixing_inequality(self) -> None:
        """``Rm L + LᵀRm − 2λ̂(Rm − 2r rᵀ) ≻ 0``; so ``|ξ_i^i − r_i| ≤ ε_i r_i`` from ``t_mix`` on; the box of ``D``."""
        r, L, rate = self.r, self.L, self.witness.mixing_rate
        spend(20 * self.size**2)
        rows = [
            [r[i] * L[i][j] + r[j] * L[j][i] + 4 * rate * r[i] * r[j] for j in range(self.size)]
            for i in range(self.size)
        ]
        for i, weight in enumerate(r):
            rows[i][i] -= 2 * rate * weight
        require(is_positive_definite(rows), "mixing: Rm L + LᵀRm ≻ 2λ̂(Rm − 2r rᵀ)", rate=rate)
        self.mixing_decay = rate * self.claim.mixing_gain
        left = enclose(-self.mixing_decay * self.claim.mixing_time).exp().upper
        self.epsilon = [_up((left / weight).hi) for weight in r]
        require(max(self.epsilon) < 1, "mixing: ξ_i^i stays within r_i(1 ± ε_i), ε_i < 1", epsilon=max(self.epsilon))
        self.damping = [
            (
                _down(self.claim.gradient_gain * cost.least / (weight * (1 + eps))),
                _up(self.claim.gradient_gain * cost.largest / (weight * (1 - eps))),
            )
            for cost, weight, eps in zip(self.facts.costs, r, self.epsilon, strict=True)
        ]

    def lyapunov_inequality(self) -> None:
        """``P ≻ 0`` and ``d/dt ‖e‖_P ≤ −λ‖e‖_P`` for every ``D`` in the box, on ``rᵀζ = 0``."""
        n, r, B, c, L = self.size, self.r, self.witness.B, self.witness.c, self.L
        a1, a2, rate, shift = self.claim.alpha1, self.claim.alpha2, self.witness.rate, self.witness.shift
        require(all(c > b * b for b in B), "coordinator: P ≻ 0: c > B_i²", c=c)
        spend(100 * n**2)
        top, side, corner = ([[Fraction(0)] * n for _ in range(n)] for _ in range(3))
        for i in range(n):
            for j in range(n):
                if i == j or L[i][j]:
                    top[i][j] += a1 * (1 - B[i]) * r[i] * L[i][j]
                    top[j][i] += a1 * (1 - B[i]) * r[i] * L[i][j]
                    side[j][i] += a1 * (B[i] - c) * r[i] * L[i][j]
                corner[i][j] += shift * r[i] * r[j]
            low, high = self.damping[i]
            top[i][i] += 2 * r[i] * (low - rate)
            side[i][i] += r[i] * (a2 + B[i] * (low - 2 * rate))
            corner[i][i] += r[i] * (2 * a2 * B[i] - (high - low) * B[i] ** 2 / 2 - 2 * rate * c)
        rows = [left + right for left, right in zip(top, side, strict=True)]
        rows += [list(left) + right for left, right in zip(zip(*side, strict=True), corner, strict=True)]
        require(is_positive_definite(rows), "coordinator: Lyapunov inequality", rate=rate)

    def envelopes(self) -> tuple[AgentEnvelope, ...]:
        """The walk along the curve, and the tail."""
        r, c, B = self.r, self.witness.c, self.witness.B
        self.reach = [(c / (weight * (c - b * b))) for weight, b in zip(r, B, strict=True)]
        self.reach_root = [enclose(entry).sqrt().upper for entry in self.reach]
        forms = [self.dual_forms(ends) for ends in zip(*self.damping, strict=True)]
        self.nu = [maximum(*(enclose(form).sqrt() for form in pair)) for pair in zip(*forms, strict=True)]
        curve = Curve(self.claim, self.witness, self.facts, self.L, self.r, GUARD)
        stretches = curve.stretches()
        radii = [
            max(ceil(hi / self.unit) - start, start - floor(lo / self.unit))
            for (lo, hi), start in zip(self.boxes, curve.start, strict=True)
        ]
        deviations, last = self.deviations(stretches, radii)
        return self.outputs(stretches, deviations, self.tail(curve, last))

    def dual_forms(self, damping: Sequence[Fraction]) -> list[Fraction]:
        """``a P⁻¹ aᵀ`` for the rows ``a = (−α1 L_i − D_i e_i, −α2 e_i)``; ``P⁻¹`` is block diagonal."""
        c, B, r = self.witness.c, self.witness.B, self.r
        forms = []
        for i, row in enumerate(self.L):
            form = Fraction(0)
            for j, entry in enumerate(row):
                if entry or i == j:
                    y = -self.claim.alpha1 * entry - (damping[i] if i == j else 0)
                    zeta = -self.claim.alpha2 if i == j else Fraction(0)
                    form += (c * y * y - 2 * B[j] * y * zeta + zeta * zeta) / (r[j] * (c - B[j] ** 2))
            forms.append(form)
        return forms

    def deviations(self, stretches: Sequence[Stretch], radii: list[int]) -> tuple[list[Deviation], int]:
        """``w ← max_e (e w + (1 − e) π/λ) + ‖jump‖``, ``e ∈ [e^(−λΔ)]``, and ``w ≤ max(w, π/λ)`` on the way."""
        rate, found = self.witness.rate, []
        weights = [ceil(weight * (1 << GUARD)) for weight in self.r]
        w = _norm(weights, radii)
        for stretch in stretches:
            defects = self.defects(stretch, radii)
            forced = ceil(_norm(weights, defects) * 2 / (stretch.length * rate))
            found.append(Deviation(defects, max(w, forced)))
            decay = enclose(-rate * stretch.length).exp()
            ends = fixed_down(decay), fixed_up(decay)
            w = max(-(-(e * w + ((1 << 128) - e) * forced) >> 128) for e in ends)
            w += _norm(weights, stretch.jumps)
        return found, w

    def defects(self, stretch: Stretch, radii: list[int]) -> list[int]:
        """``|ρ_i|Δ/2``: the curve's own, by how much ``ξ_i^i`` is not ``r_i``, the soft start of a box of starts."""
        result = []
        for i, eps in enumerate(self.epsilon):
            mixed = ceil(stretch.pulls[i] * eps / (1 - eps))
            soft = stretch.softness * (self.damping[i][1] * stretch.length / 2 * radii[i]) if stretch.softness else 0
            result.append(stretch.residuals[i] + mixed + ceil(soft))
        return result

    def tail(self, curve: Curve, w: int) -> tuple[Interval, list[Interval], Fraction]:
        """From ``T0`` on around the equilibrium ``(s*, ζ̄)``: ``‖x‖_P ≤ M1 e^(−λ'(t−T0))``, and the late forcings."""
        r, c, B, kappa = self.r, self.witness.c, self.witness.B, self.claim.gradient_gain
        softening = self.claim.softening
        late = min(self.mixing_decay, softening) if softening else self.mixing_decay
        rate = min(self.witness.rate, late) * TAIL_SHARE
        forcing, square, forced = [], Interval(0, 0), Interval(0, 0)
        for i, eps in enumerate(self.epsilon):
            slope = self.facts.optimal_slopes[i]
            lo, hi = self.boxes[i]
            start = self.facts.costs[i].slope(between(lo, hi)).magnitude * curve.softness_at_end
            p = (slope.magnitude * (eps / (1 - eps)) + start / (1 - eps)) * (kappa / r[i])
            forcing.append(p.upper)
            y = (curve.end[i] * self.unit - self.optimum).magnitude
            zeta = (curve.memory[i] + slope * (kappa / (self.claim.alpha2 * r[i]))).magnitude
            square += r[i] * (y**2 + 2 * abs(B[i]) * y * zeta + c * zeta**2)
            forced += r[i] * p**2
        M1 = w * self.unit + square.sqrt() + forced.sqrt() / (self.witness.rate - rate)
        return M1.upper, forcing, rate

    def outputs(
        self,
        stretches: Sequence[Stretch],
        deviations: Sequence[Deviation],
        tail: tuple[Interval, list[Interval], Fraction],
    ) -> tuple[AgentEnvelope, ...]:
        """``|y_i^r − s*|`` and ``|ẏ_i^r|``: while they are held, along the curve, and in the tail."""
        (M1, forcing, rate), t_mix = tail, self.claim.mixing_time
        times = [Fraction(0), *self.witness.times]
        optimum = floor(self.facts.optimum.lo / self.unit), ceil(self.facts.optimum.hi / self.unit)
        result = []
        for i, (kappa, nu) in enumerate(zip(self.reach_root, self.nu, strict=True)):
            spend(2_000 * len(stretches))
            lo, hi = self.boxes[i]
            held = max(abs((between(lo, hi) - self.optimum).lo), abs((between(lo, hi) - self.optimum).hi))
            steps = [Step(floor(lo * (1 << 128)), ceil(hi * (1 << 128)), ceil(held * (1 << 128)), 0)]
            squares, speeds = t_mix * enclose(held) ** 2, Interval(0, 0)
            distance, speed = kappa * M1, nu * M1 + forcing[i]
            ratio, drift_rate = _up(kappa.hi), _up(nu.hi)
            for stretch, deviation in zip(stretches, deviations, strict=True):
                y, slope, to_rate = stretch.y[i], stretch.slopes[i], 2 / stretch.length
                apart = ceil(ratio * deviation.bound)
                drift = deviation.defects[i] + ceil(drift_rate * deviation.bound / to_rate)
                around = chebyshev.spread(y) + apart
                low, high = y[0] - around, y[0] + around
                far, fast = max(high - optimum[0], optimum[1] - low), chebyshev.size(slope) + drift
                steps.append(self.step(low, high, far, fast * to_rate))
                mean = chebyshev.root_mean_square([y[0] - optimum[0], *y[1:]]) + optimum[1] - optimum[0] + apart
                mean_speed = (chebyshev.root_mean_square(slope) + drift) * to_rate
                squares += stretch.length * enclose(mean * self.unit) ** 2
                speeds += stretch.length * enclose(mean_speed * self.unit) ** 2
            reference = Reference(self.optimum, times, steps, distance.upper, speed.upper, rate)
            energy, speed_energy = squares + distance**2 / (2 * rate), speeds + speed**2 / (2 * rate)
            peak = maximum(point(max(step.distance for step in steps)), distance)
            result.append(AgentEnvelope(peak, energy.upper, speed_energy.upper, reference))
        return tuple(result)

    def step(self, low: int, high: int, far: int, fast: Fraction) -> Step:
        """In the units of ``Reference``."""
        factor = self.unit * (1 << 128)
        return Step(floor(low * factor), ceil(high * factor), ceil(far * factor), ceil(fast * factor))


def _norm(weights: Sequence[int], sizes: Sequence[int]) -> int:
    """``√(Σ r_i size_i²)``, the norm of ``(size, 0)``."""
    square = sum(weight * size * size for weight, size in zip(weights, sizes, strict=True))
    return isqrt(square >> GUARD) + 1 if square else 0


def _up(value: Fraction) -> Fraction:
    return -_down(-value)


def _down(value: Fraction) -> Fraction:
    """With ``DIGITS`` significant bits."""
    shift = DIGITS - abs(value.numerator).bit_length() + value.denominator.bit_length()
    scaled = value * (1 << shift) if shift >= 0 else value / (1 << -shift)
    return Fraction(floor(scaled)) / (1 << shift) if shift >= 0 else Fraction(floor(scaled)) * (1 << -shift)
