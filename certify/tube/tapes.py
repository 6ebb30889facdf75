"""Float-interval operations recorded once and replayed for every box.

What depends on constants only is done while recording, and what the result does not need is left out: most secant
slopes of a control loop are constant, the others take a few operations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import inf

from certify.tube import float_intervals as intervals
from certify.tube.float_intervals import ONE, ZERO, Ends, Pair

Operation = Callable[[Ends, Ends], Ends]


@dataclass(frozen=True, eq=False)
class Tape:
    """Register ``k`` is input ``k``, then come the constants; every step fills the next one."""

    inputs: int
    constants: tuple[Ends, ...]
    steps: tuple[tuple[Operation, int, int], ...]
    result: int

    @property
    def fixed(self) -> Pair | None:
        """The result where it depends on no input."""
        place = self.result - self.inputs
        return self.constants[place] if 0 <= place < len(self.constants) else None

    def __call__(self, inputs: Sequence[Pair]) -> Pair:
        """The range of the result; the whole line where it is not defined."""
        registers: list[Ends] = [*inputs, *self.constants]
        for operation, first, second in self.steps:
            registers.append(operation(registers[first], registers[second]))
        return registers[self.result] or (-inf, inf)


class Recorder:
    """Node ``k`` is input ``k``; the methods return the nodes of their results, equal ones once."""

    def __init__(self, inputs: int) -> None:
        self.inputs = inputs
        self._count = inputs
        self._constants: dict[int, Ends] = {}
        self._steps: dict[int, tuple[Operation, int, int]] = {}
        self._known: dict[tuple[Operation, int, int] | Ends, int] = {}

    def constant(self, ends: Ends) -> int:
        if ends not in self._known:
            self._known[ends] = self._next()
            self._constants[self._known[ends]] = ends
        return self._known[ends]

    def add(self, x: int, y: int) -> int:
        if self._constants.get(x) == ZERO:
            return y
        return x if self._constants.get(y) == ZERO else self._do(intervals.add, x, y)

    def multiply(self, x: int, y: int) -> int:
        for one, other in ((x, y), (y, x)):
            if self._constants.get(one) in (ZERO, ONE):
                return one if self._constants[one] == ZERO else other
        return self._do(intervals.multiply, x, y)

    def negate(self, x: int) -> int:
        return self._do(_negated, x, x)

    def power(self, x: int, exponent: int) -> int:
        return x if exponent == 1 else self._do(_power(exponent), x, x)

    def function(self, name: str, x: int) -> int:
        return self._do(_function(name), x, x)

    def derivative(self, name: str, x: int, value: int) -> int:
        """The range of a function's derivative, from the ranges of argument and value."""
        return self._do(_derivative(name), x, value)

    def hull(self, x: int, y: int) -> int:
        return x if x == y else self._do(_hull, x, y)

    def tape(self, result: int) -> Tape:
        """What it takes to get one node."""
        needed, open_nodes = {result}, [result]
        while open_nodes:
            for node in self._steps.get(open_nodes.pop(), (None, result, result))[1:]:
                if node not in needed:
                    needed.add(node)
                    open_nodes.append(node)
        constants = [node for node in self._constants if node in needed]
        steps = [node for node in self._steps if node in needed]
        place = {node: k for k, node in enumerate((*range(self.inputs), *constants, *steps))}
        return Tape(
            self.inputs,
            tuple(self._constants[node] for node in constants),
            tuple((operation, place[x], place[y]) for operation, x, y in map(self._steps.__getitem__, steps)),
            place[result],
        )

    def _do(self, operation: Operation, x: int, y: int) -> int:
        if x in self._constants and y in self._constants:
            return self.constant(operation(self._constants[x], self._constants[y]))
        step = (operation, x, y)
        if step not in self._known:
            self._known[step] = self._next()
            self._steps[self._known[step]] = step
        return self._known[step]

    def _next(self) -> int:
        self._count += 1
        return self._count - 1


def _negated(x: Ends, _: Ends) -> Ends:
    return intervals.negate(x)


def _hull(x: Ends, y: Ends) -> Ends:
    return None if x is None or y is None else (min(x[0], y[0]), max(x[1], y[1]))


@cache
def _power(exponent: int) -> Operation:
    return lambda x, _: intervals.power(x, exponent)


@cache
def _function(name: str) -> Operation:
    return lambda x, _: intervals.function_ends(name, x)


@cache
def _derivative(name: str) -> Operation:
    return lambda x, value: None if x is None or value is None else intervals.function_slope(name, x, value)
