"""Where the keys and values of a TOML document stand in its text, which ``tomllib`` does not say.

Only for documents that ``tomllib`` has accepted: nothing is checked here, and what is not found has no place.
"""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass

Path = tuple[str | int, ...]

_BLANK = re.compile(r"[ \t]*")
_FILLING = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_STRINGS = tuple(
    (quote, re.compile(body, re.DOTALL))
    for quote, body in (
        ('"""', r'"""(?:[^\\]|\\.)*?"{3,5}(?!")'),
        ("'''", r"'''.*?'{3,5}(?!')"),
        ('"', r'"(?:[^"\\]|\\.)*"'),
        ("'", r"'[^']*'"),
    )
)
_SCALAR = re.compile(r"[^,\]}#\r\n]+")


@dataclass(frozen=True)
class Spot:
    """Offsets of a key (of its last part) and of its value; ``plain`` is where the text of a string begins if every
    character of it stands for itself."""

    key: int
    value: int
    plain: int | None


class Places:
    """The places of all keys and array entries (positions counted from 1) of a document."""

    def __init__(self, text: str) -> None:
        self.lines = [0, *(match.end() for match in re.finditer("\n", text))]
        try:
            self.spots: Mapping[Path, Spot] = _Scanner(text).document()
        except (RecursionError, _Lost):
            self.spots = {}

    def of(self, path: Path, *, key: bool = False, column: int | None = None) -> tuple[int, int] | None:
        """Line and column, both from 1, of the value at the path, of its key, or of a column of its text.

        What has no place of its own (a key that is missing, a document that was not understood) is where the table
        around it is.
        """
        while path and path not in self.spots:
            path, key, column = path[:-1], True, None
        if not path:
            return None
        spot = self.spots[path]
        offset = spot.key if key else spot.value
        if column is not None and not key and spot.plain is not None:
            offset = spot.plain + column - 1
        line = bisect_right(self.lines, offset)
        return line, offset - self.lines[line - 1] + 1


class _Lost(Exception):
    """The text is not what the scanner expects."""


class _Scanner:
    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.spots: dict[Path, Spot] = {}
        self.lengths: dict[Path, int] = {}  # of arrays of tables

    def document(self) -> dict[Path, Spot]:
        table: Path = ()
        while self.skip(_FILLING) < len(self.text):
            table = self.header() if self.text[self.at] == "[" else self.entry(table)
        return self.spots

    def skip(self, pattern: re.Pattern[str]) -> int:
        match = pattern.match(self.text, self.at)
        self.at = match.end() if match else self.at
        return self.at

    def take(self, literal: str) -> bool:
        found = self.text.startswith(literal, self.at)
        self.at += len(literal) if found else 0
        return found

    def expect(self, literal: str) -> None:
        if not self.take(literal):
            raise _Lost

    def header(self) -> Path:
        start, many = self.at, self.text.startswith("[[", self.at)
        self.at += 2 if many else 1
        parts, _ = self.key()
        self.expect("]]" if many else "]")
        path: Path = ()
        for position, part in enumerate(parts, 1):
            path = (*path, part)
            if many and position == len(parts):
                self.lengths[path] = self.lengths.get(path, 0) + 1
                self.spots.setdefault(path, Spot(start, start, None))
            if path in self.lengths:
                path = (*path, self.lengths[path])
            self.spots.setdefault(path, Spot(start, start, None))
        return path

    def entry(self, table: Path) -> Path:
        """``key = value`` in the table, which is still the one that later lines belong to."""
        parts, start = self.key()
        self.expect("=")
        self.skip(_BLANK)
        path = table
        for part in parts[:-1]:
            path = (*path, part)
            self.spots.setdefault(path, Spot(start, self.at, None))
        self.value((*path, parts[-1]), start)
        return table

    def key(self) -> tuple[list[str], int]:
        """The parts of a dotted key, and where the last of them begins."""
        parts = []
        while True:
            self.skip(_BLANK)
            start = self.at
            if self.text[self.at : self.at + 1] in ("'", '"'):
                parts.append(str(tomllib.loads(f"{self.string()} = 0").popitem()[0]))
            else:
                self.skip(_BARE)
                parts.append(self.text[start : self.at])
            if self.at == start:
                raise _Lost
            self.skip(_BLANK)
            if not self.take("."):
                return parts, start

    def string(self) -> str:
        for _, pattern in _STRINGS:
            match = pattern.match(self.text, self.at)
            if match:
                self.at = match.end()
                return match.group()
        raise _Lost

    def value(self, path: Path, key: int) -> None:
        start, plain, first = self.at, None, self.text[self.at : self.at + 1]
        self.spots[path] = Spot(key, start, None)
        if first in ("'", '"'):
            text = self.string()
            if "\\" not in text or first == "'":
                plain = start + (3 if text.startswith((first * 3,)) and len(text) >= 6 else 1)
                plain = None if "\n" in text else plain
            self.spots[path] = Spot(key, start, plain)
        elif first == "[":
            self.array(path)
        elif first == "{":
            self.inline(path)
        elif self.skip(_SCALAR) == start:
            raise _Lost

    def array(self, path: Path) -> None:
        self.expect("[")
        position = 0
        while True:
            self.skip(_FILLING)
            if self.take("]"):
                return
            position += 1
            self.value((*path, position), self.at)
            self.skip(_FILLING)
            self.take(",")

    def inline(self, path: Path) -> None:
        self.expect("{")
        while True:
            self.skip(_FILLING)
            if self.take("}"):
                return
            self.entry(path)
            self.skip(_FILLING)
            self.take(",")
