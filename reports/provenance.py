"""What is needed to make the report again: digests, versions, seed and command lines, without paths of the machine."""

from __future__ import annotations

import re
from importlib.metadata import version
from typing import Any

from reports import cells
from reports.study import Study

SHOWN_WITH = ("matplotlib", "networkx", "scipy", "typst")
_ABSOLUTE = re.compile(r"(?<![\w.~-])(?:~|[A-Za-z]:)?[/\\](?:[^\s'\"/\\]+[/\\])*([^\s'\"/\\]+)")


def reproducibility_section(study: Study) -> dict[str, Any]:
    """The data of ``reproducibility.typ``."""
    versions = {name: version(name) for name in SHOWN_WITH} | dict(study.versions)
    return {
        "seed": cells.text("none used" if study.seed is None else study.seed),
        "commands": [portable(command) for command in study.commands],
        "versions": [[cells.text(name), cells.text(version)] for name, version in sorted(versions.items())],
    }


def portable(command: str) -> str:
    """The command with absolute paths cut down to their last part."""
    printable = "".join(char if char.isprintable() else " " for char in command)
    return _ABSOLUTE.sub(r"\1", printable)
