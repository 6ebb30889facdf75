"""One kind of error for bad input: one line that names the file, the key and the reason."""

from __future__ import annotations

from dataclasses import dataclass

MAX_MESSAGE = 600


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
        parts = [self.file, self.key, "" if column is None else f"column {column}", reason]
        return InputError(": ".join(part for part in parts if part))


def one_line(text: str, limit: int = MAX_MESSAGE) -> str:
    """The text with control characters escaped, cut to the limit."""
    cut = text if len(text) <= limit else text[: limit - 1] + "…"
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in cut)


def quoted(text: str, limit: int = 40) -> str:
    """The text in quotes for a message, cut to the limit and with everything outside ASCII escaped."""
    cut = text if len(text) <= limit else text[: limit - 3] + "..."
    return ascii(cut)
