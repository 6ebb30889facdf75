"""The smooth functions on intervals. python-flint is imported here only, and only for sin, cos, tan, log and atan."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from typing import Any

from certify.checker.intervals import Interval, between, enclose, hull
from certify.checker.verdict import Undecided

_ARB_BITS = 192


def call(function: str, x: Interval) -> Interval:
    """An enclosure of the function's values on the interval. Raises ``Undecided`` where it is not smooth."""
    return _call(function, x.a, x.b, x.e)


@lru_cache(maxsize=64)
def _call(function: str, a: int, b: int, e: int) -> Interval:
    x = Interval(a, b, e)
    match function:
        case "exp":
            return x.exp()
        case "sqrt":
            if not x > 0:
                raise Undecided(f"sqrt of {x}")
            return x.sqrt()
        case "sinh":
            return hull(_sinh(x.lower), _sinh(x.upper))
        case "cosh":
            least = 0 if x.a <= 0 <= x.b else min(abs(x.lo), abs(x.hi))
            return hull(_cosh(enclose(least)), _cosh(x.magnitude))
        case "tanh":
            return hull(_tanh(x.lower), _tanh(x.upper))
        case "log":
            if not x > 0:
                raise Undecided(f"log of {x}")
            return hull(_flint("log", x.lower), _flint("log", x.upper))
        case "atan":
            return hull(_flint("atan", x.lower), _flint("atan", x.upper))
        case "sin" | "cos":
            return _clip(_flint(function, x), 1)
        case "tan":
            return _flint("tan", x)
    raise Undecided(f"unknown function {function}")


def _sinh(x: Interval) -> Interval:
    return (x.exp() - (-x).exp()) / 2


def _cosh(x: Interval) -> Interval:
    return (x.exp() + (-x).exp()) / 2


def _tanh(x: Interval) -> Interval:
    """``1 − 2/(e^(2|x|) + 1)`` with the sign of the point ``x``; flat beyond 2^20, so that exp stays in range."""
    size = x.magnitude
    tail = 2 / (((2 * size).exp() if size < (1 << 20) else enclose(1 << 128)) + 1)
    value = between((1 - tail).lo, 1 if size > (1 << 19) else (1 - tail).hi)
    return value if x.a >= 0 else -value


def _clip(x: Interval, size: int) -> Interval:
    return between(max(x.lo, Fraction(-size)), min(x.hi, Fraction(size)))


def _flint(function: str, x: Interval) -> Interval:
    import flint  # lazily: plants without these functions are checked by this package and the standard library alone

    with flint.ctx.workprec(_ARB_BITS):
        ball: Any = flint.arb((x.a, x.e)).union(flint.arb((x.b, x.e)))
        value = getattr(ball, function)()
        if not value.is_finite():
            raise Undecided(f"{function} of {x}")
        middle, exponent = map(int, value.mid().man_exp())
        radius, scale = map(int, value.rad().man_exp())
    return Interval(middle, middle, exponent) + Interval(-radius, radius, scale)
