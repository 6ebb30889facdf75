"""Exact coefficient fields: rational functions of parameters over Q or an algebraic number field.

Anything that is not rational in the symbols (``sin(p1)``, ``log(2)``, ``sqrt(p1)``) becomes a *kernel*: a fresh symbol
treated as independent of everything else. Equality in the field therefore proves equality of the functions; inequality
proves nothing once there are kernels.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

import sympy
from sympy import QQ
from sympy.polys.constructor import construct_domain
from sympy.polys.rings import PolyElement, PolyRing

Number: TypeAlias = Fraction | Any  # a sympy number when it is irrational
Element = Any  # an element of a sympy domain
Pair = tuple[PolyElement, PolyElement]


@dataclass(frozen=True)
class ExactField:
    """A field that holds the given expressions; ``kernels`` are pairs (expression, the symbol that stands for it)."""

    domain: Any
    kernels: tuple[tuple[sympy.Expr, sympy.Symbol], ...]

    def element(self, expr: sympy.Expr) -> Element:
        rational = _with_kernels(expr, dict(self.kernels))
        if not self.domain.is_FractionField:
            return self.domain.from_sympy(rational)
        field = self.domain.field
        return field.new(*_fraction(rational, field.ring, dict(zip(field.symbols, field.ring.gens, strict=True))))

    def expression(self, element: Element) -> sympy.Expr:
        back = {stand_in: kernel for kernel, stand_in in self.kernels}
        return self.domain.to_sympy(element).xreplace(back)


def field_of(expressions: Iterable[sympy.Expr]) -> ExactField:
    """The smallest such field with all the given expressions."""
    kernels: dict[sympy.Expr, sympy.Symbol] = {}
    parts = [_with_kernels(expr, kernels) for expr in expressions]
    surds = {node for part in parts for node in sympy.preorder_traversal(part) if _is_surd(node)}
    base = construct_domain(sorted(surds, key=sympy.default_sort_key), extension=True, field=True)[0] if surds else QQ
    symbols = sorted({name for part in parts for name in part.free_symbols}, key=sympy.default_sort_key)
    return ExactField(base.frac_field(*symbols) if symbols else base, tuple(kernels.items()))


def as_number(expr: sympy.Expr) -> Number:
    """A ``Fraction`` when the number is rational, the expression otherwise."""
    return Fraction(int(expr.p), int(expr.q)) if isinstance(expr, sympy.Rational) else expr


def as_expression(number: Number) -> sympy.Expr:
    return sympy.Rational(number.numerator, number.denominator) if isinstance(number, Fraction) else number


def _fraction(expr: sympy.Expr, ring: PolyRing, generators: dict[sympy.Symbol, PolyElement]) -> Pair:
    """Numerator and denominator, not reduced: one reduction at the end is much cheaper than one after every step."""
    if expr in generators:
        return generators[expr], ring.one
    if isinstance(expr, sympy.Add):
        by_denominator: dict[PolyElement, PolyElement] = {}
        for term in expr.args:
            numerator, denominator = _fraction(term, ring, generators)
            by_denominator[denominator] = by_denominator.get(denominator, ring.zero) + numerator
        total, common = ring.zero, ring.one
        for denominator, numerator in by_denominator.items():
            least = common.lcm(denominator)
            total, common = total * least.exquo(common) + numerator * least.exquo(denominator), least
        return total, common
    if isinstance(expr, sympy.Mul):
        numerator, denominator = ring.one, ring.one
        for factor in expr.args:
            upper, lower = _fraction(factor, ring, generators)
            numerator, denominator = numerator * upper, denominator * lower
        return numerator, denominator
    if isinstance(expr, sympy.Pow) and expr.exp.is_Integer:
        numerator, denominator = _fraction(expr.base, ring, generators)
        power = abs(int(expr.exp))
        raised = numerator**power, denominator**power
        return raised if expr.exp > 0 else (raised[1], raised[0])
    return ring.ground_new(ring.domain.from_sympy(expr)), ring.one


def _is_surd(expr: sympy.Expr) -> bool:
    return (
        isinstance(expr, sympy.Pow)
        and isinstance(expr.base, sympy.Rational)
        and expr.exp.is_Rational
        and not expr.exp.is_Integer
        and bool(expr.is_real)
    )


def _with_kernels(expr: sympy.Expr, kernels: dict[sympy.Expr, sympy.Symbol]) -> sympy.Expr:
    """The expression with its kernels replaced; new ones are added to ``kernels``."""
    if isinstance(expr, sympy.Symbol | sympy.Rational) or _is_surd(expr):
        return expr
    if isinstance(expr, sympy.Add | sympy.Mul):
        return expr.func(*(_with_kernels(part, kernels) for part in expr.args))
    if isinstance(expr, sympy.Pow) and isinstance(expr.exp, sympy.Rational):
        root = expr.base if expr.exp.is_Integer else sympy.Pow(expr.base, sympy.Rational(1, expr.exp.q))
        inner = _with_kernels(root, kernels) if expr.exp.is_Integer else _kernel(root, kernels)
        return inner**expr.exp.p
    if isinstance(expr, sympy.exp):
        parts = [term.as_coeff_Mul() for term in sympy.Add.make_args(sympy.expand(expr.args[0]))]
        return sympy.Mul(
            *(
                _kernel(sympy.exp(rest / times.q), kernels) ** times.p
                if isinstance(times, sympy.Rational)
                else _kernel(sympy.exp(times * rest), kernels)
                for times, rest in parts
            )
        )
    return _kernel(expr, kernels)


def _kernel(expr: sympy.Expr, kernels: dict[sympy.Expr, sympy.Symbol]) -> sympy.Symbol:
    if expr not in kernels:
        kernels[expr] = sympy.Dummy(f"k{len(kernels)}", real=True)
    return kernels[expr]
