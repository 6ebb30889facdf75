"""Bad input: one line for each thing that is wrong, which names the file, the key and the reason."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from fractions import Fraction
from typing import TypeVar

from symbolic.messages import Reason
from symbolic.toml_places import Path, Places

MAX_KEY = 200
MAX_REASON = 400
MAX_PROBLEMS = 50  # a file with more is another kind of file

T = TypeVar("T")


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong: file, key, reason, the column in an expression, and where it stands in the file.

    ``position`` is line and column from 1, ``None`` as long as nobody has looked; ``spot`` is the path that is looked
    up, and ``on_key`` says that the key itself is meant.
    """

    file: str
    key: str
    reason: str
    column: int | None = None
    spot: Path = ()
    on_key: bool = False
    position: tuple[int, int] | None = None

    def __str__(self) -> str:
        """``FILE:LINE:COLUMN: KEY: column N: reason`` with ``column N`` that of the expression; what is not known is
        left out."""
        place = "" if self.position is None else ":{}:{}".format(*self.position)
        column = "" if self.column is None else f"column {self.column}"
        parts = [self.file + place, cut(self.key, MAX_KEY), column, cut(self.reason, MAX_REASON)]
        return one_line(": ".join(part for part in parts if part))

    def located(self, places: Places) -> Problem:
        """The problem with the position of its spot."""
        position = self.position or places.of(self.spot, key=self.on_key, column=self.column)
        return replace(self, position=position)


class InputError(ValueError):
    """Input that cannot be used. ``lines`` has a printable line for each thing that is wrong; the command line prints
    them and exits with 2."""

    def __init__(self, *wrong: str | Problem) -> None:
        self.problems = tuple(entry for entry in wrong if isinstance(entry, Problem))
        self.lines = tuple(dict.fromkeys(one_line(str(entry)) for entry in wrong))
        super().__init__("\n".join(self.lines))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, ...]]:
        return InputError, self.lines


class Enough(Exception):
    """More is wrong with a file than anybody wants to read."""


class Problems:
    """What was found wrong so far, by a reader that goes on after a fault, up to ``MAX_PROBLEMS``."""

    def __init__(self) -> None:
        self.found: dict[Problem, None] = {}

    def add(self, error: InputError) -> None:
        """Raises ``Enough`` when there are more than ``MAX_PROBLEMS``."""
        for problem in error.problems:
            self.found.setdefault(problem)
            if len(self.found) > MAX_PROBLEMS:
                raise Enough

    def finish(self, places: Callable[[], Places]) -> None:
        """Raises ``InputError`` with everything that was found, in the order of the file; returns if nothing was."""
        if not self.found:
            return
        text = places()
        located = sorted((problem.located(text) for problem in self.found), key=lambda one: one.position or (0, 0))
        more = [f"{located[0].file}: and more"] if len(located) > MAX_PROBLEMS else []
        raise InputError(*located[:MAX_PROBLEMS], *more)


@dataclass(frozen=True)
class Where:
    """A place in an input: a file (or another source) and the path of a key, which may be empty.

    With ``problems`` a fault that is reported or met in an attempt is noted and reading goes on; without, it is raised.
    """

    file: str
    path: Path = ()
    problems: Problems | None = None

    @property
    def key(self) -> str:
        """The path as text, such as ``agent[2].f``."""
        text = ""
        for step in self.path:
            text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
        return text

    def at(self, key: str | int) -> Where:
        """The place of an entry of this table (a name) or of this array (a position counted from 1)."""
        return replace(self, path=(*self.path, key))

    def error(
        self, reason: Reason, column: int | None = None, *, spot: Where | None = None, on_key: bool = False
    ) -> InputError:
        """The error to raise; ``spot`` is another place to point at, ``on_key`` points at the key, not its value."""
        place = (spot or self).path
        return InputError(Problem(self.file, self.key, reason, column, place, on_key))

    def report(self, reason: Reason, *, spot: Where | None = None, on_key: bool = False) -> None:
        """Note a fault after which reading can go on; raise it if nobody collects."""
        error = self.error(reason, spot=spot, on_key=on_key)
        if self.problems is None:
            raise error
        self.problems.add(error)

    def attempt(self, read: Callable[[], T], instead: T) -> T:
        """What ``read`` returns, or ``instead`` after noting why it could not."""
        if self.problems is None:
            return read()
        try:
            return read()
        except InputError as error:
            self.problems.add(error)
            return instead


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word most like this one, if any is alike: another case first; of names of 2 or 3 letters half is
    enough, and of one letter nothing else is."""
    known = list(known)
    same = next((other for other in known if other.casefold() == word.casefold()), None)
    if same or len(word) == 1:
        return same
    return next(iter(get_close_matches(cut(word, 80), known, n=1, cutoff=0.5 if len(word) <= 3 else 0.6)), None)


def did_you_mean(word: str, known: Sequence[str], otherwise: str) -> str:
    """``did you mean …?``, or what is known if nothing is alike."""
    near = nearest(word, known)
    return f"did you mean {quoted(near)}?" if near else otherwise


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
