"""An expression in one variable as a function of arrays of floats: for proposals, never for bounds."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Any

import numpy as np
import sympy

Array = np.ndarray[Any, np.dtype[np.float64]]
Function = Callable[[Array], Array]

FUNCTIONS: dict[type, Function] = {
    sympy.sin: np.sin,
    sympy.cos: np.cos,
    sympy.tan: np.tan,
    sympy.exp: np.exp,
    sympy.log: np.log,
    sympy.tanh: np.tanh,
    sympy.atan: np.arctan,
    sympy.sinh: np.sinh,
    sympy.cosh: np.cosh,
}


def float_function(expression: sympy.Expr, variable: sympy.Symbol) -> Function:
    """The value at every entry of an array; not a number where the expression has none."""
    if not expression.has(variable):
        value = float(expression)
        return lambda x: np.full_like(x, value)
    if expression == variable:
        return lambda x: x
    parts = [float_function(part, variable) for part in expression.args]
    if expression.is_Add:
        return lambda x: reduce(np.add, (part(x) for part in parts))
    if expression.is_Mul:
        return lambda x: reduce(np.multiply, (part(x) for part in parts))
    if expression.is_Pow:
        base, exponent = parts
        if expression.exp.is_Integer:
            power = int(expression.exp)
            return lambda x: base(x) ** power
        return lambda x: base(x) ** exponent(x)
    outer = FUNCTIONS[type(expression)]
    return lambda x: outer(parts[0](x))
