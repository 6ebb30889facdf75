"""Where an expression may fail to be smooth: the conditions on its parts under which it is analytic."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import sympy

Need = Literal["positive", "nonzero"]


@dataclass(frozen=True)
class Guard:
    """``expression`` must be ``need`` for ``owner`` (the part of the formula that it guards) to be analytic."""

    expression: sympy.Expr
    need: Need
    owner: str

    @property
    def demand(self) -> str:
        return f"{self.owner} needs {self.expression} to be {self.need}"


@dataclass(frozen=True)
class AgentGuards:
    """The guards of an agent's expressions as they are written: SymPy cancels parts before anybody can look at them.

    ``zero_dynamics`` has one entry per zero state; empty where an agent was not read from text.
    """

    zero_dynamics: tuple[tuple[Guard, ...], ...] = ()
    f: tuple[Guard, ...] = ()
    b: tuple[Guard, ...] = ()
    cost: tuple[Guard, ...] = ()

    def of_zero_dynamics(self, index: int) -> tuple[Guard, ...]:
        return self.zero_dynamics[index] if self.zero_dynamics else ()

    def at(self, values: Mapping[sympy.Symbol, sympy.Expr]) -> AgentGuards:
        """With some names replaced by their values."""

        def replaced(written: tuple[Guard, ...]) -> tuple[Guard, ...]:
            return tuple(replace(guard, expression=guard.expression.xreplace(dict(values))) for guard in written)

        return AgentGuards(
            tuple(map(replaced, self.zero_dynamics)), replaced(self.f), replaced(self.b), replaced(self.cost)
        )


NO_GUARDS = AgentGuards()


def guards(expression: sympy.Expr) -> Iterator[Guard]:
    """The guards of all parts, innermost first; an expression without guards is analytic for all real symbols."""
    seen: set[Guard] = set()
    for node in sympy.postorder_traversal(expression):
        guard = _guard(node)
        if guard is not None and guard.expression.free_symbols and guard not in seen:
            seen.add(guard)
            yield guard


def of_denominator(base: sympy.Expr) -> Guard:
    return Guard(base, "nonzero", f"the denominator {base}")


def of_power(base: sympy.Expr, exponent: object) -> Guard:
    """Of a power whose exponent is not an integer."""
    return Guard(base, "positive", f"the power {exponent} of {base}")


def of_function(function: str, argument: sympy.Expr) -> Guard | None:
    match function:
        case "sqrt":
            return Guard(argument, "positive", f"the root of {argument}")
        case "log":
            return Guard(argument, "positive", f"the logarithm of {argument}")
        case "tan":
            return Guard(sympy.cos(argument), "nonzero", f"the tangent of {argument}")
        case _:
            return None


def _guard(node: sympy.Basic) -> Guard | None:
    if isinstance(node, sympy.Pow):
        base, exponent = node.args
        if isinstance(exponent, sympy.Integer):
            return of_denominator(base) if exponent < 0 else None
        if base == sympy.E:
            return None
        return of_function("sqrt", base) if exponent == sympy.S.Half else of_power(base, exponent)
    if isinstance(node, sympy.log | sympy.tan):
        return of_function(node.func.__name__, node.args[0])
    if isinstance(node, sympy.Abs | sympy.sign):
        return Guard(node.args[0], "nonzero", f"the absolute value of {node.args[0]}")
    return None
