"""Recorded float-interval operations: constants are folded, and nothing else changes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

from certify.bounds.balls import compile_expression
from certify.tube import float_intervals as intervals
from certify.tube.ranges import Argument, FloatProgram, Range
from certify.tube.tapes import Recorder

TEXTS = [
    "x*y*a + x**2",
    "a*x**3 - b*y",
    "sin(a*x)*exp(b*y)",
    "1/(x**2 + y**2 + a) + b",
    "Abs(x) + a*b*y",
    "x**-2*y + a",
]


def program(text: str) -> FloatProgram:
    symbols = sympy.symbols("x y a b", real=True)
    return FloatProgram(
        compile_expression(sympy.sympify(text, locals=dict(zip("xyab", symbols, strict=True))), symbols)
    )


def boxes(count: int) -> list[list[Range]]:
    generator = np.random.default_rng(7)
    centres, radii = generator.uniform(0.5, 3.0, (count, 5)), generator.uniform(0, 0.4, (count, 5))
    return [
        [(float(c - r), float(c + r)) for c, r in zip(*pair, strict=True)] for pair in zip(centres, radii, strict=True)
    ]


@pytest.mark.parametrize("text", TEXTS)
def test_arguments_that_are_held_give_the_same_ranges_and_slopes(text: str) -> None:
    """``a``, ``b`` and the centre are held or not: the same numbers, in fewer steps."""
    function = program(text)
    for x, y, a, b, centre in boxes(40):
        whole = [x, y, a, b]
        held: list[Argument] = [0, 1, a, b]
        assert function.enclosure(2, held)([x, y]) == pytest.approx(function.enclose(whole), rel=1e-13)
        for index in (0, 1):
            expected = function.slope(len(whole) + 1, range(len(whole)), index, len(whole))([*whole, centre])
            assert function.slope(2, held, index, centre)([x, y]) == pytest.approx(expected, rel=1e-13)
            inside = function.slope(3, held, index, 2)
            assert inside([x, y, centre]) == pytest.approx(expected, rel=1e-13)


def test_what_depends_on_no_input_is_fixed() -> None:
    function, a, b = program("a*x + b*y + x*y"), (1.0, 2.0), (-1.0, 3.0)
    still = function.slope(1, [0, (0.0, 0.0), a, b], 0, (5.0, 5.0))
    assert still.fixed == a and not still.steps and still([(0.0, 1.0)]) == a
    moving = function.slope(2, [0, 1, a, b], 0, (5.0, 5.0))
    assert moving.fixed is None and moving([(0.0, 1.0), (2.0, 4.0)]) == (3.0, 6.0)
    assert len(moving.steps) == 1


def test_equal_operations_are_recorded_once_and_unused_ones_not_at_all() -> None:
    recorder = Recorder(2)
    product = recorder.multiply(0, 1)
    assert recorder.multiply(0, 1) == product and recorder.hull(product, product) == product
    assert recorder.multiply(product, recorder.constant(intervals.ONE)) == product
    assert recorder.add(recorder.constant(intervals.ZERO), product) == product
    recorder.power(product, 5)
    tape = recorder.tape(recorder.add(product, recorder.constant((1.0, 2.0))))
    assert len(tape.steps) == 2 and len(tape.constants) == 1
    assert tape([(1.0, 2.0), (3.0, 4.0)]) == (4.0, 10.0)


def test_undefined_ranges_are_the_whole_line() -> None:
    recorder = Recorder(1)
    root = recorder.function("sqrt", 0)
    assert recorder.tape(root)([(4.0, 9.0)]) == (2.0, 3.0)
    assert recorder.tape(root)([(-1.0, 9.0)]) == (-math.inf, math.inf)
    undefined = recorder.power(recorder.constant((-1.0, 1.0)), -1)
    held = recorder.tape(recorder.add(undefined, 0))
    assert held.fixed is None and held([(0.0, 1.0)]) == (-math.inf, math.inf)
