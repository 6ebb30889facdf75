"""A nominal coordinator trajectory, step by step, with proved bounds of its defect (docs/certificate.md section 2).

Polynomials in ``σ = τ/Δ ∈ [0, 1]`` have fixed-point coefficients, and the trajectory is exactly what they say: only
``ξ`` and ``c'`` carry errors. ``q`` clears the denominators of ``α1ΔL``, ``α2ΔB`` and ``Δ``: all else is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import floor, lcm

from certify.checker import linear
from certify.checker.linear import Matrix
from certify.checker.rules.costs import Cost
from certify.checker.rules.mixing import ORDER, SCALE, UNIT, StepOfMixing, fixed_down, fixed_up, point

SLOPE_BITS = 64


@dataclass(frozen=True)
class Slope:
    """``c'(y) = value`` within ``error`` units, and any number ``sigma/2^64`` near ``c''(y)``."""

    value: int
    error: int
    sigma: int


@dataclass(frozen=True)
class Segment:
    """``ŷ`` and ``ω̂`` on one step, coefficient lists; ``defects ≥ |ρ|`` for all components of ``(y, ω)``."""

    y: list[list[int]]
    omega: list[list[int]]
    defects: list[int]


class Stepper:
    """``y' = −c'(y)/ξ − α1Ly − α2Bω``, ``ω' = α1(Ly)_(1…N−1)``, one step at a time."""

    def __init__(self, costs: tuple[Cost, ...], consensus: Matrix, feedback: Matrix, step: Fraction) -> None:
        """``consensus = α1ΔL`` and ``feedback = α2ΔB``."""
        self.costs = costs
        q = self.q = lcm(*map(linear.common_denominator, (consensus, feedback)), step.denominator)
        self.consensus = [[int(entry * q) for entry in row] for row in consensus]
        self.feedback = [[int(entry * q) for entry in row] for row in feedback]
        self.q_step = int(q * step)

    def advance(self, mixing: StepOfMixing, y: list[int], omega: list[int]) -> Segment:
        """The step from ``y, ω``, on which all ``ξ_i^i`` are positive."""
        n, q, xi = len(y), self.q, mixing.taylor
        slopes = [self.slope(cost, value) for cost, value in zip(self.costs, y, strict=True)]
        ys, omegas = [[value] for value in y], [[value] for value in omega]
        us: list[list[int]] = [[] for _ in y]  # Δ c'(ŷ)/ξ
        drifts: list[list[int]] = [[] for _ in y]  # q α1ΔLŷ
        feedbacks: list[list[int]] = [[] for _ in y]  # q α2ΔBω̂
        for j in range(ORDER + 1):
            for i in range(n):
                drifts[i].append(sum(a * ys[k][j] for k, a in enumerate(self.consensus[i])))
                feedbacks[i].append(sum(a * omegas[k][j] for k, a in enumerate(self.feedback[i])))
            for i in range(n if j < ORDER else 0):
                source = self.q_step * (slopes[i].sigma * ys[i][j] >> SLOPE_BITS if j else slopes[i].value) // q
                us[i].append((source * UNIT - sum(xi[i][m] * us[i][j - m] for m in range(1, j + 1))) // xi[i][0])
                ys[i].append(-(us[i][j] * q + drifts[i][j] + feedbacks[i][j]) // (q * (j + 1)))
            for i in range(n - 1 if j < ORDER else 0):
                omegas[i].append(drifts[i][j] // (q * (j + 1)))
        defects = []
        for i in range(n):
            rate = [sum(terms) for terms in zip(self.rates(ys[i]), drifts[i], feedbacks[i], strict=True)]
            defects.append(self.defect(self.costs[i], slopes[i], ys[i], rate, xi[i], mixing.error, mixing.low[i]))
        for i in range(n - 1):  # q Δ ρ_ω = q α1ΔLŷ − q dω̂/dσ
            rate = [a - b for a, b in zip(drifts[i], self.rates(omegas[i]), strict=True)]
            defects.append(sum(map(abs, rate)) // self.q_step + 1)
        return Segment(ys, omegas, defects)

    def rates(self, polynomial: list[int]) -> list[int]:
        """``q d/dσ`` of a polynomial."""
        return [self.q * j * c for j, c in enumerate((*polynomial[1:], 0), 1)]

    def slope(self, cost: Cost, y: int) -> Slope:
        if cost.affine:
            a, b = cost.affine
            return Slope(floor(a * UNIT + b * y), 1, floor(b * (1 << SLOPE_BITS)))
        gradient = cost.slope(point(y))
        low = fixed_down(gradient)
        return Slope(low, fixed_up(gradient) - low, floor(cost.curvature(point(y)).lo * (1 << SLOPE_BITS)))

    def defect(self, cost: Cost, slope: Slope, y: list[int], rate: list[int], xi: list[int], error: int, xi_low: int
               ) -> int:
        """``|ρ|`` from ``−q Δ ξ ρ = q Δ (c'(y_0) + σd + (c'' − σ)d) + ξ·rate`` with ``d = ŷ − y_0``."""
        result = [0] * (2 * ORDER + 1)
        for j, a in enumerate(xi):
            for k, b in enumerate(rate):
                result[j + k] += a * b
        result[0] += self.q_step * slope.value * UNIT
        for j in range(1, ORDER + 1):
            result[j] += self.q_step * slope.sigma * y[j] << SCALE - SLOPE_BITS
        distance = sum(map(abs, y[1:]))
        sigma = Fraction(slope.sigma, 1 << SLOPE_BITS)
        if cost.affine:
            spread = fixed_up(abs(cost.affine[1] - sigma))
        else:
            spread = fixed_up((cost.curvature(point(y[0], distance)) - sigma).magnitude)
        bound = sum(map(abs, result)) + error * sum(map(abs, rate))
        bound += self.q_step * (slope.error * UNIT + spread * distance)
        return bound // (self.q_step * xi_low) + 1
