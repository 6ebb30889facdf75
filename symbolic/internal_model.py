"""Internal models: A5 decided, the least generator of u*, and the Sylvester equation (theory.md sections 2, 3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import sympy
from sympy.polys.matrices import DomainMatrix

from symbolic.annihilator import LAMBDA, OrderExceeded, least_annihilator, velocity_of
from symbolic.design import internal_model_pair
from symbolic.exact_field import Number, as_expression, as_number
from symbolic.identity import excerpt
from symbolic.plant import COST_VARIABLE, Agent, Exosystem
from symbolic.point_parameters import without_point_parameters
from symbolic.polynomial_in_v import NotPolynomial, polynomial_parts
from symbolic.steady_state import SteadyState

Row = tuple[Number, ...]
MAX_ORDER = 24


@dataclass(frozen=True)
class InternalModel:
    """``η' = M η + N u`` with ``T Φ − M T = N Γ`` and ``psi = Γ T⁻¹`` (1 × s_i), all exact.

    ``ell = (ℓ_1 … ℓ_s)``: ``d^s u*/dt^s = Σ ℓ_k d^(k−1)u*/dt^(k−1)`` for every w. ``order = 0`` (all fields empty) when
    u* vanishes. Entries are ``Fraction`` when rational, SymPy numbers otherwise; M and N are rational.
    ``least``: no shorter relation exists (``False``: not proved, u* has functions whose independence is not decided).
    ``spectrum``: are the eigenvalues of Φ distinct with zero real part, ``holds | fails | unknown``.
    """

    order: int
    ell: Row = ()
    Phi: tuple[Row, ...] = ()
    Gamma: Row = ()
    M: tuple[tuple[Fraction, ...], ...] = ()
    N: tuple[Fraction, ...] = ()
    T: tuple[Row, ...] = ()
    psi: Row = ()
    least: bool = True
    spectrum: str = "holds"

    @property
    def characteristic(self) -> sympy.Expr:
        """``λ^s − ℓ_s λ^(s−1) − … − ℓ_1``, factored."""
        return sympy.factor(LAMBDA**self.order - sum(as_expression(c) * LAMBDA**k for k, c in enumerate(self.ell)))


@dataclass(frozen=True)
class NoInternalModel:
    """A5 ``fails`` (with the term that is not polynomial in v) or is ``unknown``."""

    verdict: str
    reason: str
    evidence: Mapping[str, str] = field(default_factory=dict)


def internal_model(
    agent: Agent, exosystem: Exosystem, steady_state: SteadyState, s_star: sympy.Expr
) -> InternalModel | NoInternalModel:
    """The internal model of the least order that generates ``u*(s*, v, w)`` for every w; (M, N) the user's or defaults.

    ``s_star`` is the exact consensus value, or the symbol ``s``: then the relation holds for every s.
    With ``u* = Σ_j c_j(w) q_j(v)``, the c_j linearly independent, the relation for every w is the least common multiple
    of the minimal polynomials of ``L_S`` at the q_j. Raises ``InputError`` for a pair (M, N) that does not fit.
    """
    agent = without_point_parameters(agent)
    u_star = steady_state.u_star.xreplace({COST_VARIABLE: s_star})
    parts = polynomial_parts(u_star, exosystem)
    if isinstance(parts, NotPolynomial):
        settled = parts.proved and COST_VARIABLE not in u_star.free_symbols
        reason = f"u* is not {'' if settled else 'shown to be '}a polynomial in v: {parts.reason}"
        return NoInternalModel("fails" if settled else "unknown", reason, {"term": parts.term, "u*": excerpt(u_star)})
    velocity = velocity_of(exosystem.S, parts.ring, list(parts.ring.gens[: len(exosystem.states)]), parts.domain)
    try:
        relation = least_annihilator(parts.polynomials, velocity, parts.domain, MAX_ORDER)
    except OrderExceeded:
        reason = f"u* satisfies no relation of order {MAX_ORDER} or less"
        return NoInternalModel("unknown", reason, {"u*": excerpt(u_star)})
    order = int(relation.degree())
    pair = internal_model_pair(agent, order)
    if order == 0:
        return InternalModel(0, least=True)
    domain = parts.domain
    ell = [-c for c in relation.rep.to_list()[:0:-1]]
    M = DomainMatrix([[domain.from_sympy(as_expression(e)) for e in row] for row in pair.M], (order, order), domain)
    N = DomainMatrix([[domain.from_sympy(as_expression(e))] for e in pair.N], (order, 1), domain)
    T = _sylvester(M, N, ell, domain)
    gamma = DomainMatrix([[domain.one]] + [[domain.zero]] * (order - 1), (order, 1), domain)
    psi = T.transpose().lu_solve(gamma)

    def numbers(row: list[Any]) -> Row:
        return tuple(as_number(domain.to_sympy(entry)) for entry in row)

    return InternalModel(
        order,
        numbers(ell),
        _companion(numbers(ell)),
        (Fraction(1),) + (Fraction(0),) * (order - 1),
        pair.M,
        pair.N,
        tuple(numbers(row) for row in T.to_list()),
        numbers(psi.transpose().to_list()[0]),
        parts.independent,
        _spectrum(relation),
    )


def _sylvester(M: DomainMatrix, N: DomainMatrix, ell: list[Any], domain: Any) -> DomainMatrix:
    """T of ``T Φ − M T = N Γ`` by columns: ``t_s = −P(M)⁻¹ N`` and ``t_(k−1) = M t_k − ℓ_k t_s``.

    P is the characteristic polynomial of Φ; P(M) is nonsingular because M is Hurwitz and the roots of P are imaginary.
    """
    order = len(ell)
    identity = DomainMatrix.eye(order, domain)
    value = identity
    for coefficient in reversed(ell):
        value = value * M - identity * coefficient
    columns = [value.lu_solve(-N)]
    for coefficient in ell[:0:-1]:
        columns.append(M * columns[-1] - columns[0] * coefficient)
    columns.reverse()
    return columns[0].hstack(*columns[1:])


def _companion(ell: Row) -> tuple[Row, ...]:
    order = len(ell)
    rows = [tuple(Fraction(int(column == row + 1)) for column in range(order)) for row in range(order - 1)]
    return (*rows, ell)


def _spectrum(relation: sympy.Poly) -> str:
    """Distinct roots with zero real part: ``P = λ^a q(λ²)``, a ≤ 1, q square-free with negative roots only (Sturm)."""
    if not relation.is_sqf:
        return "fails"
    coefficients = relation.rep.to_list()[::-1]
    parity = 1 if not coefficients[0] else 0
    if any(coefficients[1 - parity :: 2]):
        return "fails"
    q = sympy.Poly.from_list(coefficients[parity::2][::-1], LAMBDA, domain=relation.domain)
    if q.degree() == 0:
        return "holds"
    if not all(c.is_Rational for c in q.all_coeffs()):
        return "unknown"
    return "holds" if q.set_domain(sympy.QQ).count_roots(None, 0) == q.degree() else "fails"
