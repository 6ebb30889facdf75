"""The expression language: what it means, what it refuses and where it says so, and that its cost is bounded."""

from __future__ import annotations

import cmath
import operator as op
from collections.abc import Callable
from fractions import Fraction

import pytest
import sympy
from counted import at_most
from hypothesis import given
from hypothesis import strategies as st

from symbolic.errors import InputError, Where
from symbolic.expressions import parse_constant, parse_expression, parse_number
from symbolic.grammar import FUNCTIONS, MAX_DEPTH, MAX_LENGTH, MAX_NODES
from symbolic.messages import Reason
from symbolic.plant import symbol

WHERE = Where("plant.toml").at("agent").at(1).at("f")
X, Y = symbol("x1"), symbol("x2")


def read(text: str) -> sympy.Expr:
    return parse_expression(text, {"x1", "x2"}, where=WHERE)


def refusal(text: str) -> str:
    with pytest.raises(InputError) as caught:
        read(text)
    message = str(caught.value)
    assert message.isprintable()
    prefix = "plant.toml: agent[1].f: column "
    assert message.startswith(prefix)
    return message.removeprefix(prefix)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x1 + 2*x2 - 3", X + 2 * Y - 3),
        ("-x1**2", -(X**2)),
        ("(-x1)**2", X**2),
        ("2^3^2", 512),
        ("2**-1", sympy.Rational(1, 2)),
        ("-2^-2", sympy.Rational(-1, 4)),
        ("x1^-1^2", 1 / X),
        ("2 - 3 - 4", -5),
        ("24/2/3", 4),
        ("2*-x1", -2 * X),
        ("x1 - -x1", 2 * X),
        ("+x1", X),
        ("x1/x2*x2", X),
        ("\tx1\n*\r x2 ", X * Y),
        ("x1^(1+1)", X**2),
        ("x1^(4/2)", X**2),
        ("x1^0", 1),
        ("x1/(1 + x1^2)^2", X / (1 + X**2) ** 2),
        ("log(1 + exp(x1))", sympy.log(1 + sympy.exp(X))),
        ("sqrt(8)", 2 * sympy.sqrt(2)),
        ("0*x1", 0),
    ],
)
def test_means_what_it_says(text: str, expected: sympy.Expr) -> None:
    assert read(text) == expected


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_is_the_one_of_its_name(name: str) -> None:
    assert read(f"{name}(x1 + 2)") == getattr(sympy, name)(X + 2)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.1", Fraction(1, 10)),
        ("1e-3", Fraction(1, 1000)),
        (".5", Fraction(1, 2)),
        ("5.", Fraction(5)),
        ("1.25E+2", Fraction(125)),
        ("0.1 + 0.2", Fraction(3, 10)),
        ("1/3", Fraction(1, 3)),
        ("sqrt(9/4)", Fraction(3, 2)),
        ("sqrt(4)^2", Fraction(4)),
        ("(8/27)^(-2/3)", Fraction(9, 4)),
        ("0^(1/3)", Fraction(0)),
        ("123456789012345678901234567890", Fraction(123456789012345678901234567890)),
    ],
)
def test_numbers_are_exact(text: str, value: Fraction) -> None:
    assert parse_number(text, {}, where=WHERE) == value


@given(st.decimals(allow_nan=False, allow_infinity=False, min_value=0, max_value=10**20, places=12))
def test_a_decimal_is_the_fraction_it_denotes(number: object) -> None:
    assert parse_number(str(number), {}, where=WHERE) == Fraction(str(number))


def test_symbols_are_real_and_the_projects_own() -> None:
    assert read("x1").free_symbols == {symbol("x1")}


