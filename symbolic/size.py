"""Upper bounds on what an expression costs to expand, known before it is built."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import comb, prod

MAX_EXPONENT = 64
MAX_ROOT = 64  # the denominator of an exponent
MAX_DEGREE = 256
MAX_TERMS = 50_000
MAX_BITS = 10_000
MAX_ROOT_BITS = 1_024  # SymPy looks for the square factors of a number under a root


@dataclass(frozen=True)
class Size:
    """Total degree, number of terms of the expansion, and bits of its coefficients; a call counts as a variable."""

    degree: int
    terms: int
    bits: int

    def excess(self) -> tuple[str, int] | None:
        """What is too large, and the bound that it passes; ``None`` if nothing is."""
        for value, bound, what in (
            (self.degree, MAX_DEGREE, "degree"),
            (self.terms, MAX_TERMS, "number of expanded terms"),
            (self.bits, MAX_BITS, "number of bits of the coefficients"),
        ):
            if value > bound:
                return what, bound
        return None


def size_of_sum(sizes: Iterable[Size]) -> Size:
    parts = list(sizes)
    return Size(max(p.degree for p in parts), sum(p.terms for p in parts), sum(p.bits for p in parts) + len(parts))


def size_of_product(sizes: Iterable[Size]) -> Size:
    parts = list(sizes)
    return Size(sum(p.degree for p in parts), prod(p.terms for p in parts), sum(p.bits for p in parts))


def size_of_power(base: Size, exponent: int) -> Size:
    """The size of ``base ** exponent`` for ``0 ≤ exponent ≤ MAX_EXPONENT``: a multinomial coefficient of terms.

    A coefficient of the expansion is at most ``terms ** exponent`` times a product of ``exponent`` coefficients.
    """
    growth = exponent * (base.terms.bit_length() if base.terms > 1 else 0)
    return Size(base.degree * exponent, comb(base.terms + exponent - 1, exponent), base.bits * exponent + growth)
