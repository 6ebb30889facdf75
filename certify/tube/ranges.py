"""Float intervals for the search: estimates with a margin, never bounds. Ranges and secant slopes of expressions.

Slopes of products and powers are divided differences (``x³ − c³ = (x² + xc + c²)(x − c)``), which are narrower than the
derivative over everything between; a function of one argument has the derivative between the two.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

from certify.bounds.balls import Program
from certify.tube.float_intervals import ONE, ZERO, Ends
from certify.tube.tapes import Recorder, Tape
from symbolic.plant import Interval

Range = tuple[float, float]
Argument = int | Range
"""Of an expression: the place of a tape's input, or a range that is known when the tape is recorded."""
Triple = tuple[int, int, int]


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
        self.count = len(program.symbols)
        constants = (program.constant(position) for position in range(len(program.instructions)))
        self.constants: list[Ends] = [None if ends is None else (float(ends[0]), float(ends[1])) for ends in constants]
        self._enclosure = self.enclosure(self.count, range(self.count))

    def enclose(self, box: Sequence[Range]) -> Range:
        """The natural interval extension; the whole line where it is not defined."""
        return self._enclosure(box)

    def enclosure(self, inputs: int, arguments: Sequence[Argument]) -> Tape:
        """``enclose`` with some arguments held: each is the place of one of the tape's ``inputs``, or a range."""
        recorder = Recorder(inputs)
        registers = [_node(recorder, argument) for argument in arguments]
        for step, constant in zip(self.program.instructions, self.constants, strict=True):
            operands = [registers[k] for k in step.operands]
            if step.operation == "constant":
                registers.append(recorder.constant(constant))
            elif step.operation == "add":
                registers.append(reduce(recorder.add, operands))
            elif step.operation == "multiply":
                registers.append(reduce(recorder.multiply, operands))
            elif step.operation == "power":
                registers.append(recorder.power(operands[0], step.exponent))
            else:
                registers.append(recorder.function(step.operation, operands[0]))
        return recorder.tape(registers[self.program.result])

    def slope(self, inputs: int, arguments: Sequence[Argument], index: int, centre: Argument) -> Tape:
        """``f(x) − f(c) ∈ slope · (x_k − c_k)`` when only argument ``k = index`` moves, from ``centre`` to
        ``arguments[index]``, and the others are anywhere in theirs; some may be held, as in ``enclosure``."""
        record = _SecantRecorder(inputs)
        registers = [record.still(argument) for argument in arguments]
        registers[index] = record.moving(arguments[index], centre)
        for step, constant in zip(self.program.instructions, self.constants, strict=True):
            operands = [registers[k] for k in step.operands]
            if step.operation == "constant":
                registers.append(record.still(constant))
            elif step.operation == "add":
                registers.append(reduce(record.sum, operands))
            elif step.operation == "multiply":
                registers.append(reduce(record.product, operands))
            elif step.operation == "power":
                registers.append(record.power(operands[0], step.exponent))
            else:
                registers.append(record.function(step.operation, operands[0]))
        return record.recorder.tape(registers[self.program.result][2])


class _SecantRecorder:
    """Records triples: the range at ``x``, the range at ``c``, and the slope between."""

    def __init__(self, inputs: int) -> None:
        self.recorder = Recorder(inputs)
        self.zero, self.one = self.recorder.constant(ZERO), self.recorder.constant(ONE)

    def still(self, argument: Argument | None) -> Triple:
        node = _node(self.recorder, argument)
        return node, node, self.zero

    def moving(self, to: Argument, centre: Argument) -> Triple:
        return _node(self.recorder, to), _node(self.recorder, centre), self.one

    def sum(self, f: Triple, g: Triple) -> Triple:
        add = self.recorder.add
        return add(f[0], g[0]), add(f[1], g[1]), add(f[2], g[2])

    def product(self, f: Triple, g: Triple) -> Triple:
        multiply = self.recorder.multiply
        slope = self.recorder.add(multiply(f[2], g[0]), multiply(f[1], g[2]))
        return multiply(f[0], g[0]), multiply(f[1], g[1]), slope

    def power(self, f: Triple, exponent: int) -> Triple:
        record, (x, c, slope), count = self.recorder, f, abs(exponent)
        values = record.power(x, exponent), record.power(c, exponent)
        if slope == self.zero:
            return *values, slope
        terms = (record.multiply(record.power(x, k), record.power(c, count - 1 - k)) for k in range(count))
        difference = reduce(record.add, terms, self.zero)
        if exponent < 0:  # 1/xᵐ − 1/cᵐ = −(xᵐ − cᵐ)/(xᵐ cᵐ)
            difference = record.negate(record.multiply(difference, record.multiply(*values)))
        return *values, record.multiply(slope, difference)

    def function(self, name: str, f: Triple) -> Triple:
        record, (x, c, slope) = self.recorder, f
        values = record.function(name, x), record.function(name, c)
        if slope == self.zero:
            return *values, slope
        between = record.hull(x, c)
        return *values, record.multiply(slope, record.derivative(name, between, record.function(name, between)))


def _node(recorder: Recorder, argument: Argument | None) -> int:
    return argument if isinstance(argument, int) else recorder.constant(argument)
