"""Python functions from SymPy expressions: a walk over the expression tree that can only emit arithmetic.

The expressions come out of the plant file's allow-list parser, and the walk has an allow-list of its own: every
symbol is renamed (so no name of the user reaches the source), numbers are printed as float literals, and a node that
is not in the tables below is refused. Plain float arithmetic in compiled Python needs 2 to 4 µs for an agent's
right-hand side and a few ms to generate; a just-in-time compiler would need a second per agent to save less than the
integrator's own steps cost.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import sympy
from sympy.utilities.iterables import numbered_symbols

from certify.float_range import BeyondFloatsError

CompiledFunction = Callable[..., tuple[float, ...]]
"""Takes one sequence of floats per group of symbols, gives the values of the expressions."""

ARITHMETIC_ERRORS = (OverflowError, ZeroDivisionError, ValueError)
"""What a compiled function raises outside the domain of its expressions (``1/0``, ``log(-1)``, ``exp(1000)``)."""

_FUNCTIONS: dict[type[sympy.Basic], str] = {
    sympy.sin: "sin",
    sympy.cos: "cos",
    sympy.tan: "tan",
    sympy.exp: "exp",
    sympy.log: "log",
    sympy.tanh: "tanh",
    sympy.atan: "atan",
    sympy.sinh: "sinh",
    sympy.cosh: "cosh",
}


class Saturation(sympy.Function):
    """``sat_δ(r)``: ``r`` where ``|r| < δ``, else ``sign(r) δ`` (the paper's β_δ). Arguments ``(r, δ)``, ``δ > 0`` a
    number.
    """

    nargs = 2

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """The slope in ``r`` (1 inside, 0 outside); δ is a constant of the design."""
        if argindex != 1:
            raise sympy.ArgumentIndexError(self, argindex)
        return Unsaturated(*self.args)


class Unsaturated(sympy.Function):
    """1 where ``|r| < δ``, else 0: the slope of :class:`Saturation`. Its own slope is 0 but at the kink."""

    nargs = 2

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return sympy.Integer(0)


_FUNCTIONS |= {Saturation: "saturation", Unsaturated: "unsaturated"}


def saturation(r: float, delta: float) -> float:
    """``sat_δ(r)`` in floats."""
    return delta if r >= delta else -delta if r <= -delta else r


def _unsaturated(r: float, delta: float) -> float:
    return 1.0 if -delta < r < delta else 0.0


_NAMESPACE: dict[str, object] = {
    "__builtins__": {},
    "saturation": saturation,
    "unsaturated": _unsaturated,
    **{name: getattr(math, name) for name in ("sin cos tan exp log tanh atan sinh cosh sqrt pow").split()},
}


def compile_function(groups: Sequence[Sequence[sympy.Symbol]], expressions: Sequence[sympy.Expr]) -> CompiledFunction:
    """One function of the symbol groups for all ``expressions``, with shared subexpressions computed once.

    ``function(values_of_group_1, values_of_group_2, …)`` returns one float per expression. Raises ``ValueError`` for
    a symbol in no group, a node that is not arithmetic, or a number beyond the floats; the function itself raises
    ``ARITHMETIC_ERRORS``.
    """
    names: dict[sympy.Symbol, str] = {}
    lines: list[str] = []
    for i, group in enumerate(groups):
        names |= {symbol: f"a{i}_{j}" for j, symbol in enumerate(group)}
        if group:
            lines.append(f"({' '.join(names[symbol] + ',' for symbol in group)}) = a{i}")
    shared, reduced = sympy.cse(list(expressions), symbols=numbered_symbols("t", cls=sympy.Dummy), order="none")
    for i, (symbol, expression) in enumerate(shared):
        lines.append(f"t{i} = {expression_source(expression, names)}")
        names[symbol] = f"t{i}"
    lines.append(f"return ({' '.join(expression_source(expression, names) + ',' for expression in reduced)})")
    header = f"def function({', '.join(f'a{i}' for i in range(len(groups)))}):"
    source = "\n    ".join([header, *lines])
    namespace = dict(_NAMESPACE)
    exec(compile(source, "<generated>", "exec"), namespace)  # noqa: S102 - the source is only what expression_source can emit
    function: CompiledFunction = namespace["function"]  # type: ignore[assignment]  # just defined by the source
    return function


def expression_source(expression: sympy.Expr, names: dict[sympy.Symbol, str]) -> str:
    """Source text of an expression whose symbols are called ``names``. Raises as :func:`compile_function`."""
    if isinstance(expression, sympy.Symbol):
        if expression not in names:
            raise ValueError(f"the symbol {expression} has no value")
        return names[expression]
    if expression.is_Number or expression.is_NumberSymbol:
        return _number(expression)
    if isinstance(expression, sympy.Add):
        return _joined(" + ", [expression_source(term, names) for term in expression.args])
    if isinstance(expression, sympy.Mul):
        return _joined("*", [expression_source(factor, names) for factor in expression.args])
    if isinstance(expression, sympy.Pow):
        return _power(expression.base, expression.exp, names)
    name = _FUNCTIONS.get(type(expression))
    if name is None:
        raise ValueError(f"no code for {type(expression).__name__} in {expression}")
    return f"{name}({', '.join(expression_source(argument, names) for argument in expression.args)})"


def _joined(operator: str, parts: list[str]) -> str:
    """Balanced parentheses: Python's compiler recurses once per operator of a flat sum."""
    if len(parts) == 1:
        return parts[0]
    half = len(parts) // 2
    return f"({_joined(operator, parts[:half])}{operator}{_joined(operator, parts[half:])})"


def _number(number: sympy.Expr) -> str:
    value = float(number)
    if not math.isfinite(value):
        raise BeyondFloatsError
    return repr(value) if value >= 0 else f"({value!r})"


def _power(base: sympy.Expr, exponent: sympy.Expr, names: dict[sympy.Symbol, str]) -> str:
    if base is sympy.E:
        return f"exp({expression_source(exponent, names)})"
    b = expression_source(base, names)
    if exponent.is_Integer:
        size = abs(int(exponent))
        power = "(" + "*".join([b] * size) + ")" if size <= 4 and base.is_Symbol else f"({b}**{size})"
        return power if exponent > 0 else f"(1.0/{power})"
    if exponent == sympy.Rational(1, 2):
        return f"sqrt({b})"
    if exponent == sympy.Rational(-1, 2):
        return f"(1.0/sqrt({b}))"
    return f"pow({b}, {expression_source(exponent, names)})"
