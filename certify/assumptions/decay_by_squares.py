"""The decay of a polynomial ``V0`` along the zero dynamics, by sums of squares at the corners of ``W`` (A6)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import sympy

from certify.assumptions.zero_jacobian import corners
from certify.assumptions.zero_samples import ZeroDynamics
from certify.bounds.rationals import round_down
from certify.bounds.sums_of_squares import NoProof, largest_multiple, prove_nonnegative
from symbolic.constants import as_rational

_SHRINK = (Fraction(95, 100), Fraction(1, 2), Fraction(1, 100))
_SHORT_BITS = 16


@dataclass(frozen=True)
class Cases:
    """Polynomials that must all exceed ``t‖z̄‖²`` wherever every polynomial of the domain is nonnegative."""

    polynomials: tuple[sympy.Poly, ...]
    domain: tuple[sympy.Poly, ...] = ()


def forms(derivative: sympy.Expr, dynamics: ZeroDynamics) -> list[tuple[str, sympy.Expr]]:
    """The derivative for every ``ζ`` (which is more than needed), then for ``ζ = z*(s*, v, w)``."""
    if not derivative.free_symbols & set(dynamics.base):
        return [("for all z̄", derivative)]
    forms = [("around every point", derivative)]
    if dynamics.base_values is not None:
        at_base = dict(zip(dynamics.base, dynamics.base_values, strict=True))
        forms.append(("around z*", sympy.expand(derivative.xreplace(at_base))))
    return forms


def cases(derivative: sympy.Expr, dynamics: ZeroDynamics) -> Cases | str:
    """``−V̇0`` at the corners of ``W``, but a parameter in which it is not affine stays, bounded by its interval."""
    agent = dynamics.agent
    gens = tuple(sorted(derivative.free_symbols | set(agent.zero_states), key=str))
    if not derivative.is_polynomial(*gens):
        return "the derivative is not a polynomial"
    polynomial = sympy.Poly(-derivative, *gens)
    if not (polynomial.domain.is_ZZ or polynomial.domain.is_QQ):
        return "the derivative has coefficients that are not rational"
    box = {name: end for name, end in zip(agent.parameters, agent.parameter_box, strict=True) if name in gens}
    affine = [name for name in box if polynomial.degree(name) <= 1]
    points = corners(agent, sympy.ImmutableMatrix([affine]))
    if points is None:
        return "W has too many corners"
    rest = tuple(name for name in gens if name not in affine)
    domain = tuple(
        sympy.Poly((name - as_rational(end.lo)) * (as_rational(end.hi) - name), *rest)
        for name, end in box.items()
        if name not in affine
    )
    return Cases(tuple(sympy.Poly((-derivative).xreplace(dict(point)), *rest) for point in points), domain)


def largest_decay(given: Cases, states: tuple[sympy.Symbol, ...]) -> Fraction | None:
    """A proved ``t > 0``, close to the largest, with ``p − t‖z̄‖² ≥ 0`` by sums of squares for every ``p``; or None."""
    gens = given.polynomials[0].gens
    square = sympy.Poly(sum(name**2 for name in states), *gens)
    estimates = [largest_multiple(p, square, given.domain, states) for p in given.polynomials]
    if any(estimate is None or estimate <= 0 for estimate in estimates):
        return None
    best = min(estimate for estimate in estimates if estimate is not None)
    for factor in _SHRINK:
        t = round_down(best * factor, _SHORT_BITS)
        shifted = [p - square * as_rational(t) for p in given.polynomials]
        if not any(isinstance(prove_nonnegative(p, given.domain, states), NoProof) for p in shifted):
            return t
    return None
