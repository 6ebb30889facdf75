"""A nominal coordinator trajectory and a proved bound on its defect (docs/certificate.md section 2).

The nominal trajectory may be anything: the coordinator's distance from it obeys a linear comparison inequality driven
by the
defect alone. Here it is a piecewise Taylor polynomial with rounded coefficients.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce

import sympy
from flint import arb, arb_mat, arb_poly, ctx

from certify.bounds.balls import PRECISION, Program, compile_expression, to_arb
from certify.coordinator.mixing import Mixing, Rows
from symbolic.plant import COST_VARIABLE

TAYLOR_ORDER = 6
WIDER = 4  # another formula for c'' may enclose it that much more widely; the defect is of second order in a step


@dataclass(frozen=True)
class CostGradient:
    """``c'`` and ``c''`` of one agent's cost, ready for rigorous evaluation; ``curvature`` when ``c''`` is constant.

    ``hessians`` are ``c''`` as it was differentiated and expanded: an interval is enclosed by both.
    """

    gradient: Program
    hessians: tuple[Program, Program]
    curvature: arb | None


def cost_gradient(cost: sympy.Expr) -> CostGradient:
    first = sympy.diff(cost, COST_VARIABLE)
    second = sympy.diff(first, COST_VARIABLE)
    expanded, arguments = sympy.expand(second), (COST_VARIABLE,)
    hessians = compile_expression(second, arguments), compile_expression(expanded, arguments)
    curvature = None if expanded.free_symbols else hessians[1]([arb(0)])
    return CostGradient(compile_expression(first, arguments), hessians, curvature)


@dataclass(frozen=True)
class Segment:
    """Nominal ``ŷ`` and ``ω̂`` on one step as polynomials in the time since its start, and bounds over the step.

    ``defect[i] >= |ρ_i|`` for the ``2N − 1`` components of ``(y, ω)``; ``jump`` bounds the step from its end to the
    next start.
    """

    reference: tuple[arb_poly, ...]
    integral: tuple[arb_poly, ...]
    defect: tuple[arb, ...]
    jump: tuple[arb, ...]


@dataclass(frozen=True)
class CoordinatorModel:
    """``y' = −c'(y)/ξ − α1 L y − α2 B ω``, ``ω' = α1 (L y)_(1 … N−1)``, ``B = [I; −(r_1 … r_(N−1))/r_N]``."""

    laplacian: Rows
    left_null_vector: tuple[Fraction, ...]
    alpha1: Fraction
    alpha2: Fraction
    costs: tuple[CostGradient, ...]

    @property
    def size(self) -> int:
        return len(self.laplacian)

    def integral_basis(self) -> Rows:
        """The ``N × (N−1)`` matrix ``B``, whose columns span ``{ζ : rᵀζ = 0}``."""
        n, r = self.size, self.left_null_vector
        rows = [tuple(Fraction(int(i == j)) for j in range(n - 1)) for i in range(n - 1)]
        return (*rows, tuple(-r[j] / r[n - 1] for j in range(n - 1)))


def nominal_trajectory(
    model: CoordinatorModel, mixing: Mixing, start: Sequence[Fraction]
) -> tuple[tuple[Segment, ...], tuple[arb, ...], tuple[arb, ...]]:
    """The segments from ``y^r(0) = start``, ``ω(0) = 0``, and the nominal ``y, ω`` at their end."""
    with ctx.workprec(PRECISION):
        stepper = _Stepper(model, mixing)
        y = [to_arb(value) for value in start]
        omega = [arb(0)] * (model.size - 1)
        segments = []
        for k in range(mixing.steps):
            segment, y, omega = stepper.advance(k, y, omega)
            segments.append(segment)
        return tuple(segments), tuple(y), tuple(omega)


