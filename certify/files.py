"""Output files appear whole or not at all, those of one folder together."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from certify.lifetime import finished, undivided, unfinished
from symbolic.errors import InputError


def write_atomically(path: Path, data: bytes) -> None:
    """Write next to ``path`` under a temporary name, then rename over it; missing folders are made.

    Raises ``InputError`` naming ``path``.
    """
    write_together(path.parent, {path.name: data})


def write_together(folder: Path, files: Mapping[str, bytes | None]) -> None:
    """Make ``files`` what ``folder`` has under their names; ``None`` stands for no file. Missing folders are made.

    Everything is written before the first old file gives way, and an interruption in between waits. Raises
    ``InputError`` naming the path.
    """
    for name in files:
        require_writable(folder / name)
    with undivided():
        make_folder(folder)
        staged: list[tuple[Path, Path]] = []
        path = folder
        try:
            for name, data in files.items():
                path = folder / name
                if data is not None:
                    staged.append((_staged(path, data), path))
            for temporary, path in staged:
                temporary.replace(path)
                finished(temporary)
            for path in (folder / name for name, data in files.items() if data is None):
                path.unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from error
        finally:
            for temporary, _ in staged:
                with contextlib.suppress(OSError):
                    temporary.unlink()


def require_writable(path: Path) -> None:
    """Say before the work starts that its result could not be kept. Raises ``InputError`` naming ``path``."""
    if path.is_dir():
        raise InputError(f"{path}: cannot be written: it is a folder; name a file in it")
    require_folder(path.parent, f"{path}: cannot be written")


def require_folder(folder: Path, complaint: str | None = None) -> None:
    """That ``folder`` is one that can be written to, or could be made. Raises ``InputError``."""
    complaint = complaint or f"{folder}: cannot be made a folder"
    nearest = folder
    while not os.path.lexists(nearest) and nearest != nearest.parent:
        nearest = nearest.parent
    if not nearest.is_dir():
        raise InputError(f"{complaint}: {nearest} is not a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{complaint}: {nearest} is read-only")


def make_folder(path: Path) -> None:
    """Make the output folder and its parents. Raises ``InputError`` naming ``path``."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made a folder: {error.strerror}") from error


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder that is gone afterwards, also when the command is interrupted in between."""
    with undivided():
        folder = tempfile.TemporaryDirectory(prefix="certify-")
        unfinished(Path(folder.name))
    with folder:
        yield Path(folder.name)
    finished(Path(folder.name))


def _staged(path: Path, data: bytes) -> Path:
    """The data in a temporary file beside ``path``, on the disk."""
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name[:40]}.", dir=path.parent)
    temporary = Path(name)
    unfinished(temporary)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o644)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    return temporary
