"""The optimum ``s* = argmin Σ c_i(s)``: exact if proved rational, else in a proved enclosure (theory.md section 1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import sympy

from certify.bounds.balls import compile_expression, to_arb
from certify.bounds.intervals import simplest_between
from certify.curvature import Curvature, cost_curvature
from symbolic.constants import as_fraction, as_rational
from symbolic.plant import COST_VARIABLE, Interval, Plant

WIDTH = Fraction(1, 10**12)
_DOUBLINGS = 100


class NoOptimumError(ValueError):
    """A cost without the bounds of A1, or no signs within reach: nothing is known about the optimum."""


@dataclass(frozen=True)
class Optimum:
    """``s*`` lies in ``enclosure``; ``exact`` is its value where that was proved (then the enclosure is that point)."""

    exact: Fraction | None
    enclosure: Interval


@lru_cache(maxsize=4)
def optimum(plant: Plant) -> Optimum:
    """The minimiser of the sum of all costs, in an enclosure no wider than ``1e-12·max(1, |s*|)``.

    ``Σ c_i'`` increases without bound (A1), so two proved signs enclose its only zero. Computed once for all steps of a
    command. Raises NoOptimumError when A1 is not proved for every agent, or the balls are too wide to show the signs.
    """
    for agent in plant.agents:
        curvature = cost_curvature(agent.cost)
        if not isinstance(curvature, Curvature):
            raise NoOptimumError(f"agent {agent.id}: {curvature.reason}")
    slope = sympy.Add(*(sympy.diff(agent.cost, COST_VARIABLE) for agent in plant.agents))
    root = _linear_root(slope)
    if root is not None:
        return Optimum(root, Interval(root, root))
    enclosure = _enclosure(_sign(slope))
    candidate = simplest_between(enclosure.lo, enclosure.hi)
    if sympy.expand(slope.xreplace({COST_VARIABLE: as_rational(candidate)})).is_zero:
        return Optimum(candidate, Interval(candidate, candidate))
    return Optimum(None, enclosure)


def _linear_root(slope: sympy.Expr) -> Fraction | None:
    """The root of a slope that is linear with rational coefficients."""
    if not slope.is_polynomial(COST_VARIABLE):
        return None
    polynomial = sympy.Poly(slope, COST_VARIABLE, extension=True)
    if polynomial.degree() != 1:
        return None
    root = sympy.radsimp(-polynomial.nth(0) / polynomial.nth(1))
    return as_fraction(root) if isinstance(root, sympy.Rational) else None


def _sign(slope: sympy.Expr) -> Callable[[Fraction], int]:
    program = compile_expression(slope, (COST_VARIABLE,))

    def sign(s: Fraction) -> int:
        """1 or −1 when proved; 0 when the ball around the value holds zero."""
        ball = program([to_arb(s)])
        return 1 if ball > 0 else -1 if ball < 0 else 0

    return sign


def _enclosure(sign: Callable[[Fraction], int]) -> Interval:
    """Bisection from a bracket found by doubling; the points tried are dyadic, hence short."""
    low, high = _bracket(sign)
    while high - low > WIDTH * max(Fraction(1), min(abs(low), abs(high)) if low * high > 0 else Fraction(0)):
        middle = (low + high) / 2
        found = sign(middle)
        if found == 0:
            return _around(middle, sign)
        low, high = (low, middle) if found > 0 else (middle, high)
    return Interval(low, high)


def _bracket(sign: Callable[[Fraction], int]) -> tuple[Fraction, Fraction]:
    bracket = []
    for direction in (-1, 1):
        end = next((s for k in range(_DOUBLINGS) if sign(s := Fraction(direction * 2**k)) == direction), None)
        if end is None:
            raise NoOptimumError(f"no sign of Σ c_i' was seen up to |s| = 2^{_DOUBLINGS}")
        bracket.append(end)
    return bracket[0], bracket[1]


def _around(middle: Fraction, sign: Callable[[Fraction], int]) -> Interval:
    """The tightest enclosure around a point whose sign is not seen: usually the root itself."""
    width = WIDTH / 4
    low, high = middle - width, middle + width
    if sign(low) < 0 < sign(high):
        return Interval(low, high)
    raise NoOptimumError("the balls are too wide to enclose the optimum to 1e-12")
