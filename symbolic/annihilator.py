"""The least linear differential equation with constant coefficients of given polynomials in v along v' = S v."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import sympy
from sympy.polys.rings import PolyElement, PolyRing

from symbolic.exact_field import Element

LAMBDA = sympy.Symbol("lambda")


class OrderExceeded(Exception):
    """The annihilating polynomial has a larger degree than was allowed."""


def lie_derivative(polynomial: PolyElement, velocity: Iterable[PolyElement]) -> PolyElement:
    """``L_S q = Σ_i (S v)_i ∂q/∂v_i``; ``velocity`` gives the rates of the first generators, the others rest."""
    result = polynomial.ring.zero
    for generator, speed in zip(polynomial.ring.gens, velocity, strict=False):
        if speed:
            result += speed * polynomial.diff(generator)
    return result


def least_annihilator(
    polynomials: Iterable[PolyElement], velocity: list[PolyElement], domain: Any, max_order: int
) -> sympy.Poly:
    """Monic ``P`` of least degree with ``P(L_S) q = 0`` for every given q: the least common multiple of theirs.

    Raises ``OrderExceeded`` if its degree passes ``max_order``.
    """
    common = sympy.Poly(1, LAMBDA, domain=domain)
    for polynomial in polynomials:
        if _applied(common, polynomial, velocity):
            common = common.lcm(_annihilator(polynomial, velocity, domain, max_order)).monic()
        if common.degree() > max_order:
            raise OrderExceeded
    return common


def _applied(operator: sympy.Poly, polynomial: PolyElement, velocity: list[PolyElement]) -> PolyElement:
    """``P(L_S) q`` by Horner's rule."""
    result = polynomial.ring.zero
    for coefficient in operator.rep.to_list():
        result = lie_derivative(result, velocity) + polynomial.mul_ground(coefficient)
    return result


def _annihilator(polynomial: PolyElement, velocity: list[PolyElement], domain: Any, max_order: int) -> sympy.Poly:
    """The first linear dependence in q, L_S q, L_S² q, …, found by elimination that keeps track of the combinations."""
    echelon: list[tuple[tuple[int, ...], dict[Any, Element], list[Element]]] = []
    current = polynomial
    for k in range(max_order + 2):
        vector, combination = dict(current), [domain.zero] * k + [domain.one]
        for pivot, reduced, combined in echelon:
            factor = vector.get(pivot, domain.zero)
            if factor:
                for monomial, entry in reduced.items():
                    vector[monomial] = vector.get(monomial, domain.zero) - factor * entry
                for j, entry in enumerate(combined):
                    combination[j] -= factor * entry
        vector = {monomial: entry for monomial, entry in vector.items() if entry}
        if not vector:
            return sympy.Poly.from_list(combination[::-1], LAMBDA, domain=domain)
        pivot = next(iter(vector))
        inverse = domain.one / vector[pivot]
        echelon.append((pivot, {m: entry * inverse for m, entry in vector.items()}, [c * inverse for c in combination]))
        current = lie_derivative(current, velocity)
    raise OrderExceeded


def velocity_of(S: sympy.Matrix, ring: PolyRing, generators: list[PolyElement], domain: Any) -> list[PolyElement]:
    """``S v`` as polynomials of the ring, in the order of ``generators``."""
    return [
        sum((generators[j].mul_ground(domain.from_sympy(S[i, j])) for j in range(len(generators))), ring.zero)
        for i in range(len(generators))
    ]
