"""The nominal curve of a coordinator that waited (docs/coordinator.md): its residual, stretch by stretch.

``ŷ`` is the witness's, ``ζ̂ = α1 L ∫ŷ`` follows exactly, so that ``rᵀζ̂ = 0`` and only ``y`` has a residual:

    −(Δ/2) ρ_i = (κΔ/2r_i)(c_i'(ŷ_i) − φ c_i'(ŷ_i(t_mix))) + (α1Δ/2)(Lŷ)_i + (α1α2Δ/2)(L∫ŷ)_i + dŷ_i/dσ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import pairwise, zip_longest
from math import ceil, factorial, floor, lcm

from certify.checker.certificate import Claim, HeldWitness
from certify.checker.intervals import Interval, enclose
from certify.checker.linear import Matrix
from certify.checker.rules import chebyshev
from certify.checker.rules.assumptions import Facts
from certify.checker.rules.costs import Cost
from certify.checker.verdict import require, spend

TAYLOR = 6  # of c' around the middle of a stretch; the rest is of the order of its seventh power
SOFT_TERMS = 24  # of e^(−x) for x ≤ 2: the next one is 2^25/25! < 2^−58
LONGEST = 2  # νΔ/2 of one stretch
FINE = 128  # bits of the Chebyshev coefficients of the soft start


@dataclass(frozen=True)
class Stretch:
    """From ``times[k]`` to ``times[k + 1]``, per agent: ``ŷ`` and ``dŷ/dσ``, ``residuals ≥ |ρ|Δ/2``, ``pulls`` no less
    than the first term of the residual, ``jumps`` at its end. ``softness ≥ φ``."""

    length: Fraction
    y: list[list[int]]
    slopes: list[list[int]]
    residuals: list[int]
    pulls: list[int]
    jumps: list[int]
    softness: Fraction


class Curve:
    """``start``, ``end``: ``ŷ`` at both ends, in units; ``memory``: ``ζ̂`` at the end."""

    def __init__(
        self, claim: Claim, witness: HeldWitness, facts: Facts, L: Matrix, r: Sequence[Fraction], guard: int
    ) -> None:
        self.claim, self.witness, self.costs, self.r = claim, witness, facts.costs, r
        self.unit = witness.unit / (1 << guard)
        self.y = [[[a << guard for a in polynomial] for polynomial in step] for step in witness.curve]
        self.size = len(r)
        self.neighbours, self.clear = zip(*map(_whole, L), strict=True)
        self.start = [chebyshev.at_start(polynomial) for polynomial in self.y[0]]
        self.end = [sum(polynomial) for polynomial in self.y[-1]]
        self.ticks = lcm(*(time.denominator for time in witness.times))
        length = max(len(polynomial) for step in self.y for polynomial in step)
        self.scale = chebyshev.integral_scale(length)
        self.integral = [0] * self.size  # of ŷ since t_mix, in units/(2·ticks·scale)
        self.at_start = [
            self.units(cost.slope(enclose(y * self.unit))) for cost, y in zip(self.costs, self.start, strict=True)
        ]
        self.softness_at_end = self.softness(witness.times[-1])
        self.memory: list[Fraction] = []

    def units(self, slope: Interval) -> Interval:
        """A slope of a cost times ``κ``, in multiples of ``unit`` per time."""
        return slope * (self.claim.gradient_gain / self.unit)

    def softness(self, time: Fraction) -> Interval:
        """``φ = e^(−ν(t − t_mix))``, or 0 without a soft start."""
        nu = self.claim.softening
        return enclose(-nu * (time - self.claim.mixing_time)).exp() if nu else Interval(0, 0)

    def stretches(self) -> list[Stretch]:
        """All of them, in order; then ``memory`` is known."""
        starts = [list(map(chebyshev.at_start, step)) for step in self.y[1:]] + [self.end]
        found = [
            self.stretch(*times, y, following)
            for times, y, following in zip(pairwise(self.witness.times), self.y, starts, strict=True)
        ]
        factor = self.claim.alpha1 * self.unit / (2 * self.ticks * self.scale)
        self.memory = [
            factor * Fraction(sum(w * self.integral[j] for j, w in row), q)
            for row, q in zip(self.neighbours, self.clear, strict=True)
        ]
        return found

    def stretch(self, start: Fraction, end: Fraction, y: list[list[int]], following: list[int]) -> Stretch:
        """One step of the walk."""
        half, ticks = (end - start) / 2, int((end - start) * self.ticks)
        spend(self.size * 6_000)
        integrals = [chebyshev.integral(polynomial, self.scale) for polynomial in y]
        slopes = list(map(chebyshev.derivative, y))
        consensus, memory = self.claim.alpha1 * half, self.claim.alpha1 * self.claim.alpha2 * half
        memory /= 2 * self.ticks * self.scale
        phi = self.softness(start)
        residuals, pulls = [], []
        for i, (row, q) in enumerate(zip(self.neighbours, self.clear, strict=True)):
            pull, error = self.pull(i, y[i], half, phi)
            flow = _combined(row, y)
            kept = [ticks * entry for entry in _combined(row, integrals)]
            kept[0] += sum(w * self.integral[j] for j, w in row)
            terms = [pull, _times(flow, consensus / q), _times(kept, memory / q), slopes[i]]
            total = [sum(entries) for entries in zip_longest(*terms, fillvalue=0)]
            residuals.append(chebyshev.size(total) + error + _floors(flow) + _floors(kept))
            pulls.append(chebyshev.size(pull) + error)
        self.integral = [known + ticks * sum(step) for known, step in zip(self.integral, integrals, strict=True)]
        jumps = [abs(sum(polynomial) - after) for polynomial, after in zip(y, following, strict=True)]
        softness = Fraction(ceil(phi.hi * (1 << 64)), 1 << 64)
        return Stretch(2 * half, y, slopes, residuals, pulls, jumps, softness)

    def pull(self, i: int, y: list[int], half: Fraction, phi: Interval) -> tuple[list[int], int]:
        """``(κΔ/2r_i)(c_i'(ŷ_i) − φ c_i'(ŷ_i(t_mix)))`` and how far it may be off."""
        factor = half / self.r[i]
        result, error = _gradient(self.costs[i], y, self.unit, self.claim.gradient_gain * factor)
        if self.claim.softening:
            shape, off = _decay(self.claim.softening * half)
            level = self.at_start[i] * phi * factor
            middle, radius = floor(level.lo), ceil(level.hi) - floor(level.lo)
            result = _added(result, [-(middle * entry >> FINE) for entry in shape])
            error += radius + (len(shape) if middle else 0) + ceil(abs(middle) * off)
        return result, error


def _gradient(cost: Cost, y: list[int], unit: Fraction, factor: Fraction) -> tuple[list[int], int]:
    """``factor·c'(ŷ)`` in units: exactly up to rounding for quadratics, else by Taylor around ``ŷ``'s mean."""
    if cost.affine:
        constant, slope = cost.affine
        result = _times(y, slope * factor)
        result[0] += floor(constant * factor / unit)
        return result, _floors(y) + (constant != 0)
    spend(20_000)
    degree, distance = len(y) - 1, max(chebyshev.spread(y), 1)
    middle, reach = y[0] * unit, distance * unit
    here = cost.slopes(enclose(middle), TAYLOR - 1)
    around = cost.slopes(enclose(middle) + Interval(-1, 1) * reach, TAYLOR)[TAYLOR]
    shape = [(entry << FINE) // distance for entry in (0, *y[1:])]  # d/distance, at most 1 in size
    result, error = [0], 0
    power, off = [1 << FINE], 0  # its k-th power in units of 2^−FINE, and how far it may be off
    for k in range(TAYLOR + 1):
        coefficient = (here[k] if k < TAYLOR else around) * (factor * reach**k / factorial(k) / unit)
        level, radius = floor(coefficient.lo), ceil(coefficient.hi) - floor(coefficient.lo)
        result = _added(result, [level * entry >> FINE for entry in power])
        error += radius + (abs(level) * off >> FINE) + 1 + len(power)
        longer = [entry >> FINE + 1 for entry in chebyshev.product(power, shape)]
        off += (off >> FINE - 8) + 1 + len(shape) + len(longer) + chebyshev.size(longer[degree + 1 :])
        power = longer[: degree + 1]
    return result, error


@cache
def _decay(rate: Fraction) -> tuple[list[int], Fraction]:
    """``e^(−rate(1 + σ))`` on ``[−1, 1]`` in units of ``2^−FINE``, and how far the sum may be off (of 1)."""
    require(rate <= LONGEST, "coordinator: a stretch is longer than the soft start allows", rate=rate)
    exact = [Fraction(0)] * (SOFT_TERMS + 1)
    for j, row in enumerate(_monomials()):
        term = (-rate) ** j / factorial(j)
        for k, entry in enumerate(row):
            exact[k] += term * entry
    scaled = [enclose(-rate).exp() * entry * (1 << FINE) for entry in exact]
    rounding = sum(ceil(entry.hi) - floor(entry.lo) for entry in scaled)
    rest = 2 * rate ** (SOFT_TERMS + 1) / factorial(SOFT_TERMS + 1)  # a geometric series with a ratio below 1/2
    return [floor(entry.lo) for entry in scaled], Fraction(rounding, 1 << FINE) + rest


@cache
def _monomials() -> list[list[Fraction]]:
    return chebyshev.monomials(SOFT_TERMS)


def _whole(row: Sequence[Fraction]) -> tuple[list[tuple[int, int]], int]:
    """The entries of a row that are not zero, with their columns, as integers over one denominator."""
    q = lcm(*(entry.denominator for entry in row))
    return [(j, int(entry * q)) for j, entry in enumerate(row) if entry], q


def _combined(row: Sequence[tuple[int, int]], polynomials: Sequence[Sequence[int]]) -> list[int]:
    """``Σ_j w_j p_j``."""
    parts = [[weight * entry for entry in polynomials[j]] for j, weight in row]
    return [sum(entries) for entries in zip_longest(*parts, fillvalue=0)] if parts else [0]


def _times(polynomial: Sequence[int], factor: Fraction) -> list[int]:
    """Every coefficient times the factor, rounded down."""
    p, q = factor.numerator, factor.denominator
    return [entry * p // q for entry in polynomial]


def _floors(polynomial: Sequence[int]) -> int:
    """How many coefficients of a multiple are rounded: 0 stays 0."""
    return sum(map(bool, polynomial))


def _added(a: Sequence[int], b: Sequence[int]) -> list[int]:
    return [x + y for x, y in zip_longest(a, b, fillvalue=0)]
