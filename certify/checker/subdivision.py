"""Sharper bounds over boxes: the piece with the worst bound is halved, in the direction where that helps most."""

from __future__ import annotations

from bisect import insort_left
from collections.abc import Callable, Collection, Mapping
from fractions import Fraction

from certify.checker.intervals import Interval, between
from certify.checker.verdict import Undecided

Box = Mapping[str, Interval]

CUTS = 100
PATIENCE = 12  # for halvings in a row that do not help
USELESS, UNDECIDED = 3, 1  # what one of them takes of it, where there is a bound and where there is none
USEFUL = Fraction(999, 1000)


def supremum(function: Callable[[Box], Interval], box: Box, names: Collection[str], cuts: int = CUTS) -> Fraction:
    """A number that ``function`` does not exceed on the box, where it depends on the named variables.

    ``function`` encloses its values on any box, or raises ``Undecided``, which counts as no bound.
    """
    pieces = [_Piece(function, box, PATIENCE)]  # the worst bound comes last
    for _ in range(cuts):
        worst = pieces[-1]
        halves = worst.best_halves(names) if worst.patience > 0 else []
        if not halves:
            break
        pieces.pop()
        for half in halves:
            insort_left(pieces, half, key=_Piece.order)
    worst = pieces[-1]
    if worst.bound is None:
        raise Undecided(worst.reason)
    return worst.bound


def value_range(function: Callable[[Box], Interval], box: Box, names: Collection[str], cuts: int = CUTS) -> Interval:
    """An enclosure of the function's values on the box."""
    known: dict[tuple[tuple[int, int, int], ...], Interval] = {}

    def once(piece: Box) -> Interval:
        key = tuple((x.a, x.b, x.e) for x in (piece[name] for name in cut))
        if key not in known:
            known[key] = function(piece)
        return known[key]

    cut = [name for name in names if name in box]
    return between(-supremum(lambda piece: -once(piece), box, names, cuts), supremum(once, box, names, cuts))


def halves(box: Box, name: str) -> list[Box]:
    x = box[name]
    middle = x.a + x.b
    return [{**box, name: Interval(a, b, x.e - 1)} for a, b in ((2 * x.a, middle), (middle, 2 * x.b))]


class _Piece:
    """A part of the box and its bound; ``patience`` is for halvings that do not help."""

    def __init__(self, function: Callable[[Box], Interval], box: Box, patience: int) -> None:
        self.function, self.box, self.patience = function, box, patience
        self.bound: Fraction | None = None
        self.exact, self.reason = False, ""
        try:
            value = function(box)
            self.bound, self.exact = value.hi, value.a == value.b
        except Undecided as reason:
            self.reason = str(reason)

    def order(self) -> tuple[bool, Fraction]:
        return self.bound is None, self.bound or Fraction(0)

    def best_halves(self, names: Collection[str]) -> list[_Piece]:
        """The halves with the least bounds; if no direction helps, those of the widest, with less patience."""
        wide = sorted(name for name in names if name in self.box and self.box[name].a < self.box[name].b)
        if not wide or self.exact:
            return []
        choices = {name: [_Piece(self.function, half, PATIENCE) for half in halves(self.box, name)] for name in wide}
        best = min(wide, key=lambda name: max(piece.order() for piece in choices[name]))
        if max(piece.order() for piece in choices[best]) < self._useful():
            return choices[best]
        widest = max(wide, key=lambda name: self.box[name].hi - self.box[name].lo)
        for piece in choices[widest]:
            piece.patience = self.patience - (UNDECIDED if self.bound is None else USELESS)
        return choices[widest]

    def _useful(self) -> tuple[bool, Fraction]:
        if self.bound is None:
            return True, Fraction(0)
        return False, self.bound - abs(self.bound) * (1 - USEFUL)
