"""Is u* a polynomial in v? Exact normal form, and a proof when it is not (theory.md section 2, A5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy
from sympy.polys.rings import PolyElement, PolyRing

from symbolic.exact_field import ExactField, field_of
from symbolic.identity import MAX_OPERATIONS, degree_bound, excerpt, zero_test
from symbolic.plant import Exosystem

MAX_DEGREE = 16

# f(polynomial) with a nonconstant argument satisfies no algebraic equation over the rational functions
_TRANSCENDENTAL = (
    sympy.exp,
    sympy.sin,
    sympy.cos,
    sympy.tan,
    sympy.tanh,
    sympy.sinh,
    sympy.cosh,
    sympy.log,
    sympy.atan,
)


@dataclass(frozen=True)
class PolynomialParts:
    """``u = Σ_j c_j(w) q_j(v)``: q_j in ``ring`` (over ``domain``), linearly independent c_j.

    ``independent`` is ``False`` if the c_j contain functions whose independence was not decided: the q_j then span the
    coefficients of u, perhaps more.
    """

    polynomials: tuple[PolyElement, ...]
    ring: PolyRing
    domain: Any
    independent: bool


@dataclass(frozen=True)
class NotPolynomial:
    """``term`` stands in the way; ``proved``: u is certainly not a polynomial in v."""

    term: str
    reason: str
    proved: bool


def polynomial_parts(u: sympy.Expr, exosystem: Exosystem) -> PolynomialParts | NotPolynomial:
    """Expands u in the parameters; the coefficients of the different functions of the parameters are the q_j."""
    v = exosystem.states
    entries = list(exosystem.S)
    if degree_bound(u, v) > MAX_DEGREE:
        return NotPolynomial("u*", f"its degree in v may pass {MAX_DEGREE}, which is not tried", False)
    if field_of(entries).kernels:
        return NotPolynomial("S", "the entries of S are not algebraic numbers", False)
    if u == 0 or (not u.is_rational_function() and zero_test(u).verdict == "holds"):
        u = sympy.Integer(0)
    exact = field_of([u, *v, *entries])
    if any(kernel.has(*v) for kernel, _ in exact.kernels) and v:
        simpler = sympy.simplify(u) if u.count_ops() <= MAX_OPERATIONS else u
        exact = field_of([simpler, *v, *entries])
        in_the_way = [kernel for kernel, _ in exact.kernels if kernel.has(*v)]
        if in_the_way:
            return _not_polynomial(simpler, in_the_way, exact, v)
        u = simpler
    if not exact.domain.is_FractionField:
        ring = PolyRing(("unused",), exact.domain)
        value = exact.element(u)
        return PolynomialParts((ring.ground_new(value),) if value else (), ring, exact.domain, True)
    element = exact.element(u)
    base = exact.domain.domain
    places = [exact.domain.symbols.index(name) for name in v]
    if any(monomial[place] for monomial in element.denom for place in places):
        denominator = exact.domain.field(element.denom)
        return NotPolynomial(
            f"1/({excerpt(exact.expression(denominator))})",
            "v in a denominator that does not cancel",
            not exact.kernels,
        )
    ring = PolyRing(v or ("unused",), base)
    parts: dict[tuple[int, ...], PolyElement] = {}
    for monomial, coefficient in element.numer.items():
        in_v = tuple(monomial[place] for place in places) or (0,)
        rest = tuple(power for place, power in enumerate(monomial) if place not in places)
        parts[rest] = parts.get(rest, ring.zero) + ring.term_new(in_v, coefficient)
    return PolynomialParts(tuple(parts.values()), ring, base, not exact.kernels)


def _is_rational_polynomial(expr: sympy.Expr) -> bool:
    names = expr.free_symbols
    return bool(names) and bool(expr.is_polynomial(*names)) and sympy.Poly(expr, *names).domain in (sympy.ZZ, sympy.QQ)


def _not_polynomial(
    u: sympy.Expr, kernels: list[sympy.Expr], exact: ExactField, v: tuple[sympy.Symbol, ...]
) -> NotPolynomial:
    """A transcendental function of v that does not cancel is a proof, and so are exponentials of different polynomials.

    Exponentials of polynomials that are linearly independent over Q modulo constants are algebraically independent over
    the rational functions (Ax); other functions may satisfy relations among each other.
    """
    used = exact.domain.to_sympy(exact.element(u)).free_symbols
    kernel = next((k for k in kernels if dict(exact.kernels)[k] in used), kernels[0])
    everywhere = [k for k, _ in exact.kernels]
    known = all(isinstance(k, _TRANSCENDENTAL) and _is_rational_polynomial(k.args[0]) for k in everywhere)
    exponents = {k.args[0].as_coeff_Mul()[1] for k in everywhere if isinstance(k, sympy.exp)}
    independent = len(everywhere) == 1 or len(exponents) == len(everywhere)
    return NotPolynomial(
        str(kernel), f"it contains {kernel}", known and independent and dict(exact.kernels)[kernel] in used
    )
