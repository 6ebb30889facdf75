"""Straight-line programs: rigorous values at points, ranges and slopes over boxes, exact values at rational points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import sympy
from flint import arb, ctx, fmpq

from certify.bounds import ranges
from certify.bounds.conversions import PRECISION, NonFiniteError, ball_power, lower, to_ends, upper
from certify.bounds.ranges import FUNCTIONS, Ends
from symbolic.plant import Interval

_THIN_BITS = 64


@dataclass(frozen=True)
class Instruction:
    """One step; ``operation`` is ``constant``, ``add``, ``multiply``, ``power`` or the name of a function."""

    operation: str
    operands: tuple[int, ...] = ()
    exponent: int = 0
    constant: sympy.Expr = sympy.S.Zero


@dataclass(frozen=True, eq=False)
class Program:
    """A straight-line program; register ``k < len(symbols)`` is input ``k``, every instruction fills the next one."""

    symbols: tuple[sympy.Symbol, ...]
    instructions: tuple[Instruction, ...]
    result: int
    degrees: tuple[int | None, ...]
    """Structural degree in each symbol; ``None`` when the expression is not polynomial in it."""
    _balls: tuple[arb, ...]
    _ends: tuple[Ends, ...]

    def __call__(self, values: Sequence[arb]) -> arb:
        """A ball around the values the expression takes for arguments in the given balls.

        Thin arguments are evaluated with balls, wide ones by their ends. The result may be non-finite.
        """
        if len(values) != len(self.symbols):
            raise ValueError(f"{len(self.symbols)} arguments are needed, not {len(values)}")
        with ctx.workprec(PRECISION):
            if all(value.is_exact() or value.rel_accuracy_bits() >= _THIN_BITS for value in values):
                return self._point(values)
            if not all(value.is_finite() for value in values):
                return arb.nan()
            ends = self.ends([(value.lower(), value.upper()) for value in values])
            return arb.nan() if ends is None else ends[0].union(ends[1])

    def enclose(self, box: Sequence[Interval | Fraction]) -> Interval:
        """An interval that holds every value over the box; raises ``NonFiniteError`` where there is none."""
        sides = [to_ends(side) for side in box]
        with ctx.workprec(PRECISION):
            ends = self.ends(sides)
        if ends is None:
            raise NonFiniteError("the expression is unbounded or undefined somewhere on the box")
        return Interval(lower(ends[0]), upper(ends[1]))

    def exact(self, values: Sequence[Fraction]) -> Fraction | None:
        """The exact value at a rational point, or ``None`` if the expression is not rational or has a pole there."""
        registers = [fmpq(value.numerator, value.denominator) for value in values]
        for step in self.instructions:
            operands = [registers[k] for k in step.operands]
            if step.operation == "constant":
                if not isinstance(step.constant, sympy.Rational):
                    return None
                registers.append(fmpq(int(step.constant.p), int(step.constant.q)))
            elif step.operation == "add":
                registers.append(sum(operands, fmpq(0)))
            elif step.operation == "multiply":
                product = fmpq(1)
                for operand in operands:
                    product *= operand
                registers.append(product)
            elif step.operation == "power":
                if operands[0] == 0 and step.exponent < 0:
                    return None
                registers.append(operands[0] ** step.exponent)
            else:
                return None
        value = registers[self.result]
        return Fraction(int(value.p), int(value.q))

    def _point(self, values: Sequence[arb]) -> arb:
        registers = list(values)
        for index, step in enumerate(self.instructions):
            operation, operands = step.operation, step.operands
            if operation == "multiply":
                value = registers[operands[0]]
                for k in operands[1:]:
                    value = value * registers[k]
            elif operation == "add":
                value = registers[operands[0]]
                for k in operands[1:]:
                    value = value + registers[k]
            elif operation == "power":
                value = ball_power(registers[operands[0]], step.exponent)
            elif operation == "constant":
                value = self._balls[index]
            else:
                value = FUNCTIONS[operation].ball(registers[operands[0]])
            registers.append(value)
        return registers[self.result]

    def _registers(self, box: Sequence[Ends]) -> list[Ends]:
        registers = list(box)
        for index, step in enumerate(self.instructions):
            operation, operands = step.operation, step.operands
            value: Ends
            if operation == "multiply":
                value = registers[operands[0]]
                for k in operands[1:]:
                    value = ranges.multiply(value, registers[k])
            elif operation == "add":
                value = registers[operands[0]]
                for k in operands[1:]:
                    value = ranges.add(value, registers[k])
            elif operation == "power":
                value = ranges.power(registers[operands[0]], step.exponent)
            elif operation == "constant":
                value = self._ends[index]
            else:
                argument = registers[operands[0]]
                value = None if argument is None else FUNCTIONS[operation].ends(argument)
            registers.append(value)
        return registers

    def constant(self, position: int) -> Ends:
        """The ends of the constant that instruction ``position`` puts into its register."""
        return self._ends[position]

    def ends(self, box: Sequence[Ends]) -> Ends:
        """The range over a box of ends (natural interval extension)."""
        return self._registers(box)[self.result]

    def ends_and_slopes(self, box: Sequence[Ends]) -> tuple[Ends, tuple[Ends, ...]]:
        """The range and an enclosure of every partial derivative over the box.

        When the range is not ``None`` the expression is continuous on the box and, wherever a slope is not ``None``,
        Lipschitz in that variable with slopes in the enclosure, so that mean-value forms hold.
        """
        registers = self._registers(box)
        inputs = len(self.symbols)
        if registers[self.result] is None:
            return None, (None,) * inputs
        slopes: list[Ends] = [ranges.ZERO] * len(registers)
        slopes[self.result] = ranges.ONE
        for index in range(len(self.instructions) - 1, -1, -1):
            step, slope = self.instructions[index], slopes[inputs + index]
            if step.operation == "constant" or slope == ranges.ZERO:
                continue
            for k, factor in zip(step.operands, self._local_slopes(step, registers, inputs + index), strict=True):
                slopes[k] = ranges.add(slopes[k], ranges.multiply(slope, factor))
        return registers[self.result], tuple(slopes[:inputs])

    @staticmethod
    def _local_slopes(step: Instruction, registers: Sequence[Ends], target: int) -> list[Ends]:
        if step.operation == "add":
            return [ranges.ONE] * len(step.operands)
        if step.operation == "power":
            count = (arb(step.exponent), arb(step.exponent))
            return [ranges.multiply(count, ranges.power(registers[step.operands[0]], step.exponent - 1))]
        if step.operation == "multiply":
            return _other_products([registers[k] for k in step.operands])
        argument, value = registers[step.operands[0]], registers[target]
        if argument is None or value is None:
            return [None]
        return [FUNCTIONS[step.operation].slope(argument, value)]


def _other_products(factors: Sequence[Ends]) -> list[Ends]:
    """For each factor the product of all the others."""
    before: list[Ends] = [ranges.ONE]
    for factor in factors[:-1]:
        before.append(ranges.multiply(before[-1], factor))
    products: list[Ends] = []
    after: Ends = ranges.ONE
    for factor, left in zip(reversed(factors), reversed(before), strict=True):
        products.append(ranges.multiply(left, after))
        after = ranges.multiply(after, factor)
    return products[::-1]
