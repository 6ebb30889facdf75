"""What every step answers with: a status that means an exit code, a text of a few lines, and a table for notebooks."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from html import escape
from textwrap import wrap
from typing import TYPE_CHECKING

HOLDS, REFUTED, BAD_INPUT, UNDECIDED = 0, 1, 2, 3

EXIT_CODES = {
    "holds": HOLDS,
    "certified": HOLDS,
    "verified": HOLDS,
    "survived": HOLDS,
    "simulated": HOLDS,
    "fails": REFUTED,
    "rejected": REFUTED,
    "refuted": REFUTED,
    "unknown": UNDECIDED,
    "inconclusive": UNDECIDED,
}
COLOURS = {HOLDS: "#1b7837", REFUTED: "#b2182b", UNDECIDED: "#8c6d00"}  # dark enough on white for small print

MOST_LINES = 12  # of a repr: what a terminal shows without scrolling away what came before
LONGEST_LINE = 160

Rows = Sequence[Sequence[str]]


class Answer:
    """Mixed into frozen results that have a ``status`` of ``EXIT_CODES``; they say the rest by :meth:`said`."""

    __slots__ = ()

    if TYPE_CHECKING:  # at run time it would be the default of the field of that name

        @property
        def status(self) -> str:
            """One of ``EXIT_CODES``."""

    @abstractmethod
    def said(self) -> Sequence[str]:
        """The answer in lines of text, the status in the last or first of them."""

    def rows(self) -> Rows:
        """A table that says the same, its head first; empty where the text is better."""
        return ()

    @property
    def exit_code(self) -> int:
        """What the command line leaves with: 0 it holds, 1 it does not, 3 not decided."""
        return EXIT_CODES[self.status]

    def __repr__(self) -> str:
        lines = [part for text in self.said() for line in text.splitlines() for part in _wrapped(line)]
        more = len(lines) - MOST_LINES
        return "\n".join(lines if more <= 0 else [*lines[: MOST_LINES - 1], f"… {more + 1} more lines"])

    def _repr_html_(self) -> str:
        colour = COLOURS[self.exit_code]
        head = f'<p><strong style="color:{colour}">{escape(self.status)}</strong></p>'
        rows = self.rows()
        if not rows:
            return f"{head}<pre>{escape(repr(self))}</pre>"
        title, *body = ["".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in row) for tag, row in _tagged(rows)]
        return f"{head}<table><tr>{title}</tr>{''.join(f'<tr>{row}</tr>' for row in body)}</table>"


def _wrapped(line: str) -> list[str]:
    """What stood in the way is often at the end of a long reason, so nothing is cut off."""
    return [line] if len(line) <= LONGEST_LINE else wrap(line, LONGEST_LINE, subsequent_indent="  ")


def _tagged(rows: Rows) -> list[tuple[str, Sequence[str]]]:
    return [("th" if k == 0 else "td", row) for k, row in enumerate(rows)]


def agents_named(ids: Sequence[int]) -> str:
    """``agent 1``, ``agents 1, 2`` or ``agents 1–3, 5``; ``network`` for none."""
    if not ids:
        return "network"
    runs: list[list[int]] = []
    for number in sorted(ids):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    parts = [f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs]
    return f"agent{'s' if len(ids) > 1 else ''} {', '.join(parts)}"
