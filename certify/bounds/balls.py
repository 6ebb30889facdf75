"""Rigorous evaluation of expressions: exact rationals in, outward-rounded balls out (python-flint ``arb``).

An expression becomes a straight-line program that shares equal subexpressions. It is evaluated at points with balls and
on boxes with pairs of ends (``ranges``), with slopes by reverse accumulation for mean-value forms (``suprema``).
Whatever is not a finite number (a pole, a logarithm of something that may be negative, an overflow) shows as
``NonFiniteError`` or as a non-finite ball, never as a number.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache

import sympy
from flint import arb, ctx

from certify.bounds.conversions import (
    PRECISION,
    NonFiniteError,
    lower,
    rational_ball,
    to_arb,
    to_ends,
    to_interval,
    upper,
)
from certify.bounds.program import Instruction, Program
from certify.bounds.ranges import FUNCTIONS, Ends

__all__ = [
    "PRECISION",
    "NonFiniteError",
    "Program",
    "compile_expression",
    "lower",
    "to_arb",
    "to_ends",
    "to_interval",
    "upper",
]

_CONSTANTS = {sympy.E: arb.const_e, sympy.pi: arb.pi}


@lru_cache(maxsize=4096)
def compile_expression(expression: sympy.Expr, symbols: tuple[sympy.Symbol, ...]) -> Program:
    """Compile an expression in the given symbols.

    Allowed are sums, products, powers with integer or half-integer exponents, rationals, ``e`` and ``pi``, and the
    functions in ``ranges.FUNCTIONS``. Raises ``ValueError`` for anything else (floats, infinities, unknown symbols and
    functions).
    """
    compiler = _Compiler(symbols)
    result = compiler.register(expression)
    steps = tuple(compiler.steps)
    with ctx.workprec(PRECISION):
        balls = tuple(_constant(step.constant) for step in steps)
    ends: tuple[Ends, ...] = tuple((ball.lower(), ball.upper()) for ball in balls)
    return Program(symbols, steps, result, compiler.degrees[result], balls, ends)


def _constant(value: sympy.Expr) -> arb:
    if isinstance(value, sympy.Rational):
        return rational_ball(Fraction(int(value.p), int(value.q)))
    return _CONSTANTS[value]()


Degrees = tuple[int | None, ...]


class _Compiler:
    """Gives every distinct subexpression one register."""

    def __init__(self, symbols: tuple[sympy.Symbol, ...]) -> None:
        if len(set(symbols)) != len(symbols):
            raise ValueError("a symbol is listed twice")
        self.steps: list[Instruction] = []
        self.known: dict[sympy.Basic, int] = {item: k for k, item in enumerate(symbols)}
        self.degrees: list[Degrees] = [tuple(int(k == j) for j in range(len(symbols))) for k in range(len(symbols))]
        self.zero: Degrees = (0,) * len(symbols)

    def register(self, node: sympy.Basic) -> int:
        if node not in self.known:
            self.known[node] = self._compile(node)
        return self.known[node]

    def _emit(self, step: Instruction, degrees: Degrees) -> int:
        self.steps.append(step)
        self.degrees.append(degrees)
        return len(self.degrees) - 1

    def _compile(self, node: sympy.Basic) -> int:
        if isinstance(node, sympy.Symbol):
            raise ValueError(f"the symbol {node} has no value")
        if isinstance(node, sympy.Rational) or node in _CONSTANTS:
            return self._emit(Instruction("constant", constant=node), self.zero)
        if isinstance(node, sympy.Add):
            operands = tuple(self.register(item) for item in node.args)
            columns = zip(*(self.degrees[k] for k in operands), strict=True)
            return self._emit(Instruction("add", operands), tuple(_largest(column) for column in columns))
        if isinstance(node, sympy.Mul):
            operands = tuple(self.register(item) for item in node.args)
            columns = zip(*(self.degrees[k] for k in operands), strict=True)
            return self._emit(Instruction("multiply", operands), tuple(_total(column) for column in columns))
        if isinstance(node, sympy.Pow):
            return self._power(*node.args)
        name = type(node).__name__
        if name in FUNCTIONS and isinstance(node, sympy.Function):
            return self._function(name, self.register(node.args[0]))
        raise ValueError(f"{node} is not allowed in an expression to be bounded ({name})")

    def _function(self, name: str, operand: int) -> int:
        return self._emit(Instruction(name, (operand,)), tuple(0 if d == 0 else None for d in self.degrees[operand]))

    def _power(self, base: sympy.Basic, exponent: sympy.Basic) -> int:
        if not isinstance(exponent, sympy.Rational):
            raise ValueError(f"the exponent {exponent} is not rational")
        if exponent.q > 2:  # exp(p/q log(base)), as the checker reads it
            factors = (self.register(exponent), self._function("log", self.register(base)))
            columns = zip(*(self.degrees[k] for k in factors), strict=True)
            product = self._emit(Instruction("multiply", factors), tuple(_total(column) for column in columns))
            return self._function("exp", product)
        operand = self.register(base)
        if exponent.q == 2:
            root = sympy.sqrt(base) if exponent != sympy.S.Half else None
            operand = self._function("sqrt", operand) if root is None else self.register(root)
        count = int(exponent.p)
        if count == 1:
            return operand
        degrees = tuple(0 if d == 0 else None if d is None or count < 0 else d * count for d in self.degrees[operand])
        return self._emit(Instruction("power", (operand,), count), degrees)


def _largest(column: Sequence[int | None]) -> int | None:
    known = [d for d in column if d is not None]
    return max(known) if len(known) == len(column) else None


def _total(column: Sequence[int | None]) -> int | None:
    known = [d for d in column if d is not None]
    return sum(known) if len(known) == len(column) else None
