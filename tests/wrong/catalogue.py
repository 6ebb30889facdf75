"""Every message about a plant file, with a file that triggers it: the page ``docs/messages.md``."""

from __future__ import annotations

from collections.abc import Iterator

from symbolic import messages
from symbolic.errors import InputError, cut
from symbolic.plant_file import load_plant, parse_plant

from .plants import LIMITS, WRONG, Wrong

MOST = 70  # characters of an edit that are shown
HEAD = """# What the reader of plant files says

Made by `python -m tests.wrong` from `symbolic/messages.py` and the wrong files of `tests/wrong/plants.py`; a test
compares. All that is wrong with a file is said at once, a line each: `FILE:LINE:COLUMN: KEY: column N: reason`, with
`column N` counted in the expression. A file is the one at the top of `tests/wrong/plants.py`, with the change shown.

| message | change | said |
|---|---|---|
"""


def refusal(wrong: Wrong) -> InputError:
    """What the reader says of a wrong file."""
    try:
        parse_plant(wrong.file, "plant.toml")
    except InputError as error:
        return error
    raise AssertionError(f"accepted: {wrong.title}")


def said_by(error: InputError) -> list[tuple[str, str]]:
    """The name of each message and the line that it became."""
    names = {id(message): name for name, message in messages.ALL.items()}
    made = [getattr(problem.reason, "message", None) for problem in error.problems]
    return [(names[id(message)], str(line)) for message, line in zip(made, error.problems, strict=True)]


def unreadable() -> InputError:
    """The one message that needs no file."""
    try:
        load_plant("no such file.toml")
    except InputError as error:
        return error
    raise AssertionError("read")


def rows() -> Iterator[tuple[str, str, str]]:
    """Name of the message, what was changed, and what is said; in the order of the module."""
    found: dict[str, list[tuple[str, str]]] = {name: [] for name in messages.ALL}
    for name, line in said_by(unreadable()):
        found[name].append(("no file", line))
    for wrong in (*WRONG, *LIMITS):
        change = f"{_code(wrong.old)} → {_code(wrong.new)}" if wrong.old else wrong.title
        for name, line in said_by(refusal(wrong)):
            found[name].append((change, line))
    for name, examples in found.items():
        for change, line in examples:
            yield name, change, line


def page() -> str:
    lines = []
    last = ""
    for name, change, line in rows():
        template = "" if name == last else messages.ALL[name].text
        lines.append(f"| {_code(template, 400)} | {change} | {_code(line, 400)} |")
        last = name
    return HEAD + "\n".join(lines) + "\n"


def _code(text: str, most: int = MOST) -> str:
    """The text as code in a cell of a table; nothing for nothing."""
    if not text:
        return ""
    shown = cut(text, most).replace("\n", " ⏎ ").replace("|", "\\|")
    return f"`` {shown} ``" if "`" in shown else f"`{shown}`"
