"""Which constants are rational by the arithmetic of fractions alone: the part of the language that both readers fold.

SymPy knows more (``sqrt(2)^2 = 2``, ``cos(pi/3) = 1/2``), but what a plant file says must not depend on how much a
reader knows. So a number that has to be rational is one that is folded here, or the file is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from symbolic.grammar import Call, Name, Negative, Node, Number, Power, Product, Sum
from symbolic.size import MAX_BITS, MAX_EXPONENT, MAX_ROOT


def folded(node: Node, constants: Mapping[str, Fraction]) -> Fraction | None:
    """The value of a tree whose names are rational constants; ``None`` where fractions do not show one."""
    match node:
        case Number(value):
            return value
        case Name(name):
            return constants.get(name)
        case Negative(argument):
            inner = folded(argument, constants)
            return None if inner is None else -inner
        case Sum(terms):
            parts = [folded(term, constants) for term in terms]
            known = [part for part in parts if part is not None]
            return sum(known, Fraction(0)) if len(known) == len(parts) else None
        case Product(factors):
            result = Fraction(1)
            for factor, divides in factors:
                part = folded(factor, constants)
                if part is None or (divides and part == 0):
                    return None
                result = result / part if divides else result * part
            return result
        case Power(base, exponent):
            return _power(folded(base, constants), folded(exponent, constants))
        case Call(function, argument):
            inner = folded(argument, constants)
            return None if inner is None else _called(function, inner)


def _power(base: Fraction | None, exponent: Fraction | None) -> Fraction | None:
    if base is None or exponent is None or abs(exponent) > MAX_EXPONENT or exponent.denominator > MAX_ROOT:
        return None
    root = exact_root(base, exponent.denominator)
    if root is None or (root == 0 and exponent <= 0):
        return None
    bits = root.numerator.bit_length() + root.denominator.bit_length()
    return root**exponent.numerator if bits * abs(exponent.numerator) <= MAX_BITS else None


def _called(function: str, argument: Fraction) -> Fraction | None:
    if function == "sqrt":
        return exact_root(argument, 2)
    if function == "log":
        return Fraction(0) if argument == 1 else None
    if argument == 0:
        return Fraction(1) if function in ("cos", "exp", "cosh") else Fraction(0)
    return None


def exact_root(value: Fraction, q: int) -> Fraction | None:
    """The ``q``-th root if it is rational; of a negative number none but the first is."""
    if q == 1:
        return value
    if value < 0:
        return None
    p, r = integer_root(value.numerator, q), integer_root(value.denominator, q)
    return Fraction(p, r) if p**q == value.numerator and r**q == value.denominator else None


def integer_root(n: int, q: int) -> int:
    """The largest ``k`` with ``k^q ≤ n``, by bisection."""
    low, high = 0, 1 << (n.bit_length() // q + 1)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if middle**q <= n else (low, middle)
    return low
