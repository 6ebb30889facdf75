"""A4: the eigenvalues of ``S`` are semisimple with zero real part (paper, Assumption 4), decided without eigenvalues.

With ``p`` the square-free part of the characteristic polynomial, all eigenvalues are semisimple iff ``p(S) = 0``.
A real ``p`` has all its roots on the imaginary axis iff ``p(λ) = λ^k q(λ²)`` with ``k ∈ {0, 1}`` and every root of
``q`` real and negative, which Sturm's chain of ``q`` counts exactly.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Any

import flint
import sympy
from sympy.polys.constructor import construct_domain
from sympy.polys.matrices import DomainMatrix

from certify.assumptions.findings import Finding, Json
from symbolic.constants import PRECISION, enclose
from symbolic.plant import Exosystem

EIGENVALUE = sympy.Symbol("lambda")
LASTING = (
    "S may hold constants and undamped oscillations only: what grows is not bounded, what decays is not in the theory"
)
RAMP = (
    "a ramp or a growing oscillation is not bounded; a constant with an interval as its initial value may stand for it"
)
_PRECISIONS = (64, 256, 1024, 4096)


class Undecided(ArithmeticError):
    """A nonzero algebraic number whose sign the working precision does not show."""


def check_exosystem(exosystem: Exosystem) -> Finding:
    """Decide A4. Evidence: minimal polynomial and frequencies, or the eigenvalue that violates it."""
    size = len(exosystem.states)
    if size == 0:
        return Finding("A4", None, "holds", "there is no exosystem")
    entries = [sympy.sympify(entry) for entry in exosystem.S]
    field, elements = construct_domain(entries, field=True, extension=True)
    if not (field.is_QQ or field.is_Algebraic):
        return _without_field(exosystem.S)
    matrix = DomainMatrix([elements[k * size : (k + 1) * size] for k in range(size)], (size, size), field)
    characteristic = sympy.Poly.from_list(matrix.charpoly(), EIGENVALUE, domain=field)
    radical = characteristic.sqf_part().monic()
    try:
        off_axis = _off_axis_reason(radical)
    except Undecided as undecided:
        return Finding(
            "A4", None, "unknown", str(undecided), {"characteristic_polynomial": str(characteristic.as_expr())}
        )
    if off_axis is not None:
        return Finding("A4", None, "fails", f"{off_axis}; {LASTING}", _off_axis_witness(characteristic))
    if not _annihilates(radical, matrix):
        return _defective(characteristic, matrix)
    return Finding(
        "A4",
        None,
        "holds",
        "the minimal polynomial is square-free and all its roots are imaginary",
        {"minimal_polynomial": str(radical.as_expr()), "frequencies": _frequencies(radical)},
    )


def _without_field(S: sympy.ImmutableMatrix) -> Finding:
    """Entries that are not algebraic: a skew-symmetric ``S`` is normal with imaginary eigenvalues all the same."""
    if all(sympy.expand(entry) == 0 for entry in S + S.T):
        return Finding("A4", None, "holds", "S is skew-symmetric", {"S": str(S.tolist())})
    return Finding(
        "A4",
        None,
        "unknown",
        "S has entries that are not algebraic numbers and is not skew-symmetric",
        {"S": str(S.tolist()), "tried": "minimal polynomial over an algebraic number field"},
    )


def _even_part(p: sympy.Poly) -> tuple[int, sympy.Poly] | None:
    """``(k, q)`` with ``p(λ) = λ^k q(λ²)``, ``k ∈ {0, 1}``; None when ``p`` mixes even and odd powers."""
    parities = {power % 2 for (power,) in p.monoms()}
    if len(parities) > 1:
        return None
    (k,) = parities
    coefficients = p.rep.to_list()
    return k, sympy.Poly.from_list(coefficients[::2], EIGENVALUE, domain=p.domain)


def _off_axis_reason(p: sympy.Poly) -> str | None:
    """Why not all roots of the square-free ``p`` are imaginary; None when they are."""
    structure = _even_part(p)
    if structure is None:
        return f"the polynomial {p.as_expr()} of the eigenvalues mixes even and odd powers: one of them has a real part"
    _, q = structure
    real_negative = _count_negative_roots(q)
    if real_negative < q.degree():
        return (
            f"of the {q.degree()} distinct squares of nonzero eigenvalues only {real_negative} are real and negative: "
            "an eigenvalue has a real part"
        )
    return None


def _count_negative_roots(q: sympy.Poly) -> int:
    """Number of distinct roots of ``q`` in (−∞, 0), ``q(0) ≠ 0``, by Sturm's theorem."""
    if q.degree() == 0:
        return 0
    chain = q.sturm()
    at_zero = [_sign(term.eval(0), q.domain) for term in chain]
    at_minus_infinity = [_sign(term.LC(), q.domain) * (-1) ** term.degree() for term in chain]
    return _variations(at_minus_infinity) - _variations(at_zero)