def test_names_may_stand_for_exact_constants() -> None:
    names = {"a": sympy.sqrt(3), "half": sympy.Rational(1, 2), "x1": X}
    assert parse_expression("a^2*half*x1", names, where=WHERE) == sympy.Rational(3, 2) * X


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "1: expected a number, a name or '(', found the end"),
        ("x1 +", "5: expected a number, a name or '(', found the end"),
        ("x1 * / x2", "6: expected a number, a name or '(', found '/'"),
        ("2x1", "2: expected an operator, found 'x1'"),
        ("x1 x2", "4: expected an operator, found 'x2'"),
        ("1.2.3", "4: expected an operator, found '.3'"),
        ("(x1", "4: expected ')', found the end"),
        ("x1)", "3: expected an operator, found ')'"),
        ("sin x1", "1: the function sin needs an argument in parentheses"),
        ("sin()", "5: expected a number, a name or '(', found ')'"),
        ("sin(x1, x2)", "7: unexpected character ','"),
        ("x1(2)", "1: unknown function 'x1'; known: sin, cos"),
        ("gamma(x1)", "1: unknown function 'gamma'"),
        ("1 + xx1", "5: unknown name 'xx1'; did you mean 'x1'?"),
        ("1 + qqq", "5: unknown name 'qqq'; known here: x1, x2"),
        ("x1 == 2", "4: unexpected character '='"),
        ("x1; x2", "3: unexpected character ';'"),
        ("x1**x2", "5: an exponent must be a rational constant such as 2 or 1/3 (a^p with another p is exp(p*log(a)))"),
        ("x1^pi", "4: an exponent must be a rational constant"),
        ("x1^(1/65)", "5: the denominator of an exponent must be at most 64"),
        ("(0-8)^(1/3)", "6: the constant is not a finite real number"),
        ("0^(-1/3)", "2: division by zero"),
        ("(x1^2)^(1/2)", "7: a power with this base becomes Abs"),
        ("x1^65", "4: an exponent must lie between -64 and 64"),
        ("x1^-65", "4: an exponent must lie between -64 and 64"),
        ("x1/0", "4: division by zero"),
        ("x1/(2 - 2)", "5: division by zero"),
        ("x1/(x2 - x2)", "5: division by zero"),
        ("0^-1", "2: division by zero"),
        ("0^0", "2: 0 to the power 0"),
        ("1/(sin(1)^2 + cos(1)^2 - 1)", "4: division by a constant that is not shown to be nonzero"),
        ("log(0)", "1: log of this argument is not a finite real number"),
        ("1 + log(-2)", "5: log of this argument is not a finite real number"),
        ("sqrt(-1)", "1: sqrt of this argument is not a finite real number"),
        ("sqrt(-x1^2)", "1: sqrt of this argument is not a finite real number"),
        ("tan(2*atan(1))", "1: tan of this argument is not a finite real number"),
        ("log(sin(1)^2 + cos(1)^2 - 1)", "1: the constant is not a finite real number"),
        ("exp(exp(exp(10)))", "5: the constant is not a finite real number of reasonable size"),
        ("sqrt(x1^2)", "1: sqrt of this argument becomes Abs, not a smooth function of the language"),
    ],
)
def test_refused_with_a_reason_and_its_column(text: str, message: str) -> None:
    assert refusal(text).startswith(message)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "__import__('os').system('true')",
        "().__class__",
        "x1.__class__",
        "x1.diff()",
        "x1.real",
        "lambda: 0",
        "[x1 for x1 in x2]",
        "x1 if x2 else 0",
        "eval(x1)",
        "exec(x1)",
        "open(x1)",
        "x1 := 2",
        "x1 and x2",
        "f'{x1}'",
        "'x1'",
        '"x1"',
        "`x1`",
        "x1 @ x2",
        "x1 // x2",
        "x1 % x2",
        "~x1",
        "x1 << 2",
        "x1 | x2",
        "x1!",
        "{x1}",
        "x1[0]",
        "x1\\",
        "x1 # 2",
        "$x1",
        "\x00",
        "x1\x00",
        "x1\u00a0+ x2",
        "x1 \u2212 x2",
        "\u0445" + "1",
        "x\u0661",
        "\uff11",
        "x\uff11",
        "\u0967",
        "\u00b2",
        "x1\u00b2",
        "\u212f",
        "\u200bx1",
        "x1\u202e",
        "\U0001d465",
        "_x1",
        "x1_",
        "x11",
        "Pi",
        "E",
        "I",
        "oo",
        "nan",
        "zoo",
        "inf",
        "0x10",
        "1_000",
        "1j",
        "True",
        "None",
        "Symbol(x1)",
        "S",
        "Integer(1)",
        "sin(sin)",
    ],
)
def test_nothing_but_the_language_gets_through(text: str) -> None:
    refusal(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("((9**64)**64)**64", "coefficients may pass"),
        ("2**-(10**9)", "an exponent must lie between"),
        ("2**10**9", "an exponent must lie between"),
        ("10**10**10**10", "an exponent must lie between"),
        ("(" * 400 + "x1" + ")" * 400, "nested deeper"),
        ("-" * 400 + "x1", "nested deeper"),
        ("x1" + "^1" * 400, "nested deeper"),
        ("sin(" * 400 + "x1" + ")" * 400, "nested deeper"),
        ("(((x1 + 1)**64)**64)**64", "degree may pass"),
        ("(x1 + 1)**64*(x2 + 1)**64*(x1 + x2 + 1)**64*(x1 - x2)**65", "an exponent must lie between"),
        ("(x1 + x2 + 1 + x1*x2 + x1^3)**60", "expanded terms may pass"),
        ("*".join(["(x1 + 1)"] * 17), "expanded terms may pass"),
        ("*".join(["x1"] * 300), "degree may pass"),
        ("exp(1000000000*log(2))", "log inside exp"),
        ("exp(1000000000*log(x1))", "log inside exp"),
        ("9" * 1001, "digits, more than 1000"),
        ("1e401", "the number's exponent is beyond 300"),
        ("1e-999999999999999999999", "the number's exponent is beyond 300"),
        ("x1*(" + "9" * 900 + ")^8", "coefficients may pass"),
        ("sqrt(" + "7" * 400 + ")", "sqrt of a number with more than 1024 bits"),
        ("+".join(["1"] * (MAX_NODES + 1)), "more than 2000 operands"),
        ("x1" + " " * MAX_LENGTH, "characters, more than 10000"),
        ("x1+" * 10**6 + "x1", "characters, more than 10000"),
    ],
)
def test_cost_is_bounded_before_anything_is_computed(text: str, message: str) -> None:
    with at_most(400_000):
        assert message in refusal(text)


