"""Rational functions over Q in names and opaque atoms: what identities are decided in.

A value such as ``sin(w)`` becomes an *atom*, a new name that is known only by its derivative. An identity that holds
with atoms as free names holds; one that needs a law of sin is not decided. Hyperbolic functions are written with exp.
Denominators are kept as products of powers, so that sums find common denominators.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

from certify.checker import functions
from certify.checker.derivatives import slope
from certify.checker.expressions import Name, Node, evaluate, exact_call
from certify.checker.intervals import Interval, enclose
from certify.checker.verdict import Undecided, spend

Monomial = tuple[tuple[str, int], ...]  # (name, exponent > 0), sorted by name
UNIT: Monomial = ()
MAX_QUOTIENT = 500  # terms


class Polynomial:
    """A sparse polynomial; ``terms`` has no zero coefficients."""

    def __init__(self, terms: Mapping[Monomial, Fraction]) -> None:
        self.terms = {monomial: c for monomial, c in terms.items() if c}

    def __hash__(self) -> int:
        return hash(frozenset(self.terms.items()))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Polynomial) and self.terms == other.terms

    def __add__(self, other: Polynomial) -> Polynomial:
        spend(20 * (len(self.terms) + len(other.terms)))
        result = dict(self.terms)
        for monomial, c in other.terms.items():
            result[monomial] = result.get(monomial, Fraction(0)) + c
        return Polynomial(result)

    def __mul__(self, other: Polynomial) -> Polynomial:
        spend(len(self.terms) * len(other.terms) * (100 + self.bits() * other.bits() // 2048))
        result: dict[Monomial, Fraction] = {}
        for left, c in self.terms.items():
            for right, d in other.terms.items():
                monomial = _product(left, right)
                result[monomial] = result.get(monomial, Fraction(0)) + c * d
        return Polynomial(result)

    def __pow__(self, exponent: int) -> Polynomial:
        result = Polynomial({UNIT: Fraction(1)})
        for _ in range(exponent):
            result = result * self
        return result

    def scaled(self, factor: Fraction) -> Polynomial:
        return Polynomial({monomial: c * factor for monomial, c in self.terms.items()})

    def derivative(self, name: str) -> Polynomial:
        result = {}
        for monomial, c in self.terms.items():
            powers = dict(monomial)
            exponent = powers.pop(name, 0)
            if exponent > 1:
                powers[name] = exponent - 1
            if exponent:
                result[tuple(sorted(powers.items()))] = c * exponent
        return Polynomial(result)

    def quotient(self, divisor: Polynomial) -> Polynomial | None:
        """``self/divisor`` if that is a polynomial, by division in lexicographic order; None if not, or if long."""
        names = sorted(self.names() | divisor.names())

        def exponents(monomial: Monomial) -> tuple[int, ...]:
            powers = dict(monomial)
            return tuple(powers.get(name, 0) for name in names)

        rest = {exponents(m): c for m, c in self.terms.items()}
        found: dict[tuple[int, ...], Fraction] = {}
        by = {exponents(m): c for m, c in divisor.terms.items()}
        lead = max(by)
        for _ in range(MAX_QUOTIENT):
            if not rest:
                return Polynomial(
                    {tuple((n, e) for n, e in zip(names, m, strict=True) if e): c for m, c in found.items()}
                )
            top = max(rest)
            step = tuple(a - b for a, b in zip(top, lead, strict=True))
            if min(step, default=0) < 0:
                return None
            spend(100 * (len(rest) + len(by)))
            found[step] = factor = rest[top] / by[lead]
            for m, c in by.items():
                at = tuple(a + b for a, b in zip(step, m, strict=True))
                left = rest.pop(at, Fraction(0)) - factor * c
                if left:
                    rest[at] = left
        return None

    def bits(self) -> int:
        """Of the longest coefficient."""
        return max((c.numerator.bit_length() + c.denominator.bit_length() for c in self.terms.values()), default=0)

    def names(self) -> set[str]:
        return {name for monomial in self.terms for name, _ in monomial}

    def constant(self) -> Fraction | None:
        return None if self.terms.keys() - {UNIT} else self.terms.get(UNIT, Fraction(0))


def _product(left: Monomial, right: Monomial) -> Monomial:
    if not left or not right:
        return left or right
    powers = dict(left)
    for name, exponent in right:
        powers[name] = powers.get(name, 0) + exponent
    return tuple(sorted(powers.items()))


class Rational:
    """``top / Π factor^power``; the factors are not constant and their first coefficient is 1."""

    def __init__(self, top: Polynomial, bottom: Mapping[Polynomial, int]) -> None:
        self.top = top
        self.bottom = dict(bottom) if top.terms else {}

    @property
    def is_zero(self) -> bool:
        return not self.top.terms

    def constant(self) -> Fraction | None:
        """The value if the numerator is visibly constant and there is no denominator, else None."""
        return None if self.bottom else self.top.constant()

    def names(self) -> set[str]:
        return self.top.names().union(*(factor.names() for factor in self.bottom))

    def reduced(self) -> Rational:
        """Without the factors of the denominator that divide the numerator."""
        top, bottom = self.top, dict(self.bottom)
        for factor in self.bottom:
            while bottom[factor] and (quotient := top.quotient(factor)) is not None:
                top, bottom[factor] = quotient, bottom[factor] - 1
        return Rational(top, {factor: power for factor, power in bottom.items() if power})

    def over(self, bottom: Mapping[Polynomial, int]) -> Polynomial:
        """The numerator over a common denominator."""
        top = self.top
        for factor, power in bottom.items():
            top = top * factor ** (power - self.bottom.get(factor, 0))
        return top

    def partial(self, name: str) -> Rational:
        """The derivative with respect to one name, all others held fixed."""
        result = Rational(self.top.derivative(name), self.bottom)
        for factor, power in self.bottom.items():
            result = result + self * Rational(factor.derivative(name).scaled(Fraction(-power)), {factor: 1})
        return result

    def __neg__(self) -> Rational:
        return Rational(self.top.scaled(Fraction(-1)), self.bottom)

    def __add__(self, other: Rational) -> Rational:
        common = {f: max(self.bottom.get(f, 0), other.bottom.get(f, 0)) for f in (*self.bottom, *other.bottom)}
        return Rational(self.over(common) + other.over(common), common)

    def __sub__(self, other: Rational) -> Rational:
        return self + -other

    def __mul__(self, other: Rational) -> Rational:
        bottom = {f: self.bottom.get(f, 0) + other.bottom.get(f, 0) for f in (*self.bottom, *other.bottom)}
        return Rational(self.top * other.top, bottom)

    def __truediv__(self, other: Rational) -> Rational:
        if other.is_zero:
            raise Undecided("division by an expression that is identically zero")
        top = ONE.over(other.bottom)
        leading = other.top.terms[min(other.top.terms)]
        monic = other.top.scaled(1 / leading)
        bottom = {} if monic.constant() is not None else {monic: 1}
        return self * Rational(top.scaled(1 / leading), bottom)

    def __pow__(self, exponent: int) -> Rational:
        result = ONE
        for _ in range(abs(exponent)):
            result = result * self
        return ONE / result if exponent < 0 else result


def constant(value: Fraction) -> Rational:
    return Rational(Polynomial({UNIT: value}), {})


def variable(name: str) -> Rational:
    return Rational(Polynomial({((name, 1),): Fraction(1)}), {})


ZERO, ONE = constant(Fraction(0)), constant(Fraction(1))


class Algebra:
    """Turns expressions into rational functions, and remembers what its atoms stand for."""

    def __init__(self) -> None:
        self.atoms: dict[str, tuple[str, Rational]] = {}
        self._known: dict[object, Rational] = {}

    def read(self, node: Node, values: Mapping[str, Rational]) -> Rational:
        return evaluate(node, values, constant, self.call)

    def call(self, function: str, argument: Rational) -> Rational:
        value = argument.constant()
        exact = None if value is None else exact_call(function, value)
        if exact is not None:
            return constant(exact)
        if function in ("sinh", "cosh", "tanh"):
            e = self.call("exp", argument)
            up, down = e + ONE / e, e - ONE / e
            return down / up if function == "tanh" else (up if function == "cosh" else down) * constant(Fraction(1, 2))
        key = (function, argument.top, frozenset(argument.bottom.items()))
        if key not in self._known:
            name = f"{function}#{len(self.atoms)}"
            self.atoms[name] = (function, argument)
            self._known[key] = variable(name)
        return self._known[key]

    def leaves(self, value: Rational) -> set[str]:
        """The names that the value depends on, through its atoms too."""
        names = value.names()
        inner = [self.leaves(self.atoms[name][1]) for name in names & self.atoms.keys()]
        return (names - self.atoms.keys()).union(*inner)

    def vanishes(self, value: Rational) -> bool:
        """Whether the value is identically zero, by the laws of a field and ``√u·√u = u``."""
        for atom in sorted(value.names() & self.atoms.keys()):
            if self._is_squared(atom, value):
                return self.vanishes(self._without_square(atom, Rational(value.top, {})))
        return not value.top.terms

    def without_squares(self, value: Rational) -> Rational:
        """The same value with ``u`` for ``√u·√u`` in the numerator, where ``u`` is a polynomial: much cancels."""
        for atom in sorted(value.top.names() & self.atoms.keys()):
            if self._is_squared(atom, value) and not self.atoms[atom][1].bottom:
                return self.without_squares(self._without_square(atom, value))
        return value

    def _is_squared(self, atom: str, value: Rational) -> bool:
        is_root = self.atoms[atom][0] == "sqrt"
        return is_root and any(dict(monomial).get(atom, 0) > 1 for monomial in value.top.terms)

    def _without_square(self, atom: str, value: Rational) -> Rational:
        result, root, argument = ZERO, variable(atom), self.atoms[atom][1]
        for monomial, c in value.top.terms.items():
            power = dict(monomial).get(atom, 0)
            rest = Rational(Polynomial({tuple(pair for pair in monomial if pair[0] != atom): c}), {})
            result = result + rest * root ** (power % 2) * argument ** (power // 2)
        return result * Rational(ONE.top, value.bottom)

    def derivative(self, value: Rational, name: str) -> Rational:
        result = value.partial(name)
        for atom in sorted(value.names() & self.atoms.keys()):
            function, argument = self.atoms[atom]
            if name in self.leaves(argument):
                inner = self.read(slope(function, Name("u")), {"u": argument}) * self.derivative(argument, name)
                result = result + value.partial(atom) * inner
        return result

    def lie_derivative(self, value: Rational, field: Mapping[str, Rational]) -> Rational:
        """``Σ_k ∂value/∂name · field[name]``."""
        result = ZERO
        for name, speed in field.items():
            result = result + self.derivative(value, name) * speed
        return result

    def enclosure(
        self,
        value: Rational,
        box: Mapping[str, Any],
        number: Callable[[Any], Any] = enclose,
        call: Callable[[str, Any], Any] = functions.call,
    ) -> Any:
        """The range of the rational function on a box, in any enclosing scalars with ``+ * / **``."""
        known = dict(box)

        def at(name: str) -> Any:
            if name not in known:
                function, argument = self.atoms[name]
                square = _completed_square(argument, box)
                inner = self.enclosure(argument, box, number, call) if square is None else square
                known[name] = call(function, inner)
            return known[name]

        def polynomial(p: Polynomial) -> Any:
            spend(400 * len(p.terms))
            result = number(Fraction(0))
            for monomial, c in p.terms.items():
                term = number(c)
                for name, exponent in monomial:
                    term = term * at(name) ** exponent
                result = result + term
            return result

        result = polynomial(value.top)
        for factor, power in value.bottom.items():
            result = result / polynomial(factor) ** power
        return result


def _completed_square(value: Rational, box: Mapping[str, Any]) -> Interval | None:
    """The exact range of ``a s² + b s + c`` on an interval, as ``a (s + b/2a)² + c − b²/4a``; None for all else."""
    names = value.top.names()
    if value.bottom or len(names) != 1:
        return None
    (name,) = names
    x = box.get(name)
    a = value.top.terms.get(((name, 2),), Fraction(0))
    if not isinstance(x, Interval) or not a or any(exponent > 2 for m in value.top.terms for _, exponent in m):
        return None
    b, c = (value.top.terms.get(monomial, Fraction(0)) for monomial in (((name, 1),), UNIT))
    return a * (x + b / (2 * a)) ** 2 + (c - b * b / (4 * a))
