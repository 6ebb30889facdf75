"""Steady states by matching coefficients, degree by degree (theory.md section 2, A3).

With ``f0 = num/den`` the regulator equation is ``den · L_S z = num``. Its part of degree k in the variables X reads
``(den_0 L_S − A) z_k = (terms of the lower z's)``, ``A = ∂num/∂z(0, 0)``: a linear system for the coefficients of z_k.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from math import comb

import sympy
from sympy.polys.matrices import DomainMatrix
from sympy.polys.matrices.exceptions import DMNonInvertibleMatrixError
from sympy.polys.polyerrors import PolynomialError
from sympy.polys.rings import PolyElement, PolyRing

from symbolic.annihilator import lie_derivative, velocity_of
from symbolic.exact_field import Element, ExactField, field_of
from symbolic.identity import sample_points

MAX_DEGREE = 8
MAX_UNKNOWNS = 200
MAX_MONOMIALS = 20_000


@dataclass(frozen=True)
class Solved:
    """``z*`` as sums of ``coefficient · monomial``; ``unique``: every linear system that was solved was nonsingular."""

    z_star: tuple[sympy.Expr, ...]
    coefficients: tuple[sympy.Expr, ...]
    unique: bool


@dataclass(frozen=True)
class Inconsistent:
    """The coefficient of ``monomial`` in the equation of component ``component`` (from 0) cannot be matched.

    ``proved``: then no steady state that is ``degree`` times differentiable exists (all lower parts are determined, and
    the arithmetic is exact).
    """

    component: int
    monomial: sympy.Expr
    degree: int
    proved: bool


@dataclass(frozen=True)
class NotFound:
    """The method does not apply or was stopped; ``unique``: until then every linear system was nonsingular."""

    reason: str
    unique: bool = False


Outcome = Solved | Inconsistent | NotFound


@dataclass(frozen=True)
class RegulatorProblem:
    """``∂z/∂v · S v = f0(z, s, v, w)`` for the components ``z``; X = v or (s, v), the rest are coefficients.

    ``linear``: f0 is affine in z and X = v; then the degrees do not couple and the method decides.
    """

    z: tuple[sympy.Symbol, ...]
    f0: tuple[sympy.Expr, ...]
    variables: tuple[sympy.Symbol, ...]
    v: tuple[sympy.Symbol, ...]
    S: sympy.Matrix
    linear: bool

    def at(self, point: Mapping[sympy.Symbol, sympy.Expr]) -> RegulatorProblem:
        """The problem for fixed parameters."""
        return RegulatorProblem(
            self.z, tuple(f.xreplace(dict(point)) for f in self.f0), self.variables, self.v, self.S, self.linear
        )

    def solve(self) -> Outcome:
        """Solves degree by degree; stops at degree ``MAX_DEGREE`` or ``MAX_UNKNOWNS`` unknowns.

        If the degrees couple, the parameters are first set to some numbers: where every system is nonsingular, what
        does not end there does not end for general parameters either, and costs much less.
        """
        if not self.linear and self.coefficient_symbols:
            trial = self.at(next(sample_points(self.coefficient_symbols, {}))).solve()
            if isinstance(trial, NotFound) and trial.unique:
                return trial
        return self._matched()

    @property
    def coefficient_symbols(self) -> list[sympy.Symbol]:
        """The parameters, and s where it is not expanded in."""
        found = {name for f in self.f0 for name in f.free_symbols}
        return sorted(found - {*self.z, *self.variables}, key=str)

    def _matched(self) -> Outcome:
        try:
            polynomials = [self._numerator_denominator(f) for f in self.f0]
        except PolynomialError:
            names = ", ".join(str(name) for name in (*self.z, *self.variables))
            return NotFound(f"f0 is not a rational function of {names}")
        entries = list(self.S)
        exact = field_of([c for pair in polynomials for poly in pair for c in poly.coeffs()] + entries)
        ring = PolyRing((*self.z, *self.variables), exact.domain)
        numerators, denominators = (
            [
                ring.from_dict({m: exact.element(c) for m, c in pair[which].terms() if exact.element(c)})
                for pair in polynomials
            ]
            for which in (0, 1)
        )
        affine = all(d.is_ground for d in denominators) and all(_is_affine(n, len(self.z)) for n in numerators)
        if self.linear and not affine:
            return NotFound("f0 is not affine in z with a matrix independent of v")
        return _Matching(self, exact, ring, numerators, denominators).run()

    def _numerator_denominator(self, f: sympy.Expr) -> tuple[sympy.Poly, sympy.Poly]:
        generators = (*self.z, *self.variables)
        numerator, denominator = sympy.fraction(sympy.together(f))
        return sympy.Poly(numerator, *generators), sympy.Poly(denominator, *generators)


class _Matching:
    """The state of one run: the parts of z found so far, as polynomials of the ring in (z, X)."""

    def __init__(
        self,
        problem: RegulatorProblem,
        exact: ExactField,
        ring: PolyRing,
        numerators: list[PolyElement],
        denominators: list[PolyElement],
    ) -> None:
        self.problem, self.exact, self.ring, self.domain = problem, exact, ring, exact.domain
        self.numerators, self.denominators = numerators, denominators
        count = len(problem.z)
        self.z = [ring.zero] * count
        v = [ring.gens[count + problem.variables.index(name)] for name in problem.v]
        velocities = dict(zip(problem.v, velocity_of(problem.S, ring, v, self.domain), strict=True))
        self.velocity = [ring.zero] * count + [velocities.get(name, ring.zero) for name in problem.variables]
        constant = (0,) * len(ring.gens)
        self.den0 = [d.get(constant, self.domain.zero) for d in denominators]
        self.A = [
            [n.get(tuple(int(k == c) for k in range(len(ring.gens))), self.domain.zero) for c in range(count)]
            for n in numerators
        ]

    def run(self) -> Outcome:
        linear = self.problem.linear
        last = max(self._degree(n) for n in self.numerators) if linear else MAX_DEGREE
        if not all(self.den0):
            return NotFound("a denominator of f0 vanishes at the origin")
        unique = True
        for degree in range(0 if linear else 1, last + 1):
            if not self._affordable():
                return NotFound(f"the terms up to degree {degree - 1} are too many to go on", unique)
            residual = self._residual()
            if not any(residual):
                break
            if self._count(degree) * len(self.z) > MAX_UNKNOWNS:
                return NotFound(f"more than {MAX_UNKNOWNS} unknown coefficients at degree {degree}", unique)
            right = [self._part(r, degree) for r in residual]
            if linear and not any(right):
                continue
            outcome = self._solve_degree(degree, right)
            if isinstance(outcome, Inconsistent):
                return replace(outcome, proved=(linear or unique) and not self.exact.kernels)
            unique &= outcome
        if not self._affordable() or any(self._residual()):
            return NotFound(f"no polynomial of degree {last} or less", unique)
        return self._solved(unique)

    def _residual(self) -> list[PolyElement]:
        """``num(z, X) − den(z, X) L_S z``."""
        values = list(zip(self.ring.gens, self.z, strict=False))
        return [
            n.compose(values) - d.compose(values) * lie_derivative(z, self.velocity)
            for n, d, z in zip(self.numerators, self.denominators, self.z, strict=True)
        ]

    def _affordable(self) -> bool:
        """A bound on the number of monomials of the residual."""
        count = len(self.z)
        found = max((sum(m) for z in self.z for m in z), default=0)
        size = max(sum(m[:count]) * found + sum(m[count:]) for p in (*self.numerators, *self.denominators) for m in p)
        return comb(size + found + len(self.problem.variables), len(self.problem.variables)) <= MAX_MONOMIALS

    def _degree(self, polynomial: PolyElement) -> int:
        return max((sum(m[len(self.z) :]) for m in polynomial), default=0)

    def _part(self, polynomial: PolyElement, degree: int) -> dict[tuple[int, ...], Element]:
        return {m: c for m, c in polynomial.items() if sum(m) == degree}

    def _count(self, degree: int) -> int:
        count = len(self.problem.variables)
        return comb(degree + count - 1, degree) if count else int(degree == 0)

    def _monomials(self, degree: int) -> Iterator[tuple[int, ...]]:
        first, count = len(self.z), len(self.ring.gens)
        for places in combinations_with_replacement(range(first, count), degree):
            yield tuple(places.count(k) for k in range(count))

    def _solve_degree(self, degree: int, right: list[dict[tuple[int, ...], Element]]) -> bool | Inconsistent:
        """Adds the part of this degree to z; returns whether it is determined."""
        monomials = list(self._monomials(degree))
        rows = [(j, m) for j in range(len(self.z)) for m in monomials]
        place = {row: k for k, row in enumerate(rows)}
        matrix = [[self.domain.zero] * len(rows) for _ in rows]
        for (component, monomial), column in place.items():
            term = self.ring.term_new(monomial, self.domain.one)
            for image, coefficient in lie_derivative(term, self.velocity).items():
                matrix[place[component, image]][column] += self.den0[component] * coefficient
            for j, row in enumerate(self.A):
                matrix[place[j, monomial]][column] -= row[component]
        left = DomainMatrix(matrix, (len(rows), len(rows)), self.domain)
        values = DomainMatrix([[right[j].get(m, self.domain.zero)] for j, m in rows], (len(rows), 1), self.domain)
        try:
            solution, determined = [row[0] for row in left.lu_solve(values).to_list()], True
        except DMNonInvertibleMatrixError:
            found = _particular(left, values)
            if found is None:
                component, monomial = rows[_unmatched(left, values)]
                return Inconsistent(component, self._monomial(monomial), degree, False)
            solution, determined = found, False
        for (component, monomial), value in zip(rows, solution, strict=True):
            self.z[component] += self.ring.term_new(monomial, value)
        return determined

    def _monomial(self, exponents: tuple[int, ...]) -> sympy.Expr:
        return sympy.Mul(*(name**power for name, power in zip(self.ring.symbols, exponents, strict=True)))

    def _solved(self, unique: bool) -> Solved:
        terms = [[(self.exact.expression(c), self._monomial(m)) for m, c in z.terms()] for z in self.z]
        return Solved(
            tuple(sympy.Add(*(c * m for c, m in part)) for part in terms),
            tuple(c for part in terms for c, _ in part),
            unique,
        )


def _is_affine(polynomial: PolyElement, count: int) -> bool:
    """Affine in the first ``count`` generators, with coefficients free of the others."""
    return all(sum(m[:count]) == 0 or (sum(m[:count]) == 1 and not any(m[count:])) for m in polynomial)


def _particular(left: DomainMatrix, right: DomainMatrix) -> list[Element] | None:
    """One solution of a singular system (free unknowns 0), or ``None`` if it has none."""
    reduced, pivots = left.hstack(right).rref()
    size = left.shape[1]
    if size in pivots:
        return None
    entries = reduced.to_list()
    solution = [left.domain.zero] * size
    for row, pivot in enumerate(pivots):
        solution[pivot] = entries[row][size]
    return solution


def _unmatched(left: DomainMatrix, right: DomainMatrix) -> int:
    """An equation with a nonzero right-hand side in a combination that reads ``0 = nonzero``."""
    values = [row[0] for row in right.to_list()]
    for combination in left.transpose().nullspace().to_list():
        if sum((y * b for y, b in zip(combination, values, strict=True)), left.domain.zero):
            return next(k for k, (y, b) in enumerate(zip(combination, values, strict=True)) if y and b)
    raise ArithmeticError("the system is consistent")