@pytest.mark.parametrize(
    "text",
    [
        "(" * MAX_DEPTH + "x1" + ")" * MAX_DEPTH,
        "(x1 + 1)**64",
        "x1^64*x2^64",
        "9" * 1000,
        "1e300",
        "1e-300",
        "+".join(["x1"] * (MAX_NODES // 2)),
        "(1 + sqrt(2))**64",
        "sin(" * MAX_DEPTH + "x1" + ")" * MAX_DEPTH,
        "sqrt(1 + " * MAX_DEPTH + "x1" + ")" * MAX_DEPTH,
        "exp(-1000)",
        "cos(1e300)",
    ],
)
def test_what_lies_just_inside_the_bounds_is_read(text: str) -> None:
    with at_most(2_500_000):
        read(text)


def test_a_bound_on_constants_holds_for_the_constants_that_names_stand_for() -> None:
    big = parse_constant("9" * 1000, {}, where=WHERE)
    with pytest.raises(InputError, match=r"column 2: .* coefficients may pass"):
        parse_expression("c^8*x1", {"c": big, "x1": X}, where=WHERE)


def test_a_name_known_elsewhere_is_refused_with_the_reason_given() -> None:
    with pytest.raises(InputError, match=r"^plant\.toml: agent\[1\]\.f: column 5: only x1 here$"):
        parse_expression("1 + x2", {"x1": X}, where=WHERE, refused={"x2": Reason("only x1 here")}.get)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sqrt(2)/3", sympy.sqrt(2) / 3),
        ("4*atan(1)", sympy.pi),
        ("exp(1)", sympy.E),
        ("pi", sympy.pi),
        ("2^(1/3)", 2 ** sympy.Rational(1, 3)),
    ],
)
def test_constants_may_be_irrational(text: str, expected: sympy.Expr) -> None:
    assert parse_constant(text, {}, where=WHERE) == expected


