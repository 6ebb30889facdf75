"""Balls enclose, suprema are above every sample and near the best one, and what cannot be bounded is refused."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest
import sympy
from flint import arb, ctx
from hypothesis import given, settings
from hypothesis import strategies as st

from certify.bounds.balls import NonFiniteError, compile_expression, lower, to_arb, to_interval, upper
from certify.bounds.rationals import round_down, round_up, sqrt_down, sqrt_up
from certify.bounds.suprema import lower_bound, magnitude_bound, range_bound, upper_bound
from symbolic.plant import Interval, symbol

x, y, z = symbol("x"), symbol("y"), symbol("z")
UNIT = Interval(Fraction(-1), Fraction(1))
HUGE = Interval(Fraction(-(10**12)), Fraction(10**12))


def interval(lo: object, hi: object) -> Interval:
    return Interval(Fraction(str(lo)), Fraction(str(hi)))


# rationals


@settings(deadline=None)
@given(st.fractions(), st.integers(4, 80))
def test_rounding_is_outward_short_and_close(value: Fraction, bits: int) -> None:
    low, high = round_down(value, bits), round_up(value, bits)
    assert low <= value <= high
    assert high - low <= abs(value) * Fraction(4, 2**bits)
    assert all(abs(end.numerator).bit_length() <= bits + 3 for end in (low, high) if end.denominator != 1)


@settings(deadline=None)
@given(st.fractions(min_value=0))
def test_square_roots_enclose(value: Fraction) -> None:
    low, high = sqrt_down(value), sqrt_up(value)
    assert 0 <= low * low <= value <= high * high
    assert high - low <= high / 2**50


def test_square_roots_of_squares_are_exact_and_of_negatives_refused() -> None:
    assert sqrt_down(Fraction(9, 4)) == sqrt_up(Fraction(9, 4)) == Fraction(3, 2)
    assert sqrt_up(Fraction(10**200, 9)) == Fraction(10**100, 3)
    with pytest.raises(ValueError, match="negative"):
        sqrt_up(Fraction(-1))


def test_rounding_needs_bits() -> None:
    with pytest.raises(ValueError, match="2 bits"):
        round_up(Fraction(1, 3), 1)


# balls


@settings(deadline=None)
@given(st.fractions(max_denominator=10**6))
def test_a_rational_lies_in_its_ball_and_ends_are_exact(value: Fraction) -> None:
    ball = to_arb(value)
    assert lower(ball) <= value <= upper(ball)
    assert upper(ball) - lower(ball) <= abs(value) / 2**120


def test_dyadic_ends_are_not_rounded() -> None:
    assert upper(to_arb(Fraction(3, 8))) == lower(to_arb(Fraction(3, 8))) == Fraction(3, 8)


def test_ends_do_not_depend_on_the_global_precision() -> None:
    program = compile_expression(x / 3, (x,))
    with ctx.workprec(10):
        value = to_interval(program([to_arb(Fraction(1, 7))]))
    assert value.lo <= Fraction(1, 21) <= value.hi
    assert value.hi - value.lo < Fraction(1, 2**100)


@pytest.mark.parametrize("ball", [arb.pos_inf(), arb.neg_inf(), arb.nan(), arb(0, arb.pos_inf())])
def test_non_finite_balls_are_reported(ball: arb) -> None:
    with pytest.raises(NonFiniteError, match="not a finite number"):
        upper(ball)
    with pytest.raises(NonFiniteError, match="not a finite number"):
        lower(ball)


def test_huge_exponents_are_refused_and_tiny_ones_rounded_outward() -> None:
    with pytest.raises(NonFiniteError, match="too large"):
        upper(arb(10) ** (10**9))
    tiny = to_interval(arb(10) ** -(10**9))
    assert tiny.lo <= 0 < tiny.hi < Fraction(1, 2**1000)


def test_even_powers_and_products_are_tight_on_wide_balls() -> None:
    square = to_interval(compile_expression(x**2, (x,))([to_arb(UNIT)]))
    assert square.lo >= -Fraction(1, 10**6) and square.hi <= 1 + Fraction(1, 10**6)
    assert compile_expression(x**2, (x,)).enclose([UNIT]) == Interval(Fraction(0), Fraction(1))
    assert compile_expression(x * y, (x, y)).enclose([interval(0, 1)] * 2) == Interval(Fraction(0), Fraction(1))


def test_wide_arguments_that_are_not_finite_stay_not_finite() -> None:
    assert not compile_expression(1 / x, (x,))([to_arb(UNIT)]).is_finite()
    assert not compile_expression(sympy.log(x), (x,))([to_arb(UNIT)]).is_finite()
    assert not compile_expression(sympy.sqrt(x), (x,))([to_arb(UNIT)]).is_finite()
    assert not compile_expression(sympy.tan(x), (x,))([to_arb(interval(1, 2))]).is_finite()
    assert not compile_expression(x + 1, (x,))([arb(0, arb.pos_inf())]).is_finite()
    with pytest.raises(NonFiniteError, match="unbounded or undefined"):
        compile_expression(1 / x, (x,)).enclose([UNIT])


def test_subexpressions_are_shared() -> None:
    program = compile_expression(sympy.sin(x * y) + sympy.sin(x * y) ** 2 + x * y, (x, y))
    assert [step.operation for step in program.instructions].count("sin") == 1
    assert [step.operation for step in program.instructions].count("multiply") == 1


def test_exact_values_of_rational_functions() -> None:
    program = compile_expression(x**2 / (y - 1) + sympy.Rational(1, 3), (x, y))
    assert program.exact([Fraction(1, 2), Fraction(3)]) == Fraction(1, 8) + Fraction(1, 3)
    assert program.exact([Fraction(1), Fraction(1)]) is None
    assert compile_expression(sympy.sin(x), (x,)).exact([Fraction(0)]) is None
    assert compile_expression(sympy.pi * x, (x,)).exact([Fraction(1)]) is None


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        (sympy.gamma(x), "gamma"),
        (x ** sympy.sqrt(2), r"exponent sqrt\(2\)"),
        (x**y, "exponent y"),
        (x * sympy.Float("0.5"), "Float"),
        (x + sympy.oo, "Infinity"),
        (x + sympy.nan, "NaN"),
        (x + z, "symbol z has no value"),
        (sympy.Function("f")(x), r"f\(x\)"),
        (sympy.Derivative(sympy.Function("f")(x), x), "Derivative"),
        (sympy.Piecewise((x, x > 0), (0, True)), "Piecewise"),
        (x + sympy.I, "ImaginaryUnit"),
    ],
)
def test_other_nodes_are_refused(expression: sympy.Expr, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        compile_expression(expression, (x, y))


def test_arguments_are_counted_and_symbols_distinct() -> None:
    with pytest.raises(ValueError, match="2 arguments are needed, not 1"):
        compile_expression(x + y, (x, y))([arb(1)])
    with pytest.raises(ValueError, match="listed twice"):
        compile_expression(x, (x, x))


def _leaf() -> st.SearchStrategy[sympy.Expr]:
    return st.one_of(
        st.sampled_from([x, y]),
        st.fractions(-3, 3, max_denominator=5).map(lambda q: sympy.Rational(q.numerator, q.denominator)),
    )


def _grow(inner: st.SearchStrategy[sympy.Expr]) -> st.SearchStrategy[sympy.Expr]:
    unary = st.sampled_from(
        [
            sympy.sin,
            sympy.cos,
            sympy.tanh,
            sympy.atan,
            sympy.sinh,
            sympy.cosh,
            sympy.Abs,
            lambda e: e**2,
            lambda e: e**3,
            lambda e: 1 / (1 + e**2),
            lambda e: sympy.sqrt(1 + e**2),
            lambda e: sympy.log(2 + e**2),
            lambda e: sympy.exp(-(e**2)),
            lambda e: (1 + e**2) ** sympy.Rational(-3, 2),
        ]
    )
    return st.one_of(
        st.tuples(unary, inner).map(lambda pair: pair[0](pair[1])),
        st.tuples(inner, inner).map(lambda pair: pair[0] + pair[1]),
        st.tuples(inner, inner).map(lambda pair: pair[0] * pair[1]),
    )


EXPRESSIONS = st.recursive(_leaf(), _grow, max_leaves=6)
RATIONALS = st.fractions(-3, 3, max_denominator=7)
SIDES = st.tuples(RATIONALS, RATIONALS).map(lambda ends: Interval(min(ends), max(ends)))


def _value(expression: sympy.Expr, point: dict[sympy.Symbol, Fraction]) -> sympy.Expr:
    return expression.subs({name: sympy.Rational(q.numerator, q.denominator) for name, q in point.items()}).evalf(40)


def _inside(side: Interval, weight: Fraction) -> Fraction:
    return side.lo + weight * (side.hi - side.lo)


@settings(max_examples=150, deadline=None)
@given(EXPRESSIONS, SIDES, SIDES, st.fractions(0, 1, max_denominator=9), st.fractions(0, 1, max_denominator=9))
def test_values_slopes_and_bounds_enclose(
    expression: sympy.Expr, first: Interval, second: Interval, s: Fraction, t: Fraction
) -> None:
    box = {x: first, y: second}
    point = {x: _inside(first, s), y: _inside(second, t)}
    program = compile_expression(expression, (x, y))
    value = to_interval(program([to_arb(point[x]), to_arb(point[y])]))
    true = _value(expression, point)
    slack = sympy.Rational(1, 10**25) * (1 + abs(true))
    assert sympy.Rational(str(value.lo)) - slack <= true <= sympy.Rational(str(value.hi)) + slack
    try:
        whole = program.enclose([first, second])
        bound = upper_bound(expression, box, max_boxes=50)
    except NonFiniteError:
        return
    assert whole.lo <= value.hi and value.lo <= whole.hi
    assert value.lo <= bound.value <= whole.hi + abs(whole.hi) / 2**60
    assert bound.attained <= bound.value


@settings(max_examples=60, deadline=None)
@given(EXPRESSIONS, RATIONALS, RATIONALS)
def test_slopes_enclose_the_derivative(expression: sympy.Expr, a: Fraction, b: Fraction) -> None:
    program = compile_expression(expression, (x, y))
    sides = [to_arb(a), to_arb(b)]
    _, slopes = program.ends_and_slopes([(side.lower(), side.upper()) for side in sides])
    for name, slope in zip((x, y), slopes, strict=True):
        derivative = sympy.diff(expression, name)
        if derivative.has(sympy.sign, sympy.Derivative) or slope is None:
            continue
        true = _value(derivative, {x: a, y: b})
        slack = sympy.Rational(1, 10**20) * (1 + abs(true))
        assert sympy.Rational(str(lower(slope[0]))) - slack <= true <= sympy.Rational(str(upper(slope[1]))) + slack


# suprema


def test_multi_affine_and_monotone_bounds_are_exact() -> None:
    third = sympy.Rational(1, 3)
    bound = upper_bound(x * y + third * x, {x: UNIT, y: interval("-1/7", "1/3")})
    assert bound.value == bound.attained == Fraction(2, 3)
    assert range_bound(sympy.Rational(5, 7), {}).interval == Interval(Fraction(5, 7), Fraction(5, 7))
    cubic = upper_bound(x**3 + x, {x: UNIT})
    assert cubic.value == cubic.attained == 2 and cubic.boxes == 1


def test_convex_expressions_are_decided_at_vertices() -> None:
    bound = upper_bound(x**2 + y**2 + x * y, {x: UNIT, y: UNIT})
    assert bound.value == bound.attained == 3
    assert bound.boxes < 20


def test_wide_boxes_scale() -> None:
    bound = upper_bound(x**2 - x, {x: HUGE})
    assert bound.value == 10**24 + 10**12
    peak = upper_bound(x / (1 + x**2), {x: HUGE})
    assert Fraction(1, 2) <= peak.value <= Fraction(51, 100)
    assert peak.attained <= Fraction(1, 2)


def test_a_supremum_of_zero_terminates() -> None:
    expression = -((x - sympy.Rational(1, 3)) ** 2)
    bound = upper_bound(expression, {x: UNIT})
    assert 0 <= bound.value < Fraction(1, 10**15)
    rough = upper_bound(expression, {x: UNIT}, atol=Fraction(1, 1000))
    assert 0 <= rough.value < Fraction(1, 1000)
    assert rough.boxes < 100


@pytest.mark.parametrize("expression", [x**2 + sympy.log(1 + sympy.exp(10 * x)), sympy.tanh(10 * x)])
def test_a_huge_first_enclosure_does_not_end_the_search(expression: sympy.Expr) -> None:
    bound = upper_bound(sympy.diff(expression, x, 2), {x: interval(-4, 4)})
    assert bound.attained <= bound.value <= bound.attained * Fraction(102, 100)


def test_the_point_where_the_best_value_is_attained_is_named() -> None:
    for expression in (x**2 - y, x / (2 + y**2), sympy.sin(x) * y, x * y):
        box = {x: interval("-1/3", "1/7"), y: interval("1/3", 3)}
        bound = upper_bound(expression, box)
        point = dict(bound.point)
        assert all(box[name].lo <= point[name] <= box[name].hi for name in box)
        assert bound.attained <= _value(expression, point) + sympy.Rational(1, 10**30)
    largest = magnitude_bound(x - y, {x: UNIT, y: interval(0, 3)})
    assert largest.value == 4
    assert dict(largest.point) == {x: Fraction(-1), y: Fraction(3)}


def test_known_minimum_of_the_six_hump_camel_function() -> None:
    camel = (4 - sympy.Rational(21, 10) * x**2 + x**4 / 3) * x**2 + x * y + (4 * y**2 - 4) * y**2
    bound = lower_bound(camel, {x: interval(-3, 3), y: interval(-2, 2)})
    assert bound.value <= Fraction("-1.0316284") <= bound.attained
    assert bound.attained - bound.value <= Fraction(2, 100)


def test_magnitude_takes_the_larger_side() -> None:
    assert magnitude_bound(x - 3, {x: UNIT}).value == 4
    assert magnitude_bound(x + 3, {x: UNIT}).value == 4
    bound = magnitude_bound(sympy.sin(x) * sympy.exp(y), {x: interval(-3, 0), y: UNIT})
    assert Fraction("2.718281828") <= bound.value <= Fraction("2.746")


def test_few_boxes_give_a_looser_but_sound_bound() -> None:
    wave = sympy.cos(7 * x) * sympy.cos(5 * y) - x * y
    box = {x: interval(-2, 2), y: interval(-2, 2)}
    rough = upper_bound(wave, box, max_boxes=1, rtol=Fraction(1, 1000))
    fine = upper_bound(wave, box, max_boxes=5000, rtol=Fraction(1, 1000))
    assert fine.attained <= fine.value < rough.value
    assert fine.value - fine.attained <= fine.value / 1000
    generator = random.Random(1)
    for _ in range(300):
        point = [Fraction(generator.randint(-2000, 2000), 1000) for _ in range(2)]
        assert lower(compile_expression(wave, (x, y))([to_arb(q) for q in point])) <= fine.value


@pytest.mark.parametrize("expression", [1 / x, sympy.log(x), sympy.sqrt(x), sympy.tan(2 * x), 1 / x**2])
def test_poles_and_undefined_values_have_no_bound(expression: sympy.Expr) -> None:
    with pytest.raises(NonFiniteError, match=r"no finite bound|unbounded or undefined"):
        upper_bound(expression, {x: UNIT}, max_boxes=200)


def test_away_from_the_pole_there_is_a_bound() -> None:
    assert upper_bound(1 / x, {x: interval("1/2", 1)}).value == 2
    assert upper_bound(sympy.log(x), {x: interval(1, 2)}).value >= Fraction("0.6931471")


def test_bad_requests_are_refused() -> None:
    with pytest.raises(ValueError, match="says nothing about y"):
        upper_bound(x * y, {x: UNIT})
    with pytest.raises(ValueError, match="max_boxes"):
        upper_bound(x, {x: UNIT}, max_boxes=0)
    with pytest.raises(ValueError, match="not a SymPy expression"):
        upper_bound(1.5, {x: UNIT})


@pytest.mark.parametrize("exponent", range(1, 8))
def test_powers_of_balls_around_zero_are_finite(exponent: int) -> None:
    """``p − 1/3`` at ``p = 1/3`` is a ball whose middle is exactly 0, of which python-flint's ``**`` makes NaN."""
    p = symbol("p")
    third = Interval(Fraction(1, 3), Fraction(4, 3))
    found = range_bound((p - sympy.Rational(1, 3)) ** exponent + 1, {p: third}).interval
    assert Fraction(99, 100) < found.lo <= 1 and 2 <= found.hi < Fraction(203, 100)
    ball = compile_expression((p - sympy.Rational(1, 3)) ** exponent, (p,))([to_arb(third.lo)])
    assert ball.contains(0) and upper(ball) < Fraction(1, 10**30)
