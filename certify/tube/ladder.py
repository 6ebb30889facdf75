"""Gains that are tried, evenly in ratio and without an end: the same in every octave, so that a power of two in the
units leaves the ladder as it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class Ladder:
    """The rungs ``mantissa · 2^k``; ``mantissas`` grow from 1 to below 2."""

    mantissas: tuple[Fraction, ...]

    def rung(self, index: int) -> Fraction:
        octave, place = divmod(index, len(self.mantissas))
        return self.mantissas[place] * Fraction(2) ** octave

    def index(self, value: Fraction) -> int:
        """The place of ``value > 0``, or of the next rung above."""
        octave = value.numerator.bit_length() - value.denominator.bit_length() - 1
        index = octave * len(self.mantissas)
        while self.rung(index) < value:
            index += 1
        return index

    def between(self, low: Fraction, high: Fraction) -> Iterator[Fraction]:
        """The rungs in ``[low, high]``, upwards."""
        index = self.index(low)
        while self.rung(index) <= high:
            yield self.rung(index)
            index += 1
