"""A nominal coordinator trajectory, step by step, with proved bounds of its defect (docs/certificate.md section 2).

Polynomials in ``σ = τ/Δ ∈ [0, 1]`` have fixed-point coefficients, and the trajectory is exactly what they say: only
``ξ`` and ``c'`` carry errors. ``q`` clears the denominators of ``α1ΔL``, ``α2ΔB``, ``Δ`` and ``κΔ``: all else is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import floor, lcm
from operator import add, sub

from certify.checker import linear
from certify.checker.linear import Matrix, dot
from certify.checker.rules.costs import Cost
from certify.checker.rules.mixing import ORDER, SCALE, UNIT, StepOfMixing, fixed_down, fixed_up, point

SLOPE_BITS = 64


@dataclass(frozen=True)
class Slope:
    """``c'(y) = value`` within ``error`` units, and any number ``sigma/2^64`` near ``c''(y)``; for a quadratic within
    ``spread`` units."""

    value: int
    error: int
    sigma: int
    spread: int | None = None


@dataclass(frozen=True)
class Segment:
    """``ŷ`` and ``ω̂`` on one step, coefficient lists; ``defects ≥ |ρ|`` for all components of ``(y, ω)``."""

    y: list[list[int]]
    omega: list[list[int]]
    defects: list[int]


class Stepper:
    """``y' = −κc'(y)/ξ − α1Ly − α2Bω``, ``ω' = α1(Ly)_(1…N−1)``, one step at a time."""

    def __init__(
        self, costs: tuple[Cost, ...], consensus: Matrix, feedback: Matrix, step: Fraction, gradient_gain: Fraction
    ) -> None:
        """``consensus = α1ΔL`` and ``feedback = α2ΔB``."""
        self.costs, gradient_step = costs, gradient_gain * step
        denominators = map(linear.common_denominator, (consensus, feedback))
        q = self.q = lcm(*denominators, step.denominator, gradient_step.denominator)
        whole = ([[int(entry * q) for entry in row] for row in matrix] for matrix in (consensus, feedback))
        self.consensus, self.feedback = whole
        self.q_step, self.q_gradient = int(q * step), int(q * gradient_step)
        self.affine = [_integers(*cost.affine) if cost.affine else None for cost in costs]

    def advance(self, mixing: StepOfMixing, y: list[int], omega: list[int]) -> Segment:
        """The step from ``y, ω``, on which all ``ξ_i^i`` are positive."""
        q, xi = self.q, mixing.taylor
        slopes = [self.slope(i, value) for i, value in enumerate(y)]
        ys, omegas = [y], [omega]  # by order, then by agent
        us: list[list[int]] = [[] for _ in y]  # κΔ c'(ŷ)/ξ
        drifts: list[list[int]] = []  # q α1Δ(Lŷ)_(1…N−1)
        pulls: list[list[int]] = []  # q (α1ΔLŷ + α2ΔBω̂)
        for j in range(ORDER + 1):
            flows = [dot(row, ys[j]) for row in self.consensus]
            drifts.append(flows[:-1])
            pulls.append(list(map(add, flows, [dot(row, omegas[j]) for row in self.feedback])))
            if j == ORDER:
                break
            for u, slope, value, x in zip(us, slopes, ys[j], xi, strict=True):
                source = self.q_gradient * (slope.sigma * value >> SLOPE_BITS if j else slope.value) // q
                u.append((source * UNIT - dot(x[1 : j + 1], u[::-1])) // x[0])
            scale = q * (j + 1)
            ys.append([-(u[j] * q + pull) // scale for u, pull in zip(us, pulls[j], strict=True)])
            omegas.append([drift // scale for drift in drifts[j]])
        polynomials, memory = list(map(list, zip(*ys, strict=True))), list(map(list, zip(*omegas, strict=True)))
        defects = []
        for i, pull in enumerate(zip(*pulls, strict=True)):
            rate = list(map(add, self.rates(polynomials[i]), pull))
            known = self.costs[i], slopes[i], polynomials[i]
            defects.append(self.defect(*known, rate, xi[i], mixing.error, mixing.low[i]))
        for omega_i, drift in zip(memory, zip(*drifts, strict=True), strict=True):  # q Δ ρ_ω = q α1ΔLŷ − q dω̂/dσ
            defects.append(sum(map(abs, map(sub, drift, self.rates(omega_i)))) // self.q_step + 1)
        return Segment(polynomials, memory, defects)

    def rates(self, polynomial: list[int]) -> list[int]:
        """``q d/dσ`` of a polynomial."""
        return [self.q * j * c for j, c in enumerate((*polynomial[1:], 0), 1)]

    def slope(self, i: int, y: int) -> Slope:
        cost, known = self.costs[i], self.affine[i]
        if known:
            constant, linear, denominator, sigma, spread = known
            return Slope((constant + linear * y) // denominator, 1, sigma, spread)
        gradient = cost.slope(point(y))
        low = fixed_down(gradient)
        return Slope(low, fixed_up(gradient) - low, floor(cost.curvature(point(y)).lo * (1 << SLOPE_BITS)))

    def defect(
        self, cost: Cost, slope: Slope, y: list[int], rate: list[int], xi: list[int], error: int, xi_low: int
    ) -> int:
        """``|ρ|`` from ``−q Δ ξ ρ = q κΔ (c'(y_0) + σd + (c'' − σ)d) + ξ·rate`` with ``d = ŷ − y_0``."""
        result = _product(xi, rate)
        result[0] += self.q_gradient * slope.value * UNIT
        for j in range(1, ORDER + 1):
            result[j] += self.q_gradient * slope.sigma * y[j] << SCALE - SLOPE_BITS
        distance = sum(map(abs, y[1:]))
        spread = slope.spread
        if spread is None:
            sigma = Fraction(slope.sigma, 1 << SLOPE_BITS)
            spread = fixed_up((cost.curvature(point(y[0], distance)) - sigma).magnitude)
        bound = sum(map(abs, result)) + error * sum(map(abs, rate))
        bound += self.q_gradient * (slope.error * UNIT + spread * distance)
        return bound // (self.q_step * xi_low) + 1


def _product(x: list[int], y: list[int]) -> list[int]:
    """Of two polynomials."""
    result = [0] * (len(x) + len(y) - 1)
    for i, a in enumerate(x):
        for k, b in enumerate(y, i):
            result[k] += a * b
    return result


def _integers(a: Fraction, b: Fraction) -> tuple[int, int, int, int, int]:
    """``a + b y`` as ``(constant + linear·y)/denominator`` in units, ``sigma`` near ``b``, and how near in units."""
    denominator = lcm(a.denominator, b.denominator)
    sigma = floor(b * (1 << SLOPE_BITS))
    spread = fixed_up(b - Fraction(sigma, 1 << SLOPE_BITS))
    return int(a * denominator) * UNIT, int(b * denominator), denominator, sigma, spread
