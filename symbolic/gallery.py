"""Plant files that come with the package: the gallery, and a commented one to begin with."""

from __future__ import annotations

import re
from pathlib import Path

from symbolic.errors import InputError, nearest
from symbolic.plant import Plant
from symbolic.plant_file import parse_plant

HERE = Path(__file__).resolve().parent
STARTER = HERE / "starter.toml"
PLACES = (HERE / "gallery", HERE.parent / "examples", HERE.parent / "examples" / "gallery")  # wheel, then checkout


def gallery() -> tuple[str, ...]:
    """The names of the plants that come with the package.

    >>> "pendulums" in gallery()
    True
    """
    return tuple(_files())


def gallery_text(name: str | None = None) -> str:
    """The plant file of that name, the commented one without a name. Raises ``InputError`` for an unknown one."""
    if name is None:
        return STARTER.read_text(encoding="utf-8")
    files = _files()
    if name not in files:
        near = nearest(name, files)
        hint = f"did you mean {near!r}?" if near else f"known: {', '.join(files)}"
        raise InputError(f"{name[:60]!r} is no plant of the gallery; {hint}")
    return files[name].read_text(encoding="utf-8")


def example(name: str | None = None) -> Plant:
    """A plant of the gallery; the one to begin with if no name is given. Raises ``InputError``.

    >>> example("pendulums").agents[0].order
    2
    """
    return parse_plant(gallery_text(name).encode(), name or "starter")


def summary(name: str) -> str:
    """What a plant of the gallery is about: the first sentence of its comment, up to a full stop or a colon."""
    comment = re.match(r"(?:#.*\n)*", gallery_text(name))
    text = " ".join(line.lstrip("# ") for line in comment.group().splitlines()) if comment else ""
    return re.split(r"[.:](?:\s|$)", text, maxsplit=1)[0]


def _files() -> dict[str, Path]:
    """By name, sorted; names are those of the files, with dashes or underscores as they stand."""
    found = {path.stem: path for place in PLACES for path in place.glob("*.toml")}
    return dict(sorted(found.items()))
