"""What the templates show: plain text, mathematics, numbers with log₁₀ beside them. All of it is data, not code.

A cell is ``{"text": …}``, shown as it is, or ``{"math": …, "log10": …, "exact": …}`` with mathematics that
:mod:`reports.typst_math` wrote.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from certify.statement.numbers import Rounding, Shown, fraction, shown
from reports import typst_math
from symbolic.plant import Interval

Cell = Mapping[str, object]
Rows = Sequence[Sequence[Fraction]]

MAX_TEXT = 420
_LONG_TOKEN = 18
_BREAK_AFTER = "*/+-_,;:=)]"
MATRIX_UP_TO = 10


def text(value: object, limit: int = MAX_TEXT) -> Cell:
    """Plain text, cut to the limit, with places to break long formulas and digests."""
    whole = printable(value)
    cut = whole if len(whole) <= limit else whole[: limit - 1] + "…"
    return {"text": " ".join(map(_breakable, cut.split(" ")))}


def printable(value: object) -> str:
    """Its text without what would not be seen or would turn the text around it."""
    return "".join(char if char.isprintable() else " " for char in str(value))


def math(code: str) -> Cell:
    """Mathematics from :mod:`reports.typst_math`."""
    return {"math": code}


def number(value: Fraction | None, rounding: Rounding = "nearest") -> Cell:
    """A short decimal with log₁₀ beside it where it is far from 1; a dash for ``None``."""
    return text("–") if value is None else _cell(shown(value, rounding=rounding))


def short_fraction(value: Fraction) -> Cell:
    """``p/q`` where that is short."""
    return _cell(fraction(value))


def matrix(rows: Rows) -> Cell:
    """A matrix of short decimals; ``exact`` if no entry is rounded. Its size alone if it is too large to print."""
    if max(len(rows), max(map(len, rows))) > MATRIX_UP_TO:
        return text(f"{len(rows)} × {len(rows[0])} matrix, in the certificate")
    entries = [[shown(entry) for entry in row] for row in rows]
    code = typst_math.matrix([[typst_math.number(entry) for entry in row] for row in entries])
    return {"math": code, "exact": all(entry.exact for row in entries for entry in row)}


def interval(value: Interval) -> str:
    """``[lo, hi]`` (or the point) as Typst math."""
    lo, hi = (typst_math.number_text(fraction(end).text, inline=True) for end in (value.lo, value.hi))
    return lo if value.is_point else f"[{lo}, {hi}]"


def agents(ids: Iterable[int]) -> str:
    """``1–3, 5`` for the agents 1, 2, 3, 5."""
    runs: list[list[int]] = []
    for i in sorted(ids):
        if runs and runs[-1][-1] == i - 1:
            runs[-1].append(i)
        else:
            runs.append([i])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)


def agents_named(ids: Iterable[int]) -> str:
    """``Agent 4`` or ``Agents 1–3, 5``."""
    listed = list(ids)
    return f"Agent{'s' if len(listed) > 1 else ''} {agents(listed)}"


def _cell(value: Shown) -> Cell:
    return {"math": typst_math.number(value), "log10": value.log10, "exact": value.exact}


def _breakable(token: str) -> str:
    if len(token) <= _LONG_TOKEN:
        return token
    pieces, run = "", 0
    for char in token:
        pieces += char
        run += 1
        if char in _BREAK_AFTER or run >= _LONG_TOKEN:
            pieces += "\u200b"
            run = 0
    return pieces