class _Stepper:
    """Everything that stays the same from step to step."""

    def __init__(self, model: CoordinatorModel, mixing: Mixing) -> None:
        self.size = model.size
        self.costs = model.costs
        self.mixing = mixing
        self.step = to_arb(mixing.step)
        self.consensus = _matrix(model.laplacian, model.alpha1)
        self.feedback = _matrix(model.integral_basis(), model.alpha2)
        laplacian = arb_mat(_matrix(model.laplacian, Fraction(1)))
        powers = [arb_mat(self.size, self.size, [int(i == j) for i in range(self.size) for j in range(self.size)])]
        for j in range(1, TAYLOR_ORDER + 1):
            powers.append(laplacian * powers[-1] * arb(-1) / arb(j))
        self.powers = powers
        norm = to_arb(max(sum(abs(entry) for entry in row) for row in model.laplacian))
        self.remainder = (norm * self.step) ** (TAYLOR_ORDER + 1) / arb(TAYLOR_ORDER + 1).fac()

    def advance(self, k: int, y: list[arb], omega: list[arb]) -> tuple[Segment, list[arb], list[arb]]:
        n = self.size
        terms = [(power * self.mixing.matrices[k]).tolist() for power in self.powers]
        xi = [[term[i][i] for term in terms] for i in range(n)]
        slope = [self._slope(i, y[i]) for i in range(n)]
        gradient = [self.costs[i].gradient([y[i]]) for i in range(n)]
        reference, integral = self._taylor(y, omega, xi, gradient, slope)
        defect = [self._defect(k, i, reference, integral, xi[i], gradient[i], slope[i]) for i in range(n)]
        drift = _combine(self.consensus, reference)
        defect += [self._size(drift[i] - integral[i].derivative()) for i in range(n - 1)]
        ends = [poly(self.step) for poly in (*reference, *integral)]
        rounded = [end.mid() for end in ends]
        jump = tuple(abs(end - mid).upper() for end, mid in zip(ends, rounded, strict=True))
        return Segment(tuple(reference), tuple(integral), tuple(defect), jump), rounded[:n], rounded[n:]

    def _slope(self, i: int, value: arb) -> arb:
        curvature = self.costs[i].curvature
        return curvature if curvature is not None else self.costs[i].hessians[0]([value]).mid()

    def _taylor(
        self, y: list[arb], omega: list[arb], xi: list[list[arb]], gradient: list[arb], slope: list[arb]
    ) -> tuple[list[arb_poly], list[arb_poly]]:
        n = self.size
        ys, omegas = [y], [omega]
        us: list[list[arb]] = []
        for j in range(TAYLOR_ORDER):
            source = gradient if j == 0 else [slope[i] * ys[j][i] for i in range(n)]
            u = [
                ((source[i] - sum((xi[i][m] * us[j - m][i] for m in range(1, j + 1)), arb(0))) / xi[i][0]).mid()
                for i in range(n)
            ]
            us.append(u)
            drift = _apply(self.consensus, ys[j])
            feedback = _apply(self.feedback, omegas[j])
            ys.append([((-u[i] - drift[i] - feedback[i]) / (j + 1)).mid() for i in range(n)])
            omegas.append([(drift[i] / (j + 1)).mid() for i in range(n - 1)])
        return (
            [arb_poly([c[i] for c in ys]) for i in range(n)],
            [arb_poly([c[i] for c in omegas]) for i in range(n - 1)],
        )

    def _defect(
        self,
        k: int,
        i: int,
        reference: list[arb_poly],
        integral: list[arb_poly],
        xi: list[arb],
        gradient: arb,
        slope: arb,
    ) -> arb:
        """``|ρ_i|``, from ``ξ_i ρ_i = −c_i'(ŷ_i) − ξ_i (ŷ_i' + α1 (Lŷ)_i + α2 (Bω̂)_i)``."""
        rate = reference[i].derivative() + _row(self.consensus, i, reference) + _row(self.feedback, i, integral)
        departure = reference[i] - reference[i][0]
        linear = gradient + slope * departure
        distance = self._size(departure)
        curvature = self._curvature_spread(i, reference[i][0], distance, slope)
        scaled = self._size(linear + arb_poly(xi) * rate) + self.remainder * self._size(rate) + curvature * distance
        return (scaled / self.mixing.ranges[k][i][0]).upper()

    def _curvature_spread(self, i: int, centre: arb, distance: arb, slope: arb) -> arb:
        """``sup |c_i'' − σ|`` on the step, with room for the checker's own enclosure; zero for a quadratic cost."""
        if self.costs[i].curvature is not None:
            return arb(0)
        side = (centre - distance).lower(), (centre + distance).upper()
        found = [ends for hessian in self.costs[i].hessians if (ends := hessian.ends([side])) is not None]
        if not found:
            return arb.nan()
        low, high = reduce(arb.max, (ends[0] for ends in found)), reduce(arb.min, (ends[1] for ends in found))
        return WIDER * abs(low - slope).upper().max(abs(high - slope).upper())

    def _size(self, poly: arb_poly) -> arb:
        """``sup |poly|`` on ``[0, step]``."""
        total = arb(0)
        for coefficient in reversed(poly.coeffs()):
            total = total * self.step + abs(coefficient).upper()
        return total.upper()


def _matrix(rows: Rows, factor: Fraction) -> list[list[arb]]:
    return [[to_arb(entry * factor) for entry in row] for row in rows]


def _apply(matrix: list[list[arb]], vector: Sequence[arb]) -> list[arb]:
    return [sum((a * x for a, x in zip(row, vector, strict=True)), arb(0)) for row in matrix]


def _row(matrix: list[list[arb]], index: int, polys: Sequence[arb_poly]) -> arb_poly:
    return sum((a * p for a, p in zip(matrix[index], polys, strict=True)), arb_poly([]))


def _combine(matrix: list[list[arb]], polys: Sequence[arb_poly]) -> list[arb_poly]:
    return [_row(matrix, i, polys) for i in range(len(matrix))]
