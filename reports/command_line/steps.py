"""Progress on stderr: one line per finished step, and a spinner on a terminal while one runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.text import Text

Report = Callable[[str], None]


class Steps:
    """Names the steps of a command as they are done. Nothing goes to stdout."""

    def __init__(self) -> None:
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)

    @contextmanager
    def step(self, name: str) -> Iterator[Report]:
        """Yields a function that shows what the step is at; the last text given stands in the step's line."""
        started = time.monotonic()
        said = ""
        with self._console.status(Text(name)) as status:

            def report(text: str) -> None:
                nonlocal said
                said = text
                status.update(Text(f"{name}: {text}"))

            yield report
        self.note(name, f"{time.monotonic() - started:6.1f} s  {said}")

    def note(self, name: str, text: str) -> None:
        """A finished line about a step."""
        self._console.print(Text(f"{name:<10} {text}".rstrip()))
