"""How an expression behaves on ``[R, ∞)``: rigorous range, limit or divergence (theory.md section 2, A1).

The expression is turned, innermost parts first, into an ``Expansion``. Bounded functions of arguments that do not
settle (``sin(s)``) become intervals; exponentials of polynomials become monomials; everything else is a Taylor series
with an enclosed remainder around its leading term.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import sympy
from flint import arb

from certify.bounds import intervals
from certify.bounds.balls import NonFiniteError, to_interval
from certify.bounds.derivatives import atan_derivative, log_derivative, sine_derivative
from certify.bounds.expansion import Expansion, TailUnknown
from certify.bounds.monomials import LOG, ONE, Monomial, S, TailTooShort
from symbolic.constants import as_fraction, enclose
from symbolic.plant import Interval

START = Fraction(4)
LATEST = Fraction(1 << 24)


@dataclass(frozen=True)
class Tail:
    """``f`` on ``[start, ∞)``: ``lower <= f <= upper`` (None: not bounded by this analysis).

    ``limit`` encloses every limit point as ``s → ∞`` (a point is the limit); ``diverges`` is ±1 when ``f → ±∞``,
    else 0.
    """

    start: Fraction
    lower: Fraction | None
    upper: Fraction | None
    limit: Interval | None
    diverges: int


def tail(expression: sympy.Expr, variable: sympy.Symbol, direction: int, start: Fraction = START) -> Tail:
    """The tail towards ``direction·∞``, from the first of ``start, 2 start, …`` on where everything is proved.

    With ``direction = −1`` it is the tail of ``f(−s)``. Raises TailUnknown with the obstacle.
    """
    toward = expression if direction > 0 else expression.xreplace({variable: -variable})
    while True:
        try:
            return _classified(_Expander(variable, start).expand(toward))
        except TailTooShort as obstacle:
            start *= 2
            if start > LATEST:
                raise TailUnknown(str(obstacle)) from obstacle
        except (NonFiniteError, ZeroDivisionError, ValueError) as obstacle:
            raise TailUnknown(str(obstacle)) from obstacle


def _classified(f: Expansion) -> Tail:
    _, constant, _ = f.split()
    found = f.range()
    if found is not None:
        return Tail(f.start, found.lo, found.hi, constant, 0)
    toward = intervals.sign(f.terms[0][1])
    if not toward:
        return Tail(f.start, None, None, None, 0)
    least = _least_magnitude(f)
    return Tail(f.start, least if toward > 0 else None, -least if toward < 0 else None, None, toward)


def _least_magnitude(f: Expansion) -> Fraction:
    """A lower bound of ``|c0 m0 (1 + u)|`` for a growing ``m0``. Raises TailTooShort until ``u > −1`` is seen."""
    monomial, leading, u = f.normalised()
    spread = u.range()
    if spread is None or spread.lo <= -1:
        raise TailTooShort("the leading term does not yet dominate")
    size = min(abs(leading.lo), abs(leading.hi))
    return size * (1 + min(spread.lo, Fraction(0))) / monomial.raised(Fraction(-1)).supremum(f.start)


@dataclass(frozen=True)
class _Expander:
    variable: sympy.Symbol
    start: Fraction

    def expand(self, node: sympy.Expr) -> Expansion:
        if node == self.variable:
            return Expansion.of([(S, intervals.ONE)], self.start)
        if not node.free_symbols:
            return self._constant(_constant(node))
        if self.variable not in node.free_symbols or len(node.free_symbols) > 1:
            raise TailUnknown(f"{node} depends on more than {self.variable}")
        if isinstance(node, sympy.Add):
            return Expansion.of([term for part in node.args for term in self.expand(part).terms], self.start)
        if isinstance(node, sympy.Mul):
            product = self._constant(intervals.ONE)
            for factor in node.args:
                product = product * self.expand(factor)
            return product
        if isinstance(node, sympy.Pow):
            return self._power(node.base, node.exp)
        rule = _RULES.get(type(node).__name__)
        if rule is None or len(node.args) != 1:
            raise TailUnknown(f"{type(node).__name__} is not one of the functions whose tail is known")
        return rule(self, self.expand(node.args[0]))

    def _constant(self, value: Interval) -> Expansion:
        return Expansion.constant(value, self.start)

    def _power(self, base: sympy.Expr, exponent: sympy.Expr) -> Expansion:
        if not isinstance(exponent, sympy.Rational):
            raise TailUnknown(f"the exponent {exponent} is not a rational number")
        return self.expand(base).raised(as_fraction(exponent))

    def exp(self, f: Expansion) -> Expansion:
        growing, constant, small = f.split()
        factor, monomial = intervals.increasing(arb.exp, constant), ONE
        for term, coefficient in growing.items():
            upper_end = coefficient.hi
            if not coefficient.is_point:
                if coefficient.hi > 0:
                    raise TailUnknown("the exponential of a term whose growth is not known exactly")
                factor = intervals.multiply(factor, Interval(Fraction(0), Fraction(1)))
            if term == LOG:
                monomial = monomial * Monomial(power=upper_end)
            elif term.is_power:
                monomial = monomial * Monomial(exponent=((term.power, upper_end),))
            elif upper_end < 0:
                factor = intervals.multiply(factor, Interval(Fraction(0), Fraction(1)))
            else:
                raise TailUnknown("the exponential of something that grows faster than every power")
        series = small.taylor(Fraction(0), lambda _, x: intervals.increasing(arb.exp, x))
        return series.scaled(factor, monomial)

    def log(self, f: Expansion) -> Expansion:
        monomial, coefficient, u = f.normalised()
        if coefficient.lo <= 0:
            raise TailUnknown("the logarithm of a negative number")
        if monomial.logs:
            raise TailUnknown("an iterated logarithm")
        terms = [(Monomial(power=k), intervals.point(c)) for k, c in monomial.exponent]
        terms.append((LOG, intervals.point(monomial.power)))
        terms.append((ONE, intervals.increasing(arb.log, coefficient)))
        return Expansion.of(terms, self.start) + u.taylor(Fraction(1), log_derivative)

    def sin(self, f: Expansion) -> Expansion:
        return self._oscillating(f, sine_derivative)

    def cos(self, f: Expansion) -> Expansion:
        return self._oscillating(f, lambda k, x: sine_derivative(k + 1, x))

    def _oscillating(self, f: Expansion, derivatives: Callable[[int, Interval], Interval]) -> Expansion:
        growing, constant, small = f.split()
        if growing:
            return self._constant(Interval(Fraction(-1), Fraction(1)))
        if constant.is_point:
            return small.taylor(constant.lo, derivatives)
        return self._constant(derivatives(0, _range_of(f)))

    def tan(self, f: Expansion) -> Expansion:
        return self.sin(f) * self.cos(f).raised(Fraction(-1))

    def tanh(self, f: Expansion) -> Expansion:
        growing, _, _ = f.split()
        if not growing:
            return self._constant(intervals.increasing(arb.tanh, _range_of(f)))
        toward = intervals.sign(f.dominant[1])
        decaying = self.exp(f.scaled(intervals.point(-2 * toward)))
        one = self._constant(intervals.ONE)
        ratio = decaying.scaled(intervals.point(-2)) * (one + decaying).raised(Fraction(-1))
        return (one + ratio).scaled(intervals.point(toward))

    def atan(self, f: Expansion) -> Expansion:
        growing, constant, small = f.split()
        if growing:
            toward = intervals.sign(f.dominant[1])
            right_angle = to_interval(arb.pi() / 2)
            rest = f.raised(Fraction(-1)).taylor(Fraction(0), atan_derivative).scaled(intervals.point(-1))
            return self._constant(intervals.multiply(right_angle, intervals.point(toward))) + rest
        if constant == intervals.ZERO:
            return small.taylor(Fraction(0), atan_derivative)
        return self._constant(intervals.increasing(arb.atan, _range_of(f)))

    def cosh(self, f: Expansion) -> Expansion:
        return self._hyperbolic(f, 1)

    def sinh(self, f: Expansion) -> Expansion:
        return self._hyperbolic(f, -1)

    def _hyperbolic(self, f: Expansion, sign: int) -> Expansion:
        other = self.exp(f.scaled(intervals.point(-1)))
        half = intervals.point(Fraction(1, 2))
        return self.exp(f).scaled(half) + other.scaled(intervals.point(Fraction(sign, 2)))

    def absolute(self, f: Expansion) -> Expansion:
        return f.scaled(intervals.point(intervals.sign(f.dominant[1])))


_RULES: dict[str, Callable[[_Expander, Expansion], Expansion]] = {
    "exp": _Expander.exp,
    "log": _Expander.log,
    "sin": _Expander.sin,
    "cos": _Expander.cos,
    "tan": _Expander.tan,
    "tanh": _Expander.tanh,
    "atan": _Expander.atan,
    "cosh": _Expander.cosh,
    "sinh": _Expander.sinh,
    "Abs": _Expander.absolute,
}


def _constant(node: sympy.Expr) -> Interval:
    if isinstance(node, sympy.Rational):
        return intervals.point(as_fraction(node))
    return to_interval(enclose(node))


def _range_of(f: Expansion) -> Interval:
    found = f.range()
    if found is None:
        raise TailUnknown("an argument that grows")
    return found
