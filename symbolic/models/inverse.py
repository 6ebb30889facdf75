"""The inverse of a change of coordinates, where it is global: found one unknown after the other, and verified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy

from symbolic.guards import guards
from symbolic.identity import zero_test
from symbolic.interval import Interval
from symbolic.ranges import nonvanishing

Map = Mapping[sympy.Symbol, sympy.Expr]
Box = Mapping[sympy.Symbol, Interval]


def global_inverse(change: Map, old: Sequence[sympy.Symbol], box: Box) -> dict[sympy.Symbol, sympy.Expr] | None:
    """The old coordinates in the new ones, for a change ``new = change[new](old)`` with parameters in the box.

    An equation in which one unknown is left, times a factor that vanishes nowhere, gives that unknown; equations that
    are affine in all that are left are solved together. What is found is put back and must be the identity, and all
    maps must be smooth everywhere. ``None`` if this way leads nowhere, which does not mean that there is no inverse.
    """
    found: dict[sympy.Symbol, sympy.Expr] = {}
    pending = {new: tidy(expr) for new, expr in change.items()}
    while pending:
        step = _single(pending, old, found, box) or _jointly(pending, old, found, box)
        if step is None:
            return None
        used, values = step
        found |= values
        pending = {new: tidy(expr.xreplace(values)) for new, expr in pending.items() if new not in used}
    if any(name not in found for name in old):
        return None
    maps = (*change.values(), *found.values())
    back = all(zero_test(expr.xreplace(found) - new).verdict == "holds" for new, expr in change.items())
    return found if back and all(smooth_everywhere(expr, box) for expr in maps) else None


def smooth_everywhere(expr: sympy.Expr, box: Box) -> bool:
    """Whether an expression is analytic for all real values of what is not in the box."""
    return all(_holds(guard.expression, guard.need, box) for guard in guards(expr))


def tidy(expr: sympy.Expr) -> sympy.Expr:
    """The shorter of the expanded and the cancelled form; equal as functions where both are defined."""
    expanded = sympy.expand(expr)
    if not guards_of_denominators(expanded):
        return expanded
    cancelled = sympy.cancel(sympy.together(expr))
    return min((expr, expanded, cancelled), key=sympy.count_ops)


def guards_of_denominators(expr: sympy.Expr) -> bool:
    return any(isinstance(part, sympy.Pow) and part.exp.is_negative for part in sympy.preorder_traversal(expr))


def _holds(condition: sympy.Expr, need: str, box: Box) -> bool:
    wide = {name: box.get(name) for name in condition.free_symbols}
    if nonvanishing(condition, wide).verdict != "holds":
        return False
    middle = {name: _middle(box.get(name)) for name in condition.free_symbols}
    return need == "nonzero" or bool(condition.xreplace(middle) > 0)


def _middle(side: Interval | None) -> sympy.Rational:
    if side is None:
        return sympy.Integer(0)
    centre = (side.lo + side.hi) / 2
    return sympy.Rational(centre.numerator, centre.denominator)


def _single(
    pending: Map, old: Sequence[sympy.Symbol], found: Map, box: Box
) -> tuple[set[sympy.Symbol], dict[sympy.Symbol, sympy.Expr]] | None:
    """An equation that is affine in the one unknown that it holds."""
    for new, expr in pending.items():
        unknown = expr.free_symbols & (set(old) - set(found))
        if len(unknown) != 1:
            continue
        name = next(iter(unknown))
        factor = tidy(sympy.diff(expr, name))
        if name not in factor.free_symbols and _holds(factor, "nonzero", box):
            return {new}, {name: tidy((new - expr.xreplace({name: sympy.Integer(0)})) / factor)}
    return None


def _jointly(
    pending: Map, old: Sequence[sympy.Symbol], found: Map, box: Box
) -> tuple[set[sympy.Symbol], dict[sympy.Symbol, sympy.Expr]] | None:
    """All remaining equations, where they are affine in all remaining unknowns."""
    unknown = [name for name in old if name not in found]
    matrix = sympy.Matrix([[tidy(sympy.diff(expr, name)) for name in unknown] for expr in pending.values()])
    if matrix.rows != matrix.cols or matrix.free_symbols & set(unknown):
        return None
    determinant = tidy(matrix.det())
    if determinant == 0 or not _holds(determinant, "nonzero", box):
        return None
    origin = dict.fromkeys(unknown, sympy.Integer(0))
    right = sympy.Matrix([new - expr.xreplace(origin) for new, expr in pending.items()])
    values = (matrix.adjugate() * right).applyfunc(lambda entry: tidy(entry / determinant))
    return set(pending), dict(zip(unknown, values, strict=True))
