"""What a command ends with: a status, an exit code, one JSON object or a text."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import NoReturn

import typer

from certify.lifetime import nearly_done
from symbolic.answers import BAD_INPUT, EXIT_CODES, UNDECIDED
from symbolic.errors import InputError

__all__ = ["BAD_INPUT", "EXIT_CODES", "UNDECIDED", "Outcome", "finish", "json_text", "naming"]


@dataclass(frozen=True)
class Outcome:
    """``fields`` follow ``status`` in the JSON object; ``text`` is for people; either goes to stdout."""

    status: str
    fields: Mapping[str, object]
    text: str

    @property
    def exit_code(self) -> int:
        return EXIT_CODES[self.status]

    def as_json(self) -> str:
        return json_text({"status": self.status} | {key: self.fields[key] for key in self.fields if key != "status"})


def json_text(value: object) -> str:
    """One line of JSON; exact numbers as strings."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False, default=_exact)


def finish(outcome: Outcome, as_json: bool, document: bytes | None = None) -> NoReturn:
    """Print the outcome and leave with its exit code; a ``document`` takes stdout for itself."""
    nearly_done()
    printed = outcome.as_json() if as_json else outcome.text.rstrip("\n")
    try:
        if document is not None:
            sys.stdout.flush()
            sys.stdout.buffer.write(document)
            sys.stdout.flush()
        print(printed, end="\n" if printed else "", file=sys.stdout if document is None else sys.stderr, flush=True)
    except BrokenPipeError:  # the reader has gone; the exit code still tells
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    raise typer.Exit(outcome.exit_code)


@contextmanager
def naming(file: str) -> Iterator[None]:
    """Put the file in front of an ``InputError`` that only knows the key."""
    try:
        yield
    except InputError as error:
        if str(error).startswith(file):
            raise
        raise InputError(*(f"{file}: {line}" for line in error.lines)) from error


def _exact(value: object) -> str:
    if isinstance(value, Fraction):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no place in the JSON output")
