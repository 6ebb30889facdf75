"""Interval arithmetic on pairs of exact dyadic ends, rounded outward.

``Ends`` is ``(lo, hi)`` with ``lo <= hi``, both exact finite ``arb``; ``None`` means *unbounded or undefined somewhere
on the box* and absorbs everything. A ball is loose where a pair is tight: ``[0, 1]·[0, 1]`` is ``[0, 1]`` here and
``[-1/2, 1]`` as balls, ``[-1, 1]²`` is ``[0, 1]``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flint import arb

Pair = tuple[arb, arb]
Ends = Pair | None

ZERO: Pair = (arb(0), arb(0))
ONE: Pair = (arb(1), arb(1))


def hull(low: arb, high: arb) -> Ends:
    """The pair that encloses the balls ``low`` and ``high`` of the two ends."""
    if not (low.is_finite() and high.is_finite()):
        return None
    return low.lower(), high.upper()


def add(x: Ends, y: Ends) -> Ends:
    if x is None or y is None:
        return None
    return (x[0] + y[0]).lower(), (x[1] + y[1]).upper()


def negate(x: Ends) -> Ends:
    return None if x is None else hull(-x[1], -x[0])


def multiply(x: Ends, y: Ends) -> Ends:
    if x is None or y is None:
        return None
    (a, b), (c, d) = x, y
    if a >= 0:
        if c >= 0:
            return (a * c).lower(), (b * d).upper()
        if d <= 0:
            return (b * c).lower(), (a * d).upper()
        return (b * c).lower(), (b * d).upper()
    if b <= 0:
        if c >= 0:
            return (a * d).lower(), (b * c).upper()
        if d <= 0:
            return (b * d).lower(), (a * c).upper()
        return (a * d).lower(), (a * c).upper()
    if c >= 0:
        return (a * d).lower(), (b * d).upper()
    if d <= 0:
        return (b * c).lower(), (a * c).upper()
    first, second = (a * d).lower(), (b * c).lower()
    third, fourth = (a * c).upper(), (b * d).upper()
    return (first if first <= second else second), (third if third >= fourth else fourth)


def invert(x: Ends) -> Ends:
    if x is None or (x[0] <= 0 and x[1] >= 0):
        return None
    return (1 / x[1]).lower(), (1 / x[0]).upper()


def power(x: Ends, exponent: int) -> Ends:
    """``x^exponent`` for an integer exponent, tight for even ones."""
    if exponent < 0:
        return invert(power(x, -exponent))
    if x is None:
        return None
    low, high = x
    if exponent == 0:
        return ONE
    if exponent == 1:
        return x
    if exponent % 2 == 1 or low >= 0:
        return hull(low**exponent, high**exponent)
    if high <= 0:
        return hull(high**exponent, low**exponent)
    return hull(arb(0), (-low).max(high) ** exponent)


def absolute(x: Pair) -> Ends:
    low, high = x
    if low >= 0:
        return x
    if high <= 0:
        return hull(-high, -low)
    return hull(arb(0), (-low).max(high))


def sign(x: Pair) -> Ends:
    """Slope of ``|x|``: a point on one side of zero, ``[-1, 1]`` across it."""
    if x[0] > 0:
        return ONE
    if x[1] < 0:
        return negate(ONE)
    return arb(-1), arb(1)


def _monotone(function: Callable[[arb], arb]) -> Callable[[Pair], Ends]:
    return lambda x: hull(function(x[0]), function(x[1]))


def _holds_integer(low: arb, high: arb) -> bool:
    """Whether an integer may lie between the two balls; errs on the side of yes."""
    return bool(low.lower().ceil().lower() <= high.upper())


def cosine(x: Pair) -> Ends:
    turns = 2 * arb.pi()
    first, second = x[0].cos(), x[1].cos()
    low, high = first.lower().min(second.lower()), first.upper().max(second.upper())
    if _holds_integer(x[0] / turns, x[1] / turns):
        high = arb(1)
    if _holds_integer(x[0] / turns + arb(1) / 2, x[1] / turns + arb(1) / 2):
        low = arb(-1)
    return hull(low, high)


def sine(x: Pair) -> Ends:
    turns = 2 * arb.pi()
    first, second = x[0].sin(), x[1].sin()
    low, high = first.lower().min(second.lower()), first.upper().max(second.upper())
    if _holds_integer(x[0] / turns - arb(1) / 4, x[1] / turns - arb(1) / 4):
        high = arb(1)
    if _holds_integer(x[0] / turns + arb(1) / 4, x[1] / turns + arb(1) / 4):
        low = arb(-1)
    return hull(low, high)


def tangent(x: Pair) -> Ends:
    if _holds_integer(x[0] / arb.pi() - arb(1) / 2, x[1] / arb.pi() - arb(1) / 2):
        return None
    return hull(x[0].tan(), x[1].tan())


def logarithm(x: Pair) -> Ends:
    return hull(x[0].log(), x[1].log()) if x[0] > 0 else None


def square_root(x: Pair) -> Ends:
    return hull(x[0].sqrt(), x[1].sqrt()) if x[0] >= 0 else None


def hyperbolic_cosine(x: Pair) -> Ends:
    size = absolute(x)
    return None if size is None else hull(size[0].cosh(), size[1].cosh())


def _one_minus_square(value: Pair) -> Ends:
    return add(ONE, negate(power(value, 2)))


@dataclass(frozen=True)
class Function:
    """A smooth function of one variable: on a ball, on ends, and its slope from (argument, value) ends."""

    ball: Callable[[arb], arb]
    ends: Callable[[Pair], Ends]
    slope: Callable[[Pair, Pair], Ends]


FUNCTIONS: dict[str, Function] = {
    "sin": Function(arb.sin, sine, lambda x, _: cosine(x)),
    "cos": Function(arb.cos, cosine, lambda x, _: negate(sine(x))),
    "tan": Function(arb.tan, tangent, lambda _, value: add(ONE, power(value, 2))),
    "exp": Function(arb.exp, _monotone(arb.exp), lambda _, value: value),
    "log": Function(arb.log, logarithm, lambda x, _: invert(x)),
    "sqrt": Function(arb.sqrt, square_root, lambda _, value: invert(add(value, value))),
    "tanh": Function(arb.tanh, _monotone(arb.tanh), lambda _, value: _one_minus_square(value)),
    "atan": Function(arb.atan, _monotone(arb.atan), lambda x, _: invert(add(ONE, power(x, 2)))),
    "sinh": Function(arb.sinh, _monotone(arb.sinh), lambda x, _: hyperbolic_cosine(x)),
    "cosh": Function(arb.cosh, hyperbolic_cosine, lambda x, _: _monotone(arb.sinh)(x)),
    "Abs": Function(lambda x: abs(x), absolute, lambda x, _: sign(x)),
}
