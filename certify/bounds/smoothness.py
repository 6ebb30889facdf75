"""Whether the guards of an expression hold on a box, so that it is smooth there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import sympy

from certify.bounds.conversions import NonFiniteError
from certify.bounds.suprema import lower_bound, upper_bound
from symbolic.constants import enclose
from symbolic.guards import Guard, guards
from symbolic.identity import printed, sample_points, value_at
from symbolic.plant import Interval
from symbolic.ranges import grid, nonvanishing

HALVINGS = 10  # a witness a thousandth of the box wide says where to look; one more digit says no more


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


def unproved_guard(
    expression: sympy.Expr, box: Mapping[sympy.Symbol, Interval | None], written: Sequence[Guard] = ()
) -> Guard | None:
    """The first guard that is not shown to hold on the box (an interval None is the whole line); None if all hold.

    ``written`` are the guards of the expression's text, beside those of what SymPy has made of it.
    """
    for guard in dict.fromkeys((*written, *guards(expression))):
        if evidently_positive(guard.expression):
            continue
        if nonvanishing(guard.expression, box).verdict != "holds":
            return guard
        if guard.need == "positive" and not _positive_somewhere(guard.expression, box):
            return guard
    return None


@dataclass(frozen=True)
class Break:
    """A guard that does not hold on a box: ``fails`` with the points that show it, or ``unknown``."""

    verdict: Literal["fails", "unknown"]
    reason: str
    at: tuple[Mapping[str, str], ...] = ()


def first_break(guards_in_order: Iterable[Guard], box: Mapping[sympy.Symbol, Interval]) -> Break | None:
    """The first guard that does not hold on a bounded box, or is not shown to; None if all hold.

    The guards come innermost first, so that what one of them guards is continuous once those before it hold, and a
    change of sign is a zero.
    """
    for guard in guards_in_order:
        if evidently_positive(guard.expression):
            continue
        found = _break(guard, box)
        if found is not None:
            return found
    return None


def _break(guard: Guard, box: Mapping[sympy.Symbol, Interval]) -> Break | None:
    condition = guard.expression
    answer = nonvanishing(condition, box)
    if answer.verdict == "fails" and len(answer.at) == 1:
        return Break("fails", f"{guard.demand}, but it is 0 at {_text(answer.at[0])}", answer.at)
    names = sorted(condition.free_symbols, key=str)
    signs: dict[int, dict[sympy.Symbol, sympy.Rational]] = {}
    for point in (*grid(names, box), *sample_points(names, box)):
        value = value_at(condition, point)
        if value < 0 or value > 0:
            signs.setdefault(1 if value > 0 else -1, point)
    if -1 in signs and guard.need == "positive":
        at = printed(signs[-1])
        return Break("fails", f"{guard.demand}, but it is negative at {_text(at)}", (at,))
    if len(signs) == 2:
        return _sign_change(guard, signs[-1], signs[1])
    if answer.verdict == "holds" and signs:
        return None
    try:
        if lower_bound(condition, box).value > 0:
            return None
        if guard.need == "nonzero" and upper_bound(condition, box).value < 0:
            return None
    except (NonFiniteError, ValueError):
        pass
    return Break("unknown", f"{guard.demand}, which is not shown")


def _sign_change(
    guard: Guard, low: Mapping[sympy.Symbol, sympy.Rational], high: Mapping[sympy.Symbol, sympy.Rational]
) -> Break:
    """Where the condition is 0: a point on the line between two points of different signs, or two close ones."""
    for _ in range(HALVINGS):
        middle = {name: (low[name] + high[name]) / 2 for name in low}
        if guard.expression.xreplace(middle).is_zero:
            at = printed(middle)
            return Break("fails", f"{guard.demand}, but it is 0 at {_text(at)}", (at,))
        value = value_at(guard.expression, middle)
        if value < 0:
            low = middle
        elif value > 0:
            high = middle
        else:
            break
    ends = printed(low), printed(high)
    return Break("fails", f"{guard.demand}, but it is 0 between {_text(ends[0])} and {_text(ends[1])}", ends)


def _text(point: Mapping[str, str]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in point.items())


def _positive_somewhere(expression: sympy.Expr, box: Mapping[sympy.Symbol, Interval | None]) -> bool:
    """A proved positive value; with a proof that there is no zero it gives the sign on the whole (connected) box."""
    symbols = sorted(expression.free_symbols, key=str)
    return any(value_at(expression, point) > 0 for point in sample_points(symbols, box))