def _variations(signs: list[int]) -> int:
    kept = [sign for sign in signs if sign]
    return sum(left != right for left, right in pairwise(kept))


def _sign(value: sympy.Expr, domain: Any) -> int:
    """Exact sign of an element of a real number field: zero is decided algebraically, the rest by balls."""
    element = domain.from_sympy(value)
    if element == domain.zero:
        return 0
    if domain.is_QQ:
        return 1 if element > 0 else -1
    return _sign_of_nonzero(element, domain)


def _sign_of_nonzero(element: Any, domain: Any) -> int:
    generator = enclose(domain.ext.as_expr())
    with flint.ctx.workprec(PRECISION):
        ball = flint.arb(0)
        for coefficient in element.to_list():
            ball = ball * generator + flint.arb(flint.fmpq(int(coefficient.numerator), int(coefficient.denominator)))
    if ball > 0:
        return 1
    if ball < 0:
        return -1
    raise Undecided(f"the sign of {domain.to_sympy(element)} is not decided with {PRECISION} bits")


def _annihilates(p: sympy.Poly, matrix: DomainMatrix) -> bool:
    return _value_at(p, matrix).is_zero_matrix


def _value_at(p: sympy.Poly, matrix: DomainMatrix) -> DomainMatrix:
    size = matrix.shape[0]
    value = DomainMatrix.zeros(matrix.shape, matrix.domain)
    identity = DomainMatrix.eye(size, matrix.domain)
    for coefficient in p.rep.to_list():
        value = value * matrix + coefficient * identity
    return value


def _defective(characteristic: sympy.Poly, matrix: DomainMatrix) -> Finding:
    """The factor whose eigenvalues have fewer eigenvectors than their multiplicity."""
    for factor, multiplicity in characteristic.factor_list()[1]:
        nullity = matrix.shape[0] - _value_at(factor, matrix).rank()
        if nullity < multiplicity * factor.degree():
            eigenvectors = nullity // factor.degree()
            evidence: dict[str, Json] = {
                "factor": str(factor.as_expr()),
                "algebraic_multiplicity": multiplicity,
                "geometric_multiplicity": eigenvectors,
            }
            reason = (
                f"Jordan block: each root of {factor.as_expr()} is an eigenvalue of multiplicity {multiplicity} "
                f"with only {eigenvectors} independent eigenvector{'s' if eigenvectors > 1 else ''}; {RAMP}"
            )
            return Finding("A4", None, "fails", reason, evidence)
    raise ArithmeticError(
        "a matrix that its square-free characteristic polynomial does not annihilate has a Jordan block"
    )


def _off_axis_witness(characteristic: sympy.Poly) -> dict[str, Json]:
    """The characteristic polynomial and, over the rationals, proved enclosures of the eigenvalues off the axis."""
    evidence: dict[str, Json] = {"characteristic_polynomial": str(characteristic.as_expr())}
    if not characteristic.domain.is_QQ:
        return evidence
    integral = characteristic.sqf_part().clear_denoms(convert=True)[1]
    polynomial = flint.fmpz_poly([int(c) for c in reversed(integral.all_coeffs())])
    for precision in _PRECISIONS:
        with flint.ctx.workprec(precision):
            found = [root for root, _ in polynomial.complex_roots() if not root.real.contains(0)]
            if found:
                evidence["eigenvalues"] = [
                    {"real_part": found_root.real.str(10), "imaginary_part": found_root.imag.str(10)}
                    for found_root in found
                ]
                return evidence
    return evidence


def _frequencies(p: sympy.Poly) -> list[str]:
    """The ``ω ≥ 0`` with ``p(jω) = 0``: exact where ``ω²`` is in the field, else an enclosure ``[lo, hi]``."""
    structure = _even_part(p)
    if structure is None:
        raise ValueError("only a polynomial with imaginary roots has frequencies")
    k, q = structure
    found = ["0"] if k else []
    for factor, _ in q.factor_list()[1] if q.degree() else []:
        if factor.degree() == 1:
            found.append(str(sympy.sqrt(factor.eval(0) / factor.LC())))
        elif factor.domain.is_QQ or factor.domain.is_ZZ:
            found.extend(_isolated_frequencies(factor))
        else:
            found.append(f"square roots of the roots of {factor.as_expr().subs(EIGENVALUE, -EIGENVALUE)}")
    return found


def _isolated_frequencies(factor: sympy.Poly) -> list[str]:
    """Enclosures of ``√(−y)`` for the (real, negative) roots ``y`` of an irreducible factor."""
    texts = []
    for (low, high), _ in factor.intervals(eps=sympy.Rational(1, 10**12)):
        ends = sorted(Fraction(int(-y.p), int(y.q)) for y in (low, high))
        with flint.ctx.workprec(128):
            roots = [flint.arb(flint.fmpq(y.numerator, y.denominator)).sqrt() for y in ends]
            texts.append(roots[0].union(roots[1]).str(10))
    return texts
