"""Where an expression may fail to be smooth: the conditions on its parts under which it is analytic."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import sympy

from symbolic.constants import enclose
from symbolic.identity import sample_points, value_at
from symbolic.plant import Interval
from symbolic.ranges import nonvanishing

Need = Literal["positive", "nonzero"]


@dataclass(frozen=True)
class Guard:
    """``expression`` must be ``need`` for ``owner`` (the part of the formula that it guards) to be analytic."""

    expression: sympy.Expr
    need: Need
    owner: str


def guards(expression: sympy.Expr) -> Iterator[Guard]:
    """The guards of all parts, innermost first; an expression without guards is analytic for all real symbols."""
    seen: set[Guard] = set()
    for node in sympy.postorder_traversal(expression):
        guard = _guard(node)
        if guard is not None and guard.expression.free_symbols and guard not in seen:
            seen.add(guard)
            yield guard


def _guard(node: sympy.Basic) -> Guard | None:
    if isinstance(node, sympy.Pow):
        base, exponent = node.args
        if isinstance(exponent, sympy.Integer):
            return Guard(base, "nonzero", f"the denominator {base}") if exponent < 0 else None
        if base == sympy.E:
            return None
        return Guard(base, "positive", f"the power {node} with base {base}")
    if isinstance(node, sympy.log):
        return Guard(node.args[0], "positive", f"the logarithm of {node.args[0]}")
    if isinstance(node, sympy.tan):
        return Guard(sympy.cos(node.args[0]), "nonzero", f"the tangent of {node.args[0]}")
    if isinstance(node, sympy.Abs | sympy.sign):
        return Guard(node.args[0], "nonzero", f"the absolute value of {node.args[0]}")
    return None


def evidently_positive(node: sympy.Expr) -> bool:
    """Whether the form of the expression alone shows that it is positive for all real symbols."""
    if not node.free_symbols:
        return bool(enclose(node) > 0)
    if isinstance(node, sympy.exp | sympy.cosh):
        return True
    if isinstance(node, sympy.Add):
        return all(map(evidently_nonnegative, node.args)) and any(map(evidently_positive, node.args))
    if isinstance(node, sympy.Mul):
        return all(map(evidently_positive, node.args))
    if isinstance(node, sympy.Pow):
        return evidently_positive(node.base)
    return False


def evidently_nonnegative(node: sympy.Expr) -> bool:
    """Whether the form of the expression alone shows that it is nonnegative wherever it is defined."""
    if node == 0 or isinstance(node, sympy.Abs) or evidently_positive(node):
        return True
    if isinstance(node, sympy.Add | sympy.Mul):
        return all(map(evidently_nonnegative, node.args))
    if isinstance(node, sympy.Pow):
        even = isinstance(node.exp, sympy.Integer) and node.exp % 2 == 0
        return bool(even) or evidently_nonnegative(node.base)
    if isinstance(node, sympy.tanh | sympy.sinh | sympy.atan):
        return evidently_nonnegative(node.args[0])
    return False


def unproved_guard(expression: sympy.Expr, box: Mapping[sympy.Symbol, Interval | None]) -> Guard | None:
    """The first guard that is not shown to hold on the box (an interval None is the whole line); None if all hold."""
    for guard in guards(expression):
        if evidently_positive(guard.expression):
            continue
        if nonvanishing(guard.expression, box).verdict != "holds":
            return guard
        if guard.need == "positive" and not _positive_somewhere(guard.expression, box):
            return guard
    return None


def _positive_somewhere(expression: sympy.Expr, box: Mapping[sympy.Symbol, Interval | None]) -> bool:
    """A proved positive value; with a proof that there is no zero it gives the sign on the whole (connected) box."""
    symbols = sorted(expression.free_symbols, key=str)
    return any(value_at(expression, point) > 0 for point in sample_points(symbols, box))
