"""Progress on stderr: a line per finished step; while one runs a bar on a terminal, elsewhere a line now and then."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

QUIET = 5.0  # seconds between two lines, where nobody may be looking
NAME = 10  # letters, of the longest step

Listener = Callable[[str], None]


class Report:
    """Calling it says how a step went; ``progress`` says what it is at, ``share`` what part of it is done."""

    def __init__(self, name: str, bar: tuple[Progress, TaskID] | None, listener: Listener | None = None) -> None:
        self.name, self.said = name, ""
        self._bar, self._listener = bar, listener
        self._started = self._noted = time.monotonic()

    def __call__(self, text: str) -> None:
        self.said = text

    def progress(self, text: str) -> None:
        """On a terminal beside the bar; elsewhere at most one line every five seconds."""
        if self._bar is not None:
            progress, task = self._bar
            progress.update(task, description=f"{self.name}: {text}")
            return
        if self._listener is not None:
            self._listener(f"{self.name}: {text}")
            return
        now = time.monotonic()
        if now - self._noted >= QUIET:
            self._noted = now
            note(self.name, f"{self.time()}  … {text}")

    def share(self, done: float) -> None:
        """Between 0 and 1."""
        if self._bar is not None:
            progress, task = self._bar
            progress.update(task, total=1.0, completed=done)

    def time(self) -> str:
        return f"{time.monotonic() - self._started:6.1f} s"


class Steps:
    """Names the steps of a command as they are done, on stderr or to a ``listener``. Nothing goes to stdout."""

    def __init__(self, listener: Listener | None = None) -> None:
        self._listener = listener

    @property
    def on_terminal(self) -> bool:
        return self._listener is None and sys.stderr.isatty()

    @contextmanager
    def step(self, name: str) -> Iterator[Report]:
        """Yields what tells about the step; what was said last stands in the step's line."""
        if self.on_terminal:
            with _bar() as progress:
                report = Report(name, (progress, progress.add_task(name, total=None)))
                yield report
        else:
            report = Report(name, None, self._listener)
            yield report
        self.note(name, f"{report.time()}  {report.said}")

    def note(self, name: str, text: str) -> None:
        """A line about a step."""
        if self._listener is None:
            note(name, text)
        else:
            self._listener(f"{name}: {text.strip()}")


def note(name: str, text: str) -> None:
    print(f"{name:<{NAME}} {text}".rstrip(), file=sys.stderr, flush=True)


def _bar() -> Progress:
    """Imported here: a command that is done at once, or writes to a file, needs no bar."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(24), TimeElapsedColumn())
    return Progress(*columns, console=Console(stderr=True, highlight=False, soft_wrap=True), transient=True)
