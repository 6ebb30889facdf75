"""One kind of error for bad input: one line that names the file, the key and the reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction

MAX_KEY = 200
MAX_REASON = 400


class InputError(ValueError):
    """Input that cannot be used. The message is one printable line; the command line prints it and exits with 2."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


@dataclass(frozen=True)
class Where:
    """A place in an input: a file (or another source) and a key such as ``agent[2].f``; the key may be empty."""

    file: str
    key: str = ""

    def at(self, key: str | int) -> Where:
        """The place of an entry of this table (a name) or of this array (a position counted from 1)."""
        step = f"[{key}]" if isinstance(key, int) else str(key)
        join = "." if self.key and not isinstance(key, int) else ""
        return Where(self.file, self.key + join + step)

    def error(self, reason: str, column: int | None = None) -> InputError:
        """``FILE: KEY: reason``, with ``column N: `` before the reason of a fault inside an expression."""
        column_part = "" if column is None else f"column {column}"
        parts = [self.file, cut(self.key, MAX_KEY), column_part, cut(reason, MAX_REASON)]
        return InputError(": ".join(part for part in parts if part))


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word most like this one, if any is alike; of short names half is enough."""
    return next(iter(get_close_matches(cut(word, 80), known, n=1, cutoff=0.5 if len(word) <= 3 else 0.6)), None)


def one_line(text: str) -> str:
    """The text with everything escaped that does not print on one line."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)


def cut(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 3] + "..."


def quoted(text: str) -> str:
    """The text in quotes for a message, cut to 40 characters and with everything outside ASCII escaped."""
    return ascii(cut(text, 40))


def shown(number: Fraction) -> str:
    """The number for a message; the size of it when it is too long to read."""
    bits = number.numerator.bit_length() + number.denominator.bit_length()
    return str(number) if bits <= 256 else f"a rational number of {bits} bits"
