"""How finely the coordinator's grid is made; each route names the one that it needs."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple


class Resolution(NamedTuple):
    """Of the grid: its largest step times the fastest rate, and its length in time constants of the mixing layer."""

    step: Fraction
    lifetimes: int


FINE = Resolution(Fraction(2, 3), 14)
COARSE = Resolution(Fraction(13, 4), 8)  # for means over all time, not for peaks
