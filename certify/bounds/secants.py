"""Secant slopes: ``f(x) − f(c) ∈ slope · (x_k − c_k)`` when only argument ``k`` moves from ``c_k`` to ``x_k``.

Slopes of products and powers are divided differences (``x³ − c³ = (x² + xc + c²)(x − c)``), which are narrower than the
derivative over everything between; a function of one argument has the derivative between the two.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from certify.bounds import ranges
from certify.bounds.program import Program
from certify.bounds.ranges import FUNCTIONS, Ends

Triple = tuple[Ends, Ends, Ends]
"""The range at ``x``, the range at ``c``, and the slope between."""


def secant(program: Program, box: Sequence[Ends], index: int, centre: Ends) -> Ends:
    """The slope along input ``index`` from ``centre`` to ``box[index]``, the other inputs anywhere in ``box``; ``None``
    where there is no bound."""
    registers: list[Triple] = [(side, side, ranges.ZERO) for side in box]
    registers[index] = (box[index], centre, ranges.ONE)
    for position, step in enumerate(program.instructions):
        operands = [registers[k] for k in step.operands]
        if step.operation == "constant":
            value = program.constant(position)
            registers.append((value, value, ranges.ZERO))
        elif step.operation == "add":
            registers.append(_folded(_sum, operands))
        elif step.operation == "multiply":
            registers.append(_folded(_product, operands))
        elif step.operation == "power":
            registers.append(_power(operands[0], step.exponent))
        else:
            registers.append(_function(step.operation, operands[0]))
    return registers[program.result][2]


def _folded(combine: Callable[[Triple, Triple], Triple], operands: Sequence[Triple]) -> Triple:
    total = operands[0]
    for operand in operands[1:]:
        total = combine(total, operand)
    return total


def _sum(f: Triple, g: Triple) -> Triple:
    return ranges.add(f[0], g[0]), ranges.add(f[1], g[1]), ranges.add(f[2], g[2])


def _product(f: Triple, g: Triple) -> Triple:
    slope = ranges.add(ranges.multiply(f[2], g[0]), ranges.multiply(f[1], g[2]))
    return ranges.multiply(f[0], g[0]), ranges.multiply(f[1], g[1]), slope


def _power(f: Triple, exponent: int) -> Triple:
    x, c, slope = f
    values = ranges.power(x, exponent), ranges.power(c, exponent)
    if slope == ranges.ZERO:
        return *values, ranges.ZERO
    count = abs(exponent)
    difference: Ends = ranges.ZERO
    for k in range(count):
        difference = ranges.add(difference, ranges.multiply(ranges.power(x, k), ranges.power(c, count - 1 - k)))
    if exponent < 0:  # 1/xᵐ − 1/cᵐ = −(xᵐ − cᵐ)/(xᵐ cᵐ)
        difference = ranges.negate(ranges.multiply(difference, ranges.multiply(*values)))
    return *values, ranges.multiply(slope, difference)


def _function(name: str, f: Triple) -> Triple:
    x, c, slope = f
    function = FUNCTIONS[name]
    values = None if x is None else function.ends(x), None if c is None else function.ends(c)
    if slope == ranges.ZERO:
        return *values, ranges.ZERO
    if x is None or c is None:
        return *values, None
    between = x[0].min(c[0]), x[1].max(c[1])
    over = function.ends(between)
    return *values, None if over is None else ranges.multiply(slope, function.slope(between, over))
