"""The matrices that ``∂f0/∂z`` can be: ``f̄0(z̄, 0, y, v, w) = A z̄`` with an ``A`` in their convex hull (mean value)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import product

import sympy

from certify.bounds.balls import NonFiniteError
from certify.bounds.smoothness import unproved_guard
from certify.bounds.suprema import range_bound
from certify.bounds.whole_line import line_bounds
from certify.inequalities.matrices import Matrix, matrix
from symbolic.constants import as_rational
from symbolic.plant import Agent, Exosystem, Interval
from symbolic.ranges import as_range, enclosure

MAX_VERTICES = 1024
TOLERANCE = Fraction(1, 1000)
Ends = tuple[Fraction | None, Fraction | None]
Point = Mapping[sympy.Symbol, sympy.Rational]


@dataclass(frozen=True)
class Vertex:
    """One matrix; ``at`` is the corner of ``W`` where ``∂f0/∂z`` is exactly that, None if it only bounds."""

    A: Matrix
    at: tuple[tuple[sympy.Symbol, sympy.Rational], ...] | None


@dataclass(frozen=True)
class Polytope:
    """Every ``∂f0/∂z`` is a convex combination of the vertices. ``exact``: each is taken at a corner of ``W``."""

    vertices: tuple[Vertex, ...]

    @property
    def exact(self) -> bool:
        return all(vertex.at is not None for vertex in self.vertices)


@dataclass(frozen=True)
class Unbounded:
    """No polytope, and why."""

    reason: str


def jacobian(agent: Agent) -> sympy.ImmutableMatrix:
    """``∂f0/∂z`` as expressions in ``z, x1, v`` and the parameters."""
    return sympy.ImmutableMatrix(agent.zero_dynamics).jacobian(agent.zero_states).applyfunc(sympy.expand)


def is_affine(agent: Agent) -> bool:
    """Whether ``f0`` is affine in ``z``, so that the zero dynamics are linear."""
    return not jacobian(agent).free_symbols & set(agent.zero_states)


def corners(agent: Agent, expressions: sympy.ImmutableMatrix) -> list[Point] | None:
    """The corners of the box of the parameters that occur; None when there are more than MAX_VERTICES."""
    used = [
        (name, interval)
        for name, interval in zip(agent.parameters, agent.parameter_box, strict=True)
        if name in expressions.free_symbols
    ]
    if 2 ** len(used) > MAX_VERTICES:
        return None
    ends = [dict.fromkeys((as_rational(interval.lo), as_rational(interval.hi))) for _, interval in used]
    return [dict(zip((name for name, _ in used), values, strict=True)) for values in product(*ends)]


def jacobian_polytope(agent: Agent, exosystem: Exosystem) -> Polytope | Unbounded:
    """The vertices over ``W`` where ``∂f0/∂z`` is multi-affine in the parameters alone, else those of a box of entries.

    ``z`` and ``x1 = y^r`` range over everything, ``v`` over what the exosystem never leaves.
    """
    obstacle = not_smooth(agent, exosystem)
    if obstacle is not None:
        return obstacle
    J = jacobian(agent)
    if J.free_symbols <= set(agent.parameters) and _multi_affine(J, agent.parameters):
        points = corners(agent, J)
        if points is not None:
            return Polytope(
                tuple(Vertex(matrix(J.xreplace(dict(point)).tolist()), tuple(point.items())) for point in points)
            )
    return _entry_box(agent, exosystem, J)


def not_smooth(agent: Agent, exosystem: Exosystem) -> Unbounded | None:
    """The part of ``f0`` that is not shown to be smooth for all ``z, x1, v`` and ``W``; None when all of it is."""
    box: dict[sympy.Symbol, Interval | None] = dict.fromkeys((*agent.zero_states, agent.chain[0], *exosystem.states))
    box.update(zip(agent.parameters, agent.parameter_box, strict=True))
    for k, side in enumerate(agent.zero_dynamics):
        guard = unproved_guard(side, box, agent.guards.of_zero_dynamics(k))
        if guard is not None:
            return Unbounded(f"f0 may not be smooth everywhere: {guard.demand}")
    return None


def _entry_box(agent: Agent, exosystem: Exosystem, J: sympy.ImmutableMatrix) -> Polytope | Unbounded:
    ranges: list[tuple[Fraction, ...]] = []
    for entry in J:
        low, high = entry_range(entry, agent, exosystem)
        if low is None or high is None:
            return Unbounded(f"the entry {entry} of ∂f0/∂z has no proved bounds")
        ranges.append((low,) if low == high else (low, high))
    size = J.shape[0]
    count = 1
    for choices in ranges:
        count *= len(choices)
    if count > MAX_VERTICES:
        return Unbounded(f"the entries of ∂f0/∂z have more than {MAX_VERTICES} combinations of ends")
    flat = product(*ranges)
    return Polytope(tuple(Vertex(tuple(row[k * size : (k + 1) * size] for k in range(size)), None) for row in flat))


def entry_range(entry: sympy.Expr, agent: Agent, exosystem: Exosystem) -> Ends:
    """Proved ends of an expression over all ``z`` and ``x1``, ``v(t)`` and the box ``W``; None where none was found.

    Sums fall apart into groups without common variables; a group of one variable that ranges over R is bounded over
    the whole line, a group of parameters by branch and bound, a mixed one by plain interval arithmetic.
    """
    box = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    if entry.free_symbols & set(exosystem.states):
        box |= _disturbance_box(exosystem)
    low: Fraction | None = Fraction(0)
    high: Fraction | None = Fraction(0)
    for group in _independent_groups(sympy.expand(entry)):
        ends = _group_range(group, box)
        low = None if low is None or ends[0] is None else low + ends[0]
        high = None if high is None or ends[1] is None else high + ends[1]
    return low, high


@lru_cache(maxsize=16)
def _disturbance_box(exosystem: Exosystem) -> dict[sympy.Symbol, Interval]:
    """What ``v(t)`` never leaves, where that is known."""
    from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds  # cvxpy takes a second to import

    found = exosystem_bounds(exosystem)
    return dict(zip(exosystem.states, found.box, strict=True)) if isinstance(found, ExosystemBounds) else {}


def _group_range(group: sympy.Expr, box: Mapping[sympy.Symbol, Interval]) -> Ends:
    try:
        if group.free_symbols <= set(box):
            found = range_bound(group, box, rtol=TOLERANCE)
            return found.lower.value, found.upper.value
        if len(group.free_symbols) == 1:
            line = line_bounds(group, next(iter(group.free_symbols)))
            return line.lower, line.upper
    except (NonFiniteError, ValueError):
        return None, None
    return enclosure(group, {name: as_range(box.get(name)) for name in group.free_symbols})


def _independent_groups(entry: sympy.Expr) -> list[sympy.Expr]:
    groups: list[sympy.Expr] = []
    for term in sympy.Add.make_args(entry):
        touching = [group for group in groups if group.free_symbols & term.free_symbols]
        groups = [group for group in groups if group not in touching]
        groups.append(sympy.Add(term, *touching))
    return groups


def _multi_affine(J: sympy.ImmutableMatrix, parameters: tuple[sympy.Symbol, ...]) -> bool:
    """Whether every entry is a polynomial with rational coefficients, of degree at most one in each parameter."""
    for entry in J:
        if not entry.is_polynomial(*parameters):
            return False
        polynomial = sympy.Poly(entry, *parameters) if parameters else sympy.Poly(entry, sympy.Dummy())
        if not (polynomial.domain.is_ZZ or polynomial.domain.is_QQ) or any(
            max(m, default=0) > 1 for m in polynomial.monoms()
        ):
            return False
    return True
