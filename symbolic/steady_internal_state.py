"""The steady state ``T τ`` of the internal model, ``τ = col(u*, du*/dt, …)`` along v' = S v (theory.md section 3)."""

from __future__ import annotations

import sympy
from sympy.polys.rings import PolyElement

from symbolic.annihilator import lie_derivative
from symbolic.exact_field import Element, field_of
from symbolic.plant import Exosystem


def steady_internal_state(
    u_star: sympy.Expr, T: tuple[tuple[sympy.Expr, ...], ...], exosystem: Exosystem
) -> tuple[sympy.Expr, ...]:
    """One expression per row of T; ``u_star`` is a polynomial in v with coefficients in the parameters.

    Only the numerator of u* depends on v, so the derivatives are taken of polynomials.
    """
    if not T:
        return ()
    rates = tuple(exosystem.S * sympy.Matrix(exosystem.states)) if exosystem.states else ()
    exact = field_of([u_star, *exosystem.states, *exosystem.S, *(entry for row in T for entry in row)])
    if not exact.domain.is_FractionField:  # a constant: its derivatives are zero
        return tuple(row[0] * u_star for row in T)
    field = exact.domain.field
    element = exact.element(u_star)
    speeds = {name: exact.element(rate) for name, rate in zip(exosystem.states, rates, strict=True)}
    velocity = [
        speeds[name].numer.quo_ground(speeds[name].denom.LC) if name in speeds else field.ring.zero
        for name in field.symbols
    ]
    tau = [element.numer]
    for _ in range(len(T) - 1):
        tau.append(lie_derivative(tau[-1], velocity))
    base = field.ring.domain
    sums = [_combination([base.from_sympy(entry) for entry in row], tau) for row in T]
    if element.denom.is_ground:
        return tuple(_named(exact.kernels, total.quo_ground(element.denom.LC).as_expr()) for total in sums)
    denominator = element.denom.as_expr()
    return tuple(_named(exact.kernels, total.as_expr() / denominator) for total in sums)


def _combination(weights: list[Element], polynomials: list[PolyElement]) -> PolyElement:
    ring = polynomials[0].ring
    terms: dict[tuple[int, ...], Element] = {}
    for weight, polynomial in zip(weights, polynomials, strict=True):
        for monomial, coefficient in polynomial.items():
            terms[monomial] = terms.get(monomial, ring.domain.zero) + weight * coefficient
    return ring.from_dict(terms)


def _named(kernels: tuple[tuple[sympy.Expr, sympy.Symbol], ...], expr: sympy.Expr) -> sympy.Expr:
    return expr.xreplace({stand_in: kernel for kernel, stand_in in kernels})
