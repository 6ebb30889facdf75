"""Where a command puts its results: ``-o FILE``, ``-o DIR``, or standard output for ``-o -`` where it is one file."""

from __future__ import annotations

import sys
from pathlib import Path

from certify.files import require_folder, require_writable, write_atomically
from symbolic.errors import InputError

STANDARD_OUTPUT = Path("-")


def require_file(path: Path, as_json: bool, *suffixes: str) -> None:
    """Say before the work starts that its result could not be kept. Raises ``InputError`` that says what to change."""
    if path == STANDARD_OUTPUT:
        if as_json:
            raise InputError("-o -: stdout cannot hold the file and the JSON object; name a file or leave out --json")
        if suffixes and sys.stdout.isatty():
            raise InputError(f"-o -: a {suffixes[0]} does not belong on a terminal; redirect it or name a file")
        return
    require_writable(path)
    if suffixes and path.suffix.lower() not in suffixes:
        said = " or ".join(suffixes)
        raise InputError(f"-o {path}: the name has to end in {said}, as in {path.with_suffix(suffixes[0])}")


def require_output_folder(path: Path) -> None:
    """Say before the work starts that there is no place for its files. Raises ``InputError``."""
    if path == STANDARD_OUTPUT:
        raise InputError("-o -: this command writes several files; name a folder for them (./- for one called -)")
    require_folder(path)


def deliver(path: Path, data: bytes) -> bytes | None:
    """Write the file; what is to go to standard output instead is returned (see ``outcome.finish``)."""
    if path == STANDARD_OUTPUT:
        return data
    write_atomically(path, data)
    return None
