"""What a command reads: files, or standard input for ``-``. Each is read once, so that all steps see the same bytes."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from symbolic.errors import InputError

if TYPE_CHECKING:
    from certify.certificate import Json
    from symbolic.plant import Plant

STANDARD_INPUT = Path("-")
LONGEST = (16 << 20) + 1  # bytes: one more than the reader of certificates takes, the most patient one


@dataclass(frozen=True)
class Given:
    """The bytes of an input (too long ones cut where every reader refuses them) and how messages call it."""

    name: str
    data: bytes

    def as_plant(self) -> Plant:
        """Raises ``InputError``."""
        from symbolic.plant_file import parse_plant

        return parse_plant(self.data, self.name)

    def as_certificate(self) -> Json:
        """For display; the checker reads the bytes for itself. Raises ``InputError``."""
        from certify.certificate import parse_certificate

        return parse_certificate(self.data, self.name)


def given_plant(path: Path) -> Given:
    """The bytes of a plant file. Raises ``InputError`` if it cannot be read."""
    return _given(path)


def given_pair(plant: Path, certificate: Path) -> tuple[Given, Given]:
    """The bytes of both. Raises ``InputError`` if one cannot be read, or both are standard input."""
    if plant == certificate == STANDARD_INPUT:
        raise InputError("-: only one of PLANT and CERT can be standard input")
    return given_plant(plant), _given(certificate)


def _given(path: Path) -> Given:
    if path == STANDARD_INPUT:
        return Given("<stdin>", sys.stdin.buffer.read(LONGEST))
    try:
        with path.open("rb") as file:
            return Given(str(path), file.read(LONGEST))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read: {reason}") from None
