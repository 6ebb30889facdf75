"""The checker's arithmetic: every enclosure contains the exact value, and exact decisions are exact."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from itertools import product

import pytest
from flint import arb, ctx, fmpq
from hypothesis import given, settings
from hypothesis import strategies as st

from certify.checker import functions, linear, tails
from certify.checker.derivatives import gradient
from certify.checker.expressions import FUNCTIONS, Name, Node, Number, evaluate, parse
from certify.checker.intervals import Interval, between, enclose, hull, maximum, norm, quadratic_bound, symmetric
from certify.checker.polynomials import Algebra, constant, variable
from certify.checker.subdivision import supremum, value_range
from certify.checker.tails import Tail
from certify.checker.verdict import Malformed, Undecided, show, spend, start_meter

rationals = st.builds(
    lambda p, q, e: Fraction(p, q) * Fraction(10) ** e,
    st.integers(-(10**30), 10**30),
    st.integers(1, 10**30),
    st.integers(-70, 70),
)
pairs = st.tuples(rationals, rationals).map(sorted)
moderate = st.fractions(-50, 50, max_denominator=10**6)


def holds(x: Interval, value: Fraction) -> bool:
    return x.lo <= value <= x.hi


def exact_ball(value: Fraction) -> arb:
    return arb(fmpq(value.numerator, value.denominator))


def expression(text: str, *names: str) -> Node:
    return parse(text, {name: Name(name) for name in names})


@given(pairs, pairs)
def test_operations_contain_the_results_of_all_ends(x: list[Fraction], y: list[Fraction]) -> None:
    X, Y = between(*x), between(*y)
    for a, b in product(x, y):
        assert holds(X + Y, a + b)
        assert holds(X - Y, a - b)
        assert holds(X * Y, a * b)
        if not holds(Y, Fraction(0)):
            assert holds(X / Y, a / b)
        assert not X < Y or a < b
        assert not X <= Y or a <= b
    assert holds(hull(X, Y), max(x[1], y[1]))
    assert maximum(X, Y).lo >= max(x[1], y[1])


@given(rationals)
def test_points_keep_more_than_120_bits_at_any_scale(x: Fraction) -> None:
    X = enclose(x) * enclose(Fraction(1, 3)) * 3
    assert holds(X, x)
    assert X.hi - X.lo <= abs(x) / 2**120


@given(pairs, st.integers(-6, 6))
def test_powers_are_tight(x: list[Fraction], exponent: int) -> None:
    X = between(*x)
    if exponent < 0 and holds(X, Fraction(0)):
        with pytest.raises(Undecided, match="division by"):
            X**exponent
        return
    ends = [a**exponent for a in x]
    if exponent > 0 and exponent % 2 == 0 and x[0] <= 0 <= x[1]:
        ends.append(Fraction(0))
    found = X**exponent
    assert found.lo <= min(ends) and max(ends) <= found.hi
    assert exponent < 0 or found.hi - max(ends) <= max(abs(end) for end in ends) / 2**100


@given(rationals.map(abs))
def test_square_roots(x: Fraction) -> None:
    root = enclose(x).sqrt()
    assert root.lo**2 <= x <= root.hi**2
    assert root.hi - root.lo <= root.hi / 2**100


def test_a_negative_number_has_no_square_root() -> None:
    with pytest.raises(Undecided, match="square root"):
        between(-1, 4).sqrt()


def test_exponentials_far_out_are_enclosed() -> None:
    assert 0 < enclose(-3_000_000).exp().hi < Fraction(1, 10**1_000_000)
    assert enclose(-(10**30)).exp().lo == 0
    assert enclose(-(10**30)).exp() < Fraction(1, 10**1_000_000)
    assert (enclose(-(10**30)).exp() * 10**300) < Fraction(1, 10**1_000)
    with pytest.raises(Undecided, match="out of range"):
        enclose(10**30).exp()


@pytest.mark.parametrize("function", FUNCTIONS)
@given(x=moderate, width=st.fractions(0, 2, max_denominator=100))
@settings(max_examples=60)
def test_functions_contain_all_values(function: str, x: Fraction, width: Fraction) -> None:
    if function in ("log", "sqrt"):
        x = abs(x) + Fraction(1, 100)
    if function == "tan":
        x, width = x / 40, width / 10
    found = functions.call(function, between(x, x + width))
    with ctx.workprec(400):
        for a in (x, x + width / 3, x + width):
            value = getattr(exact_ball(a), function)()
            assert not (value < exact_ball(found.lo) or value > exact_ball(found.hi))


@pytest.mark.parametrize(("function", "x"), [("log", (0, 1)), ("sqrt", (-1, 1)), ("tan", (1, 2)), ("sqrt", (0, 1))])
def test_functions_are_refused_where_they_are_not_smooth(function: str, x: tuple[int, int]) -> None:
    with pytest.raises(Undecided, match=function):
        functions.call(function, between(*x))


GRADIENTS = [
    "x1*x2^3 - x2/(2 + x1^2)",
    "exp(x1)*sin(x2)",
    "sqrt(3 + x1*x2)",
    "tanh(x1) + atan(x2*x1)",
    "log(5 + x1)^2",
    "cosh(x1) - sinh(x2)",
    "tan(x1/4)*cos(x2)",
    "(x1 - x2)^-2 * 0 + x1",
    "1/(4 + x1)^2",
]


@pytest.mark.parametrize("text", GRADIENTS)
@given(x=st.tuples(*[st.fractions(Fraction(1, 10), 1, max_denominator=50)] * 2))
@settings(max_examples=20)
def test_gradients_contain_difference_quotients(text: str, x: tuple[Fraction, Fraction]) -> None:
    node, step = expression(text, "x1", "x2"), Fraction(1, 10**9)
    if text.startswith("(x1 - x2)") and abs(x[0] - x[1]) <= step:
        return
    values = {"x1": enclose(x[0]), "x2": enclose(x[1])}
    for name in values:
        moved = {**values, name: values[name] + step}
        low, high = (evaluate(node, box, enclose, functions.call) for box in (values, moved))
        box = {**values, name: hull(values[name], moved[name])}
        found, quotient = gradient(node, box, ["x1", "x2"])[name], (high - low) / step
        assert not (found < quotient or quotient < found)


def test_a_gradient_needs_every_part_to_be_smooth() -> None:
    node = expression("x1 + 0*log(v1)", "x1", "v1")
    with pytest.raises(Undecided, match=r"division|log"):
        gradient(node, {"x1": enclose(1), "v1": between(-1, 1)}, ["x1"])


@given(st.lists(moderate, min_size=3, max_size=3), st.lists(moderate.map(abs), min_size=3, max_size=3))
def test_quadratic_forms_are_bounded_on_boxes(centre: list[Fraction], radius: list[Fraction]) -> None:
    P = [
        [Fraction(2), Fraction(-1), Fraction(0)],
        [Fraction(-1), Fraction(2), Fraction(-1)],
        [Fraction(0), Fraction(-1), Fraction(2)],
    ]
    box = [between(c - r, c + r) for c, r in zip(centre, radius, strict=True)]
    bound = quadratic_bound(P, box).hi
    for signs in product((-1, 0, 1), repeat=3):
        x = [c + s * r for c, s, r in zip(centre, signs, radius, strict=True)]
        assert linear.dot(x, linear.apply(P, x)) <= bound
    many = [*box, *[symmetric(1)] * 9]
    wide = [[*row, *[Fraction(0)] * 9] for row in P] + [[Fraction(0)] * 12 for _ in range(9)]
    assert quadratic_bound(wide, many).hi >= bound - 1
    assert norm([]).is_zero


@pytest.mark.parametrize(
    ("matrix", "verdict"),
    [
        ([[2, 1], [1, 2]], "positive"),
        ([[1, 1], [1, 1]], "semidefinite"),
        ([[0, 0], [0, 1]], "semidefinite"),
        ([[0, 1], [1, 0]], "indefinite"),
        ([[0, 1], [1, 5]], "indefinite"),
        ([[1, 2], [2, 1]], "indefinite"),
        ([[0, 0, 0], [0, 1, 1], [0, 1, 1]], "semidefinite"),
        ([[1, 1, 0], [1, 1, 1], [0, 1, 1]], "indefinite"),
        ([], "positive"),
    ],
)
def test_definiteness_is_exact(matrix: list[list[int]], verdict: str) -> None:
    A = [[Fraction(entry, 7) for entry in row] for row in matrix]
    assert linear.definiteness(A) == verdict
    tiny = Fraction(1, 10**80)
    if verdict == "semidefinite":
        assert linear.definiteness(linear.combine(1, A, tiny, linear.identity(len(A)))) == "positive"
        assert linear.definiteness(linear.combine(1, A, -tiny, linear.identity(len(A)))) == "indefinite"


def test_an_asymmetric_matrix_is_not_definite() -> None:
    A = [[Fraction(2), Fraction(1)], [Fraction(0), Fraction(2)]]
    assert not linear.is_positive_definite(A) and not linear.is_nonnegative(A)
    assert not linear.is_positive_definite([[Fraction(1), Fraction(0)]])


def test_solutions_are_exact_and_singular_systems_are_refused() -> None:
    A = [[Fraction(0), Fraction(2)], [Fraction(3), Fraction(1, 7)]]
    assert linear.product(A, linear.inverse(A)) == linear.identity(2)
    with pytest.raises(Undecided, match="singular"):
        linear.inverse([[Fraction(1), Fraction(2)], [Fraction(2), Fraction(4)]])


def vanishes(text: str, *names: str) -> bool:
    algebra = Algebra()
    return algebra.vanishes(algebra.read(expression(text, *names), {name: variable(name) for name in names}))


@pytest.mark.parametrize(
    "text",
    [
        "(x + y)^2 - x^2 - 2*x*y - y^2",
        "1/x + 1/y - (x + y)/(x*y)",
        "x/(1 + x) + 1/(1 + x) - 1",
        "sin(0) + cos(0) - 1",
        "sqrt(4) - 2",
        "sqrt(2)*sqrt(2) - 2",
        "sqrt(x)^3 - x*sqrt(x)",
        "sin(x)*y - y*sin(x)",
        "tanh(x)*cosh(x) - sinh(x)",
        "cosh(x)^2 - sinh(x)^2 - 1",
        "(x^2 - y^2)/(x - y) - x - y",
        "exp(0*x) - 1",
    ],
)
def test_identities(text: str) -> None:
    assert vanishes(text, "x", "y")


@pytest.mark.parametrize(
    "text",
    [
        "(x + y)^2 - x^2 - y^2",
        "x/(1 + x)",
        "sqrt(2) - 141421356/100000000",
        "sin(x) - sin(y)",
        "1/x - 1/y",
        "sin(x)^2 + cos(x)^2 - 1",
    ],  # the last one is true, but not decided
)
def test_what_is_no_identity_is_not_taken_for_one(text: str) -> None:
    assert not vanishes(text, "x", "y")


def test_dividing_by_zero_identically_is_refused() -> None:
    with pytest.raises(Undecided, match="identically zero"):
        vanishes("1/(x - x)", "x")


@pytest.mark.parametrize(
    "text", ["x^3/(1 + x^2)", "exp(x*y)*x", "sin(x)^2", "sqrt(1 + x^2)", "tanh(x)/y", "atan(x) + log(2 + x)", "tan(x)"]
)
def test_symbolic_derivatives_agree_with_gradients(text: str) -> None:
    algebra, node = Algebra(), expression(text, "x", "y")
    derivative = algebra.derivative(algebra.read(node, {"x": variable("x"), "y": variable("y")}), "x")
    point = {"x": enclose(Fraction(1, 3)), "y": enclose(Fraction(5, 7))}
    one, other = algebra.enclosure(derivative, point), gradient(node, point, ["x"])["x"]
    assert not (one < other or other < one)
    assert one.hi - one.lo < Fraction(1, 10**30)


def test_denominators_that_vanish_on_the_box_are_refused() -> None:
    algebra = Algebra()
    value = constant(Fraction(1)) / variable("x")
    with pytest.raises(Undecided, match="division"):
        algebra.enclosure(value, {"x": between(-1, 1)})


def test_subdivision_sharpens_what_depends_on_itself() -> None:
    def function(box: Mapping[str, Interval]) -> Interval:
        return box["x"] / (1 + box["x"] ** 2).sqrt()

    box = {"x": between(-16, 16)}
    assert function(box).hi == 16
    assert supremum(function, box, ["x"]) < Fraction(11, 10)
    found = value_range(lambda piece: piece["x"] * (1 - piece["x"]), {"x": between(0, 1)}, ["x"], cuts=300)
    assert found.lo <= 0 and Fraction(1, 4) <= found.hi < Fraction(26, 100)


def test_subdivision_finds_its_way_around_what_is_not_defined() -> None:
    found = supremum(lambda box: 1 / (box["x"] - box["x"] ** 2 / 8), {"x": between(1, 3)}, ["x"])
    assert Fraction(8, 7) <= found < Fraction(5, 4)
    with pytest.raises(Undecided, match="division"):
        supremum(lambda box: 1 / box["x"], {"x": between(-1, 3)}, ["x"])


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [
        ("1/(1 + s^2)", 0, Fraction(1, 255)),
        ("exp(s)/(1 + exp(s))^2", 0, Fraction(1, 10**6)),
        ("sin(s^2)", -1, 1),
        ("sqrt(1 + s^2)/s", 1, Fraction(1002, 1000)),
        ("atan(s)", Fraction(15, 10), 2),
        ("log(s)/s", 0, Fraction(18, 100)),
        ("s^2*exp(1 - s)", 0, Fraction(1, 1000)),
        ("exp(0 - s^2)", 0, Fraction(1, 10**6)),
        ("log(2 + 1/s)", 0, 1),
        ("log(3*exp(s))/s", 1, Fraction(11, 10)),
        ("1/log(s)", 0, Fraction(37, 100)),
        ("log(2 + s^2)/log(s)", 2, Fraction(201, 100)),
        ("log(s)^2/s", 0, Fraction(49, 100)),
        ("sqrt(log(s))/log(1 + s)", 0, Fraction(61, 100)),
        ("log(s*log(s))/log(s)", 1, Fraction(14, 10)),
        ("log(exp(2*s)*log(s))/s", 2, Fraction(22, 10)),
        ("s^2*log(s)*exp(-s)", 0, Fraction(1, 10000)),
    ],
)
def test_half_lines(text: str, low: Fraction, high: Fraction) -> None:
    s = Tail.variable(16, 1)
    found = evaluate(expression(text, "s"), {"s": s}, s.scalar, tails.call).range()
    assert low <= found.lo and found.hi <= high
    for point in (16, 20, 1000):
        value = evaluate(expression(text, "s"), {"s": enclose(point)}, enclose, functions.call)
        assert found.lo <= value.hi and value.lo <= found.hi


@pytest.mark.parametrize(
    "text",
    [
        "s",
        "exp(s)/s",
        "exp(s^2)",
        "log(s)",
        "s*sin(s)",
        "tan(s)",
        "sqrt(sqrt(s))/s",
        "1/sin(s)",
        "log(log(s))",
        "s/log(s)",
    ],
)
def test_what_may_grow_on_a_half_line_is_refused(text: str) -> None:
    s = Tail.variable(16, 1)
    with pytest.raises(Undecided):
        evaluate(expression(text, "s"), {"s": s}, s.scalar, tails.call).range()


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1/3 - 2", Fraction(-5, 3)),
        ("-2^2", Fraction(-4)),
        ("2^3^2", Fraction(512)),
        ("2**-1", Fraction(1, 2)),
        ("0.1 + 1e-1", Fraction(1, 5)),
        ("6/3*2", Fraction(4)),
        ("--1", Fraction(1)),
        ("sqrt(9/4)", Fraction(3, 2)),
        (".5", Fraction(1, 2)),
        ("5.", Fraction(5)),
        (" ( 1 ) ", Fraction(1)),
        ("1-1-1", Fraction(-1)),
        ("8/2/2", Fraction(2)),
    ],
)
def test_constants_are_folded_exactly(text: str, value: Fraction) -> None:
    assert parse(text, {}) == Number(value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "is needed"),
        ("1 +", "is needed"),
        ("(1", "'\\)'"),
        ("1)", "an operator"),
        ("2 x", "an operator"),
        ("__import__('os')", "unexpected character"),
        ("y", "not known"),
        ("sin", "an argument"),
        ("sin x", "an argument"),
        ("exec(1)", "not known"),
        ("x^x", "exponent"),
        ("x^65", "exponent"),
        ("1/0", "division by zero"),
        ("0^0", "power 0"),
        ("9^64^2", "exponent"),
        ("(((9^60)^60)^60)^60", "too large"),
        ("1e999", "too many digits"),
        ("x;x", "unexpected character"),
        ("x.real", "unexpected character"),
        ("1" * 2000, "too many digits"),
        ("(" * 30 + "1" + ")" * 30, "nested"),
        ("-" * 30 + "1", "nested"),
        ("+".join(["x"] * 1500), "too many parts"),
        ("x" * 20_000, "too long"),
        ("1..2", "needed"),
        ("lambda: 1", "unexpected character"),
        ("\u0661", "unexpected character"),
        ("0 - 0/(1 - 1)", "division by zero"),
        ("x == x", "unexpected character"),
    ],
)
def test_what_is_no_expression_is_refused(text: str, reason: str) -> None:
    with pytest.raises(Malformed, match=reason):
        parse(text, {"x": Name("x")})


def test_shared_constants_do_not_multiply_without_bound() -> None:
    node: Node = parse("sqrt(2)", {})
    with pytest.raises(Malformed, match="too many parts"):
        for _ in range(40):
            node = parse("c*c + c", {"c": node})


def test_the_meter_stops_a_check() -> None:
    start_meter(100)
    spend(100)
    with pytest.raises(Undecided, match="more work"):
        spend(1)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Fraction(1, 3), "1/3"),
        (Fraction(10**40), "1e+40"),
        (Fraction(-1, 3 * 10**50), "-3.33333e-51"),
        ([Fraction(1), Fraction(2)], "[1, 2]"),
        (Fraction(2) ** 10**6, "about 1e+301030"),
        (Fraction(999_999_999_999, 10**40), "1e-28"),
    ],
)
def test_numbers_are_shown_short(value: object, text: str) -> None:
    assert show(value) == text


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("p*x*x/4", "p*x^2/4"),
        ("(p*x)*x", "p*x^2"),
        ("x/p/p", "x/p^2"),
        ("(x/p)*(x/p)", "x^2/p^2"),
        ("2*2*x*x^3", "2*2*x^4"),
    ],
)
def test_equal_factors_are_one_power(text: str, same: str) -> None:
    """As the search reads them: ``p·(x·x)`` in two steps is enclosed more widely than ``p·x²``."""
    assert expression(text, "x", "p") == expression(same, "x", "p")


def test_factors_and_divisors_are_not_set_off_against_each_other() -> None:
    for text in ("x^2/x", "x*x^-1", "p*x/(p*x)"):
        with pytest.raises(Undecided):
            evaluate(expression(text, "x", "p"), {"x": between(-1, 1), "p": between(-1, 1)}, enclose, functions.call)


def test_a_factor_that_divides_is_taken_out_of_a_fraction() -> None:
    """``L_S (tanh(p s) + v1) = v2``: without it ``(e² + 1)/(e² + 1)·v2`` is enclosed as something around ``v2``."""
    algebra = Algebra()
    names = {name: variable(name) for name in ("s", "p", "v")}
    u = algebra.read(expression("tanh(p*s) + v*(p^2 + 1)/(p^2 + 1)", *names), names)
    slope = algebra.derivative(u, "v").reduced()
    assert slope.constant() == 1
    partly = algebra.read(expression("(p^2 - s^2)/(p - s)^2", *names), names).reduced()
    assert algebra.vanishes(partly - algebra.read(expression("(p + s)/(p - s)", *names), names))
    assert sum(partly.bottom.values()) == 1
    none = algebra.read(expression("(p^2 + s^2)/(p - s)", *names), names)
    assert none.reduced().bottom == none.bottom
