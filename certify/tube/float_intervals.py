"""Interval arithmetic on pairs of floats without outward rounding: for the search, which only needs estimates.

The same functions as ``certify.bounds.ranges``, several times as fast; what the search finds is proved with rounded
ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable

Pair = tuple[float, float]
Ends = Pair | None

ZERO: Pair = (0.0, 0.0)
ONE: Pair = (1.0, 1.0)


def add(x: Ends, y: Ends) -> Ends:
    return None if x is None or y is None else (x[0] + y[0], x[1] + y[1])


def negate(x: Ends) -> Ends:
    return None if x is None else (-x[1], -x[0])


def multiply(x: Ends, y: Ends) -> Ends:
    if x is None or y is None:
        return None
    (a, b), (c, d) = x, y
    if a >= 0 and c >= 0:
        return a * c, b * d
    p, q, r, s = a * c, a * d, b * c, b * d
    return min(p, q, r, s), max(p, q, r, s)


def invert(x: Ends) -> Ends:
    return None if x is None or x[0] <= 0 <= x[1] else (1 / x[1], 1 / x[0])


def power(x: Ends, exponent: int) -> Ends:
    if exponent < 0:
        return invert(power(x, -exponent))
    if x is None or exponent == 0:
        return ONE if exponent == 0 and x is not None else None
    if abs(x[0]) > 1e30 or abs(x[1]) > 1e30:
        return None
    low, high = x[0] ** exponent, x[1] ** exponent
    if exponent % 2 == 1 or x[0] >= 0:
        return low, high
    return (high, low) if x[1] <= 0 else (0.0, max(low, high))


def function_ends(name: str, x: Ends) -> Ends:
    """The range of a function of one argument."""
    if x is None:
        return None
    try:
        return _RANGES[name](x)
    except (ValueError, OverflowError):
        return None


def function_slope(name: str, x: Pair, value: Pair) -> Ends:
    """The range of its derivative, from the ranges of argument and value."""
    try:
        return _SLOPES[name](x, value)
    except (ValueError, OverflowError):
        return None


def _monotone(function: Callable[[float], float]) -> Callable[[Pair], Ends]:
    return lambda x: (function(x[0]), function(x[1]))


def _holds(x: Pair, offset: float) -> bool:
    """Whether a number ``2π(k − offset)`` lies in the pair."""
    return math.ceil(x[0] / math.tau + offset) <= x[1] / math.tau + offset


def _cosine(x: Pair) -> Ends:
    low, high = sorted((math.cos(x[0]), math.cos(x[1])))
    return (-1.0 if _holds(x, 0.5) else low), (1.0 if _holds(x, 0.0) else high)


def _sine(x: Pair) -> Ends:
    return _cosine((x[0] - math.pi / 2, x[1] - math.pi / 2))


def _tangent(x: Pair) -> Ends:
    poles = math.ceil(x[0] / math.pi - 0.5) <= x[1] / math.pi - 0.5
    return None if poles else (math.tan(x[0]), math.tan(x[1]))


def _hyperbolic_cosine(x: Pair) -> Ends:
    low, high = sorted((math.cosh(x[0]), math.cosh(x[1])))
    return (1.0 if x[0] <= 0 <= x[1] else low), high


def _absolute(x: Pair) -> Ends:
    low, high = sorted((abs(x[0]), abs(x[1])))
    return (0.0 if x[0] <= 0 <= x[1] else low), high


_RANGES: dict[str, Callable[[Pair], Ends]] = {
    "sin": _sine,
    "cos": _cosine,
    "tan": _tangent,
    "exp": _monotone(math.exp),
    "log": _monotone(math.log),
    "sqrt": _monotone(math.sqrt),
    "tanh": _monotone(math.tanh),
    "atan": _monotone(math.atan),
    "sinh": _monotone(math.sinh),
    "cosh": _hyperbolic_cosine,
    "Abs": _absolute,
}
_SLOPES: dict[str, Callable[[Pair, Pair], Ends]] = {
    "sin": lambda x, _: _cosine(x),
    "cos": lambda x, _: negate(_sine(x)),
    "tan": lambda _, value: add(ONE, power(value, 2)),
    "exp": lambda _, value: value,
    "log": lambda x, _: invert(x),
    "sqrt": lambda _, value: invert(add(value, value)),
    "tanh": lambda _, value: add(ONE, negate(power(value, 2))),
    "atan": lambda x, _: invert(add(ONE, power(x, 2))),
    "sinh": lambda x, _: _hyperbolic_cosine(x),
    "cosh": lambda x, _: (math.sinh(x[0]), math.sinh(x[1])),
    "Abs": lambda x, _: ONE if x[0] > 0 else negate(ONE) if x[1] < 0 else (-1.0, 1.0),
}
