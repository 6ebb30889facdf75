"""Bounds ``0 < ϖ ≤ c''(s) ≤ l`` of a cost's second derivative for all real ``s`` (theory.md section 2, A1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

import sympy
from flint import arb

from certify.bounds.balls import lower, upper
from certify.bounds.intervals import simplest_between
from certify.bounds.smoothness import evidently_positive
from certify.bounds.whole_line import LineBounds, line_bounds
from symbolic.constants import as_fraction, as_rational, enclose
from symbolic.guards import Guard, guards
from symbolic.identity import MAX_OPERATIONS, normal_form, value_at
from symbolic.plant import COST_VARIABLE
from symbolic.ranges import nonvanishing

SLACK = Fraction(1, 1000)
LOOSE = Fraction(1, 50)
_SAMPLES = tuple(sorted({Fraction(sign * p, q) for p in range(0, 17) for q in (1, 2, 5) for sign in (1, -1)}, key=abs))
_FAR_SAMPLES = tuple(Fraction(sign * 2**k) for k in range(5, 12) for sign in (1, -1))


@dataclass(frozen=True)
class Curvature:
    """``lower ≤ c''(s) ≤ upper`` for every real ``s``, ``lower > 0``; ``method`` says how that was proved."""

    lower: Fraction
    upper: Fraction
    method: str


@dataclass(frozen=True)
class CurvatureFailure:
    """No such bounds: ``fails`` when there are none, ``unknown`` when none were found."""

    verdict: str
    reason: str
    evidence: dict[str, Any] = field(default_factory=dict, hash=False)


@lru_cache(maxsize=1024)
def cost_curvature(cost: sympy.Expr) -> Curvature | CurvatureFailure:
    """Bounds ``ϖ`` and ``l`` of ``c''`` over all of R, exact for polynomials and within about 1 % else.

    ``cost`` is an expression in ``COST_VARIABLE`` made of the functions of plant files.
    """
    strange = cost.free_symbols - {COST_VARIABLE}
    if strange:
        return CurvatureFailure("unknown", f"the cost depends on {', '.join(sorted(map(str, strange)))} besides s")
    if cost.is_polynomial(COST_VARIABLE):
        return _polynomial_curvature(sympy.Poly(cost, COST_VARIABLE, extension=True))
    for guard in guards(cost):
        failure = domain_failure(guard)
        if failure is not None:
            return failure
    second = sympy.diff(cost, COST_VARIABLE, 2)
    return _decided(second, _second_bounds(second))


def _second_bounds(second: sympy.Expr) -> LineBounds:
    """Bounds of ``c''`` as it was differentiated and, where they are loose, in other forms in which less cancels."""
    bounds = line_bounds(second, COST_VARIABLE)
    hopeless = bounds.reached_low is not None and bounds.reached_low <= 0
    if hopeless or bounds.diverges or second.count_ops() > MAX_OPERATIONS:
        return bounds
    for form in (_roots_collected, normal_form):
        if _is_tight(bounds):
            break
        other = line_bounds(form(second), COST_VARIABLE)
        if _is_tight(other):
            return other
        lowers = [found.lower for found in (bounds, other) if found.lower is not None]
        uppers = [found.upper for found in (bounds, other) if found.upper is not None]
        bounds = replace(bounds, lower=max(lowers, default=None), upper=min(uppers, default=None))
    return bounds


def _roots_collected(expression: sympy.Expr) -> sympy.Expr:
    """Terms with the same roots ``u^(k/2)`` over a common power of them: ``1/√u − (s − 1)²/u^(3/2) = (u − (s − 1)²)/…``
    is ``ε/u^(3/2)`` for ``u = (s − 1)² + ε``."""
    groups: dict[frozenset[sympy.Expr], list[tuple[dict[sympy.Expr, sympy.Rational], sympy.Expr]]] = {}
    for term in sympy.Add.make_args(sympy.expand_mul(expression)):
        roots: dict[sympy.Expr, sympy.Rational] = {}
        rest = sympy.S.One
        for factor in sympy.Mul.make_args(term):
            base, exponent = factor.as_base_exp()
            if base.free_symbols and isinstance(exponent, sympy.Rational) and exponent.q == 2:
                roots[base] = roots.get(base, sympy.S.Zero) + exponent
            else:
                rest *= factor
        groups.setdefault(frozenset(roots), []).append((roots, rest))
    collected = sympy.S.Zero
    for bases, terms in groups.items():
        least = {base: min(roots[base] for roots, _ in terms) for base in bases}
        inner = sympy.Add(
            *(rest * sympy.Mul(*(base ** (roots[base] - least[base]) for base in bases)) for roots, rest in terms)
        )
        collected += sympy.Mul(*(base**exponent for base, exponent in least.items())) * sympy.expand(inner)
    return collected


def _is_tight(bounds: LineBounds) -> bool:
    low, high, reached_low, reached_high = bounds.lower, bounds.upper, bounds.reached_low, bounds.reached_high
    if low is None or high is None or reached_low is None or reached_high is None:
        return False
    return low >= reached_low * (1 - LOOSE) and high <= reached_high * (1 + LOOSE)


def _polynomial_curvature(cost: sympy.Poly) -> Curvature | CurvatureFailure:
    second = cost.diff((COST_VARIABLE, 2))
    text = str(second.as_expr())
    if second.degree() > 0:
        at_zero = second.eval(0)
        degenerate = f", and c''(0) = {at_zero}" if at_zero.is_nonpositive else ""
        reason = f"c'' = {text} is unbounded: the gradient is not globally Lipschitz{degenerate}"
        return CurvatureFailure("fails", reason, {"second_derivative": text})
    value = second.eval(0)
    bounds = (as_fraction(value),) * 2 if isinstance(value, sympy.Rational) else _ends(enclose(value))
    if bounds[0] > 0:
        return Curvature(*bounds, "c'' is constant")
    if value.is_zero:
        return CurvatureFailure("fails", "c'' = 0: the cost is not strongly convex", {"second_derivative": text})
    if bounds[1] < 0:
        return CurvatureFailure(
            "fails", f"c'' = {text} is negative: the cost is not convex", {"second_derivative": text}
        )
    return CurvatureFailure("unknown", f"the sign of c'' = {text} is not decided", {"second_derivative": text})


def _ends(ball: arb) -> tuple[Fraction, Fraction]:
    low, high = lower(ball), upper(ball)
    return _short_below(low), _short_above(high)


@lru_cache(maxsize=1024)
def domain_failure(guard: Guard) -> CurvatureFailure | None:
    """Why a part of the cost is not smooth on all of R; None when it is."""
    condition = guard.expression
    if evidently_positive(condition):
        return None
    answer = nonvanishing(condition, {COST_VARIABLE: None})
    if answer.verdict == "fails":
        return _undefined(
            guard, f"{answer.reason} at s = {' and s = '.join(point['s'] for point in answer.at)}", answer.at
        )
    signs = {_sign_at(condition, s) for s in _SAMPLES[:1]} if answer.verdict == "holds" else set()
    if 1 in signs or (signs and 0 not in signs and guard.need == "nonzero"):
        return None
    for s in (*_SAMPLES, *_FAR_SAMPLES):
        sign = _sign_at(condition, s)
        signs.add(sign)
        if sign < 0 and guard.need == "positive":
            return _undefined(guard, f"{condition} is negative at s = {s}", ({"s": str(s)},))
        if {1, -1} <= signs:
            return _undefined(guard, f"{condition} changes its sign before s = {s}", ({"s": str(s)},))
    bounds = line_bounds(condition, COST_VARIABLE)
    if (bounds.lower is not None and bounds.lower > 0) or (
        guard.need == "nonzero" and bounds.upper is not None and bounds.upper < 0
    ):
        return None
    return CurvatureFailure("unknown", f"{guard.owner}: {condition} is not proved to be {guard.need} for every s")


def _undefined(guard: Guard, where: str, at: Sequence[Mapping[str, str]]) -> CurvatureFailure:
    needs = f"{guard.demand}, but {where}"
    reason = f"the cost is not twice continuously differentiable on all of R: {needs}"
    return CurvatureFailure("fails", reason, {"at": [dict(point) for point in at]})


def _sign_at(expression: sympy.Expr, s: Fraction) -> int:
    """The proved sign at a rational point; 0 when it is not seen."""
    ball = value_at(expression, {COST_VARIABLE: as_rational(s)})
    return 1 if ball > 0 else -1 if ball < 0 else 0


def _decided(second: sympy.Expr, bounds: LineBounds) -> Curvature | CurvatureFailure:
    evidence: dict[str, Any] = {"second_derivative": str(second), "method": bounds.method}
    if bounds.lower is not None and bounds.upper is not None and bounds.lower > 0:
        return Curvature(_short_below(bounds.lower), _short_above(bounds.upper), bounds.method)
    witness = _not_positive_at(second, bounds.lowest_at)
    if witness is not None:
        evidence["at"] = [{"s": str(witness[0]), "second_derivative": str(witness[1])}]
        reason = f"c''({witness[0]}) = {witness[1]} is not positive: the cost is not strongly convex"
        return CurvatureFailure("fails", reason, evidence)
    if any(limit.hi <= 0 for limit in bounds.limits):
        return CurvatureFailure("fails", "c'' tends to 0 as |s| grows: the cost is not strongly convex", evidence)
    if bounds.diverges:
        direction = "∞" if 1 in bounds.diverges else "−∞"
        consequence = "the gradient is not globally Lipschitz" if 1 in bounds.diverges else "the cost is not convex"
        return CurvatureFailure("fails", f"c'' tends to {direction} as |s| grows: {consequence}", evidence)
    evidence["infimum_between"] = [_text(bounds.lower), _text(bounds.reached_low)]
    evidence["supremum_between"] = [_text(bounds.reached_high), _text(bounds.upper)]
    if bounds.reached_low is not None and bounds.reached_low <= 0:
        reason = "c'' takes a value that is not positive: the cost is not strongly convex"
        return CurvatureFailure("fails", reason, evidence)
    return CurvatureFailure("unknown", bounds.obstacle or "no positive lower bound of c'' was proved", evidence)


def _not_positive_at(second: sympy.Expr, lowest_at: Fraction | None) -> tuple[Fraction, sympy.Expr] | None:
    """A rational point where ``c'' ≤ 0``, exactly or by a ball."""
    for s in (*_SAMPLES, *_FAR_SAMPLES, *([] if lowest_at is None else [lowest_at])):
        value = second.xreplace({COST_VARIABLE: as_rational(s)})
        if value.is_zero or _sign_at(second, s) < 0:
            return s, value
    return None


def _short_below(value: Fraction) -> Fraction:
    return simplest_between(value - abs(value) * SLACK, value)


def _short_above(value: Fraction) -> Fraction:
    return simplest_between(value, value + abs(value) * SLACK)


def _text(value: Fraction | None) -> str:
    """A bound to eight digits: it says what was tried, nothing rests on it."""
    return "not bounded here" if value is None else str(sympy.Float(as_rational(value), 8))
