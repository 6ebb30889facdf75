"""Polynomials proved nonnegative: Gram matrices from a solver, rounded, projected and proved semidefinite over Q.

``p − Σ_k σ_k g_k = m(x)ᵀ G m(x)`` with every ``σ_k`` a sum of squares too shows ``p ≥ 0`` wherever all ``g_k ≥ 0``.
What the solver returns is a hint: identity and semidefiniteness are checked exactly, and what is not proved is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import sympy

from certify.bounds.gram import (
    Basis,
    Coefficients,
    Gram,
    Monomial,
    expansion,
    is_semidefinite,
    plus,
    projected,
    short_matrix,
    times,
)
from certify.inequalities.matrices import FloatMatrix, scale
from symbolic.constants import as_fraction, as_rational

MAX_BASIS = 120
_ROUNDING_BITS = (12, 20, 30, 40)


@dataclass(frozen=True)
class NonnegativityProof:
    """``p = main + Σ multipliers[k]·domain[k]``; ``multipliers`` follow the order of the domain."""

    main: Gram
    multipliers: tuple[Gram, ...]


@dataclass(frozen=True)
class NoProof:
    """Nothing was proved; the polynomial may or may not be nonnegative."""

    reason: str


def prove_nonnegative(
    p: sympy.Poly, domain: Sequence[sympy.Poly] = (), vanishing: Sequence[sympy.Symbol] = ()
) -> NonnegativityProof | NoProof:
    """Prove ``p(x) ≥ 0`` for all real ``x`` with every ``g(x) ≥ 0``, ``g`` in ``domain``.

    ``vanishing``: variables with which ``p`` vanishes to second order; then every square must vanish with them too, and
    leaving the other monomials out keeps the Gram matrices away from the boundary of the cone.
    ``p`` and ``domain`` have rational coefficients and the same generators. Raises ValueError otherwise.
    """
    if any(g.gens != p.gens for g in domain):
        raise ValueError("the polynomials must have the same generators")
    target, size = _scaled(coefficients(p))
    constraints, sizes = zip(*(_scaled(coefficients(g)) for g in domain), strict=True) if domain else ((), ())
    if not target:
        return NonnegativityProof(Gram((), ()), tuple(Gram((), ()) for _ in constraints))
    bases = _bases(target, constraints, p.gens, vanishing)
    if isinstance(bases, NoProof):
        return bases
    from certify.bounds.gram_search import search_gram  # cvxpy takes a second to import

    found = search_gram(target, constraints, bases)
    if isinstance(found, str):
        return NoProof(found)
    for bits in _ROUNDING_BITS:
        proof = _rounded(target, constraints, bases, found, bits)
        if proof is not None:
            multipliers = (_times(size / unit, gram) for unit, gram in zip(sizes, proof.multipliers, strict=True))
            return NonnegativityProof(_times(size, proof.main), tuple(multipliers))
    return NoProof(
        "no rounding of the solver's Gram matrix is positive semidefinite; it may be only semidefinite itself"
    )


def largest_multiple(
    p: sympy.Poly, q: sympy.Poly, domain: Sequence[sympy.Poly] = (), vanishing: Sequence[sympy.Symbol] = ()
) -> Fraction | None:
    """An estimate of the largest ``t`` with ``p − t q`` a sum of squares on the domain; None when none is seen."""
    target, size = _scaled(coefficients(p))
    subtracted, unit = _scaled(coefficients(q))
    constraints = [_scaled(coefficients(g))[0] for g in domain]
    bases = _bases({**target, **subtracted}, constraints, p.gens, vanishing)
    if isinstance(bases, NoProof):
        return None
    from certify.bounds.gram_search import search_multiple

    found = search_multiple(target, subtracted, constraints, bases)
    return None if found is None else Fraction(found) * size / unit


def _scaled(values: Coefficients) -> tuple[Coefficients, Fraction]:
    """The coefficients over the largest one, and that."""
    size = max(map(abs, values.values()), default=Fraction(1))
    return {m: c / size for m, c in values.items()}, size


def _times(factor: Fraction, gram: Gram) -> Gram:
    return Gram(gram.basis, scale(factor, gram.matrix))


def coefficients(p: sympy.Poly) -> Coefficients:
    """Exponents and rational coefficients. Raises ValueError for coefficients that are not rational."""
    if not (p.domain.is_ZZ or p.domain.is_QQ):
        raise ValueError(f"{p.as_expr()} has coefficients that are not rational numbers")
    return {tuple(m): as_fraction(sympy.Rational(c)) for m, c in p.terms() if c != 0}


def polynomial(gram: Gram, gens: Sequence[sympy.Symbol]) -> sympy.Poly:
    """``m(x)ᵀ G m(x)`` as a polynomial."""
    return sympy.Poly({m: as_rational(c) for m, c in expansion(gram).items()} or 0, *gens, domain="QQ")


def _bases(
    target: Coefficients,
    constraints: Sequence[Coefficients],
    gens: Sequence[sympy.Symbol],
    vanishing: Sequence[sympy.Symbol],
) -> tuple[Basis, ...] | NoProof:
    """A monomial basis for the main Gram matrix, then one for each multiplier."""
    places = [k for k, name in enumerate(gens) if name in vanishing]

    def allowed(basis: Basis) -> Basis:
        return tuple(m for m in basis if not places or any(m[k] for k in places))

    reach = max(sum(m) for polynomial in (target, *constraints) for m in polynomial)
    reach += reach % 2
    multipliers = []
    support = set(target)
    for g in constraints:
        rest = (reach - max(sum(m) for m in g)) // 2
        basis = allowed(_monomials([rest] * len(gens), 0, rest))
        multipliers.append(basis)
        support |= {plus(plus(a, b), m) for a in basis for b in basis for m in g}
    top = [(max(m[k] for m in support) + 1) // 2 for k in range(len(gens))]
    lowest = (min(sum(m) for m in support) + 1) // 2
    main = _consistent(allowed(_monomials(top, lowest, (max(sum(m) for m in support) + 1) // 2)), support)
    if max(map(len, (main, *multipliers))) > MAX_BASIS:
        return NoProof(f"more than {MAX_BASIS} monomials are needed")
    return (main, *multipliers)


def _monomials(top: Sequence[int], lowest: int, highest: int) -> Basis:
    exponents = product(*(range(min(bound, highest) + 1) for bound in top))
    return tuple(sorted((m for m in exponents if lowest <= sum(m) <= highest), key=lambda m: (sum(m), m)))


def _consistent(basis: Basis, support: set[Monomial]) -> Basis:
    """Drop every monomial whose square can neither occur nor cancel: its diagonal entry, hence its row, must vanish."""
    while True:
        cross = {plus(a, b) for i, a in enumerate(basis) for b in basis[i + 1 :]}
        kept = tuple(m for m in basis if plus(m, m) in support or plus(m, m) in cross)
        if kept == basis:
            return basis
        basis = kept


def _rounded(
    target: Coefficients,
    constraints: Sequence[Coefficients],
    bases: Sequence[Basis],
    found: Sequence[FloatMatrix],
    bits: int,
) -> NonnegativityProof | None:
    """Round all Gram matrices, let the main one absorb the residual of the identity, prove each semidefinite."""
    multipliers = []
    rest = dict(target)
    for g, basis, values in zip(constraints, bases[1:], found[1:], strict=True):
        gram = Gram(basis, short_matrix(values, bits))
        multipliers.append(gram)
        for m, c in times(expansion(gram), g).items():
            rest[m] = rest.get(m, Fraction(0)) - c
    main = projected(Gram(bases[0], short_matrix(found[0], bits)), rest)
    if main is None or not all(is_semidefinite(gram) for gram in (main, *multipliers)):
        return None
    return NonnegativityProof(main, tuple(multipliers))
