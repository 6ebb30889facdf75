"""Float intervals for the search: estimates with a margin, never bounds. Ranges and secant slopes of expressions.

Slopes of products and powers are divided differences (``x³ − c³ = (x² + xc + c²)(x − c)``), which are narrower than the
derivative over everything between; a function of one argument has the derivative between the two.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import TypeVar

from certify.bounds.balls import Program
from certify.tube import float_intervals as intervals
from certify.tube.float_intervals import ONE, ZERO, Ends
from symbolic.plant import Interval

Range = tuple[float, float]
T = TypeVar("T")
Triple = tuple[Ends, Ends, Ends]
"""The range at ``x``, the range at ``c``, and the slope between."""


def floats(side: Interval) -> Range:
    return float(side.lo), float(side.hi)


def hull(first: Range, second: Range) -> Range:
    return min(first[0], second[0]), max(first[1], second[1])


def meet(first: Range, second: Range) -> Range:
    """What lies in both; ``first`` where float errors leave nothing."""
    low, high = max(first[0], second[0]), min(first[1], second[1])
    return (low, high) if low <= high else first


def widen(side: Range, by: float) -> Range:
    return side[0] - by, side[1] + by


def symmetric(bound: float) -> Range:
    return -bound, bound


def magnitude(side: Range) -> float:
    return max(abs(side[0]), abs(side[1]))


class FloatProgram:
    """A straight-line program with its constants as floats."""

    def __init__(self, program: Program) -> None:
        self.program = program
        constants = (program.constant(position) for position in range(len(program.instructions)))
        self.constants: list[Ends] = [None if ends is None else (float(ends[0]), float(ends[1])) for ends in constants]

    def enclose(self, box: Sequence[Range]) -> Range:
        """The natural interval extension; the whole line where it is not defined."""
        registers: list[Ends] = list(box)
        for step, constant in zip(self.program.instructions, self.constants, strict=True):
            operands = [registers[k] for k in step.operands]
            if step.operation == "constant":
                registers.append(constant)
            elif step.operation == "add":
                registers.append(_folded(intervals.add, operands))
            elif step.operation == "multiply":
                registers.append(_folded(intervals.multiply, operands))
            elif step.operation == "power":
                registers.append(intervals.power(operands[0], step.exponent))
            else:
                registers.append(intervals.function_ends(step.operation, operands[0]))
        return registers[self.program.result] or (-inf, inf)

    def secant(self, box: Sequence[Range], index: int, centre: Range) -> Range:
        """``f(x) − f(c) ∈ slope · (x_k − c_k)`` when only argument ``k = index`` moves, from ``centre`` to
        ``box[index]``, and the others are anywhere in ``box``; the whole line where it is not defined."""
        registers: list[Triple] = [(side, side, ZERO) for side in box]
        registers[index] = (box[index], centre, ONE)
        for step, constant in zip(self.program.instructions, self.constants, strict=True):
            operands = [registers[k] for k in step.operands]
            if step.operation == "constant":
                registers.append((constant, constant, ZERO))
            elif step.operation == "add":
                registers.append(_folded(_sum, operands))
            elif step.operation == "multiply":
                registers.append(_folded(_product, operands))
            elif step.operation == "power":
                registers.append(_power(operands[0], step.exponent))
            else:
                registers.append(_function(step.operation, operands[0]))
        return registers[self.program.result][2] or (-inf, inf)


def _folded(combine: Callable[[T, T], T], operands: Sequence[T]) -> T:
    total = operands[0]
    for operand in operands[1:]:
        total = combine(total, operand)
    return total


def _sum(f: Triple, g: Triple) -> Triple:
    if f[2] is ZERO and g[2] is ZERO:
        x = intervals.add(f[0], g[0])
        return x, x, ZERO
    return intervals.add(f[0], g[0]), intervals.add(f[1], g[1]), intervals.add(f[2], g[2])


def _product(f: Triple, g: Triple) -> Triple:
    x = intervals.multiply(f[0], g[0])
    if f[2] is ZERO and g[2] is ZERO:
        return x, x, ZERO
    slope = intervals.add(intervals.multiply(f[2], g[0]), intervals.multiply(f[1], g[2]))
    return x, intervals.multiply(f[1], g[1]), slope


def _power(f: Triple, exponent: int) -> Triple:
    x, c, slope = f
    values = intervals.power(x, exponent), intervals.power(c, exponent)
    if slope is ZERO:
        return *values, ZERO
    count = abs(exponent)
    difference: Ends = ZERO
    for k in range(count):
        term = intervals.multiply(intervals.power(x, k), intervals.power(c, count - 1 - k))
        difference = intervals.add(difference, term)
    if exponent < 0:  # 1/xᵐ − 1/cᵐ = −(xᵐ − cᵐ)/(xᵐ cᵐ)
        difference = intervals.negate(intervals.multiply(difference, intervals.multiply(*values)))
    return *values, intervals.multiply(slope, difference)


def _function(name: str, f: Triple) -> Triple:
    x, c, slope = f
    values = intervals.function_ends(name, x), intervals.function_ends(name, c)
    if slope is ZERO:
        return *values, ZERO
    if x is None or c is None:
        return *values, None
    between = hull(x, c)
    over = intervals.function_ends(name, between)
    derivative = None if over is None else intervals.function_slope(name, between, over)
    return *values, intervals.multiply(slope, derivative)
