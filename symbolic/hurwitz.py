"""Exact Hurwitz test of a real polynomial by its Hurwitz determinants."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class HurwitzTest:
    """``holds`` iff every root has a negative real part.

    ``determinants`` are the leading principal minors Δ_1, Δ_2, … of the Hurwitz matrix, up to the first that is not
    positive; ``index`` is the index of that one (from 1) and ``None`` if all are positive.
    """

    verdict: str
    determinants: tuple[Fraction, ...]
    index: int | None

    @property
    def reason(self) -> str:
        if self.index is None:
            return "all Hurwitz determinants are positive"
        return f"the Hurwitz determinant of order {self.index} is {self.determinants[-1]}, not positive"


def hurwitz_test(coefficients: Sequence[Fraction | int]) -> HurwitzTest:
    """Decides whether ``a_0 λⁿ + a_1 λ^(n−1) + … + a_n`` is Hurwitz; ``coefficients = (a_0, …, a_n)``, ``a_0 ≠ 0``.

    The polynomial is Hurwitz iff all n Hurwitz determinants of ±p are positive, the sign making ``a_0 > 0``.
    Raises ``ValueError`` if the leading coefficient is 0 or missing.
    """
    if not coefficients or coefficients[0] == 0:
        raise ValueError("a polynomial with a nonzero leading coefficient is needed")
    sign = 1 if coefficients[0] > 0 else -1
    a = [Fraction(sign * c) for c in coefficients]
    order = len(a) - 1
    matrix = [
        [a[2 * column - row + 1] if 0 <= 2 * column - row + 1 <= order else Fraction(0) for column in range(order)]
        for row in range(order)
    ]
    minors: list[Fraction] = []
    for minor in _leading_minors(matrix):
        minors.append(minor)
        if minor <= 0:
            return HurwitzTest("fails", tuple(minors), len(minors))
    return HurwitzTest("holds", tuple(minors), None)


def _leading_minors(matrix: list[list[Fraction]]) -> Iterator[Fraction]:
    """Leading principal minors by elimination without exchanges; to be left at the first that is not positive."""
    minor = Fraction(1)
    for k, pivot_row in enumerate(matrix):
        minor *= pivot_row[k]
        yield minor
        for row in matrix[k + 1 :]:
            factor = row[k] / pivot_row[k]
            if factor:
                row[k:] = [entry - factor * above for entry, above in zip(row[k:], pivot_row[k:], strict=True)]
