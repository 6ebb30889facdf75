"""Closed intervals with rational ends."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class Interval:
    """Closed interval with rational ends; a point has ``lo == hi``."""

    lo: Fraction
    hi: Fraction

    def __post_init__(self) -> None:
        if self.lo > self.hi:
            raise ValueError(f"the interval [{self.lo}, {self.hi}] is empty")

    @property
    def is_point(self) -> bool:
        return self.lo == self.hi

    @property
    def magnitude(self) -> Fraction:
        """The largest absolute value in the interval."""
        return max(abs(self.lo), abs(self.hi))
