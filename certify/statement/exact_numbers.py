"""Numbers of a certificate: text ``p/q`` or ``p`` and nothing else."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]

_NUMBER = re.compile(r"-?[0-9]{1,4000}(/[0-9]{1,4000})?")


def exact(text: str) -> Fraction:
    """A number of a certificate, ``p/q`` or ``p``. Raises ``ValueError`` for other notations, such as ``1e999999``."""
    if not _NUMBER.fullmatch(text):
        raise ValueError("a number is a string p or p/q")
    return Fraction(text)


def exact_row(entries: Sequence[str]) -> Row:
    return tuple(map(exact, entries))


def exact_matrix(rows: Sequence[Sequence[str]]) -> Matrix:
    return tuple(map(exact_row, rows))
