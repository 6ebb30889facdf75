"""Progress on stderr: one line per finished step; while one runs a spinner on a terminal, else a line now and then."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.status import Status
from rich.text import Text

QUIET = 5.0


class Report:
    """Calling it says how a step went; ``progress`` says what it is at."""

    def __init__(self, name: str, steps: Steps, status: Status) -> None:
        self.name, self.said = name, ""
        self._steps, self._status = steps, status
        self._started = self._noted = time.monotonic()

    def __call__(self, text: str) -> None:
        self.said = text

    def progress(self, text: str) -> None:
        """On a terminal beside the spinner; elsewhere at most one line every five seconds."""
        self._status.update(Text(f"{self.name}: {text}"))
        now = time.monotonic()
        if not self._steps.on_terminal and now - self._noted >= QUIET:
            self._noted = now
            self._steps.note(self.name, f"{self.time()}  … {text}")

    def time(self) -> str:
        return f"{time.monotonic() - self._started:6.1f} s"


class Steps:
    """Names the steps of a command as they are done. Nothing goes to stdout."""

    def __init__(self) -> None:
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)

    @property
    def on_terminal(self) -> bool:
        return self._console.is_terminal

    @contextmanager
    def step(self, name: str) -> Iterator[Report]:
        """Yields what tells about the step; what was said last stands in the step's line."""
        with self._console.status(Text(name)) as status:
            report = Report(name, self, status)
            yield report
        self.note(name, f"{report.time()}  {report.said}")

    def note(self, name: str, text: str) -> None:
        """A line about a step."""
        self._console.print(Text(f"{name:<10} {text}".rstrip()))