@pytest.mark.parametrize(
    ("text", "value"), [("sqrt(2)^2", "2"), ("log(2) - log(2)", "0"), ("cos(pi/3)", "1/2"), ("pi/pi", "1")]
)
def test_a_rational_constant_is_written_as_one(text: str, value: str) -> None:
    """What SymPy alone knows to be rational would be read differently by a reader that knows less."""
    with pytest.raises(InputError, match=f"is the number {value}; write it like that"):
        parse_constant(text, {}, where=WHERE)


def test_a_constant_depends_on_no_symbol() -> None:
    with pytest.raises(ValueError, match="a name in it stands for a symbol: x1"):
        parse_constant("x1 + 1", {"x1": X}, where=WHERE)


@pytest.mark.parametrize("text", ["sqrt(2)", "exp(1)", "atan(1)*4", "sin(1)^2 + cos(1)^2"])
def test_a_number_is_rational(text: str) -> None:
    with pytest.raises(InputError, match=r"^plant\.toml: agent\[1\]\.f: a rational number is needed"):
        parse_number(text, {}, where=WHERE)


# A sentence beside its value in Python's complex arithmetic at one point; None where that has no reliable value.
POINT = {"x1": 0.7368062997280773, "x2": -0.41421356, "c": 2**0.5}
Sentence = tuple[str, complex | None]


def valued(text: str, compute: Callable[..., complex], *parts: Sentence) -> Sentence:
    values = [value for _, value in parts if value is not None]
    if len(values) < len(parts):
        return text, None
    try:
        value = compute(*values)
    except (ArithmeticError, ValueError):
        return text, None
    return text, value if cmath.isfinite(value) and abs(value) < 1e6 else None


def binary(left: Sentence, operator: str, right: Sentence) -> Sentence:
    compute = {"+": op.add, "-": op.sub, "*": op.mul, "/": op.truediv}[operator]
    return valued(f"({left[0]}) {operator} ({right[0]})", compute, left, right)


leaves = st.sampled_from(
    [
        ("x1", POINT["x1"]),
        ("x2", POINT["x2"]),
        ("c", POINT["c"]),
        ("0", 0),
        ("1", 1),
        ("2", 2),
        ("3/7", 3 / 7),
        ("0.5", 0.5),
    ]
)
sentences = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.builds(binary, inner, st.sampled_from("+-*/"), inner),
        st.builds(lambda base, n: valued(f"({base[0]})^{n}", lambda value: value**n, base), inner, st.integers(-3, 4)),
        inner.map(lambda base: valued(f"-{base[0]}" if " " not in base[0] else f"-({base[0]})", op.neg, base)),
        st.builds(
            lambda f, base: valued(f"{f}({base[0]})", getattr(cmath, f), base), st.sampled_from(FUNCTIONS), inner
        ),
    ),
    max_leaves=12,
)


@given(sentences)
def test_any_sentence_has_the_value_of_ordinary_arithmetic_or_is_refused_in_one_line(sentence: Sentence) -> None:
    text, expected = sentence
    try:
        expr = parse_expression(text, {"x1": X, "x2": Y, "c": sympy.sqrt(2)}, where=WHERE)
    except InputError as error:
        assert str(error).isprintable()
        return
    assert expr.free_symbols <= {X, Y}
    allowed = (
        sympy.Symbol,
        sympy.Rational,
        sympy.Add,
        sympy.Mul,
        sympy.Pow,
        type(sympy.pi),
        type(sympy.E),
        *(getattr(sympy, name) for name in FUNCTIONS if name != "sqrt"),
    )
    assert all(isinstance(node, allowed) for node in sympy.preorder_traversal(expr))
    if expected is not None:
        got = complex(expr.evalf(30, subs={X: sympy.Float(POINT["x1"], 30), Y: sympy.Float(POINT["x2"], 30)}))
        assert got == pytest.approx(expected, rel=1e-6, abs=1e-6)


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    try:
        read(text)
    except InputError as error:
        assert str(error).isprintable()
