"""A process that is killed while it writes leaves the old file or the new one at the path, never a part."""

from __future__ import annotations

import os
import random
import signal
import time
from pathlib import Path

import pytest

from certify.files import write_atomically

OLD, NEW = b"a" * 3_000_000 + b"\n", b"b" * 2_000_000 + b"\n"


def _child(action: object) -> int:
    """A forked process that does the action and nothing else; its wait status."""
    child = os.fork()
    if child == 0:
        try:
            action()  # type: ignore[operator]  # a function without arguments
        finally:
            os._exit(0)
    return os.waitpid(child, 0)[1]


def _die(*_: object, **__: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize(
    ("moment", "left"),
    [
        ("tempfile.mkstemp", OLD),
        ("os.fdopen", OLD),
        ("os.fsync", OLD),
        ("pathlib.Path.chmod", OLD),
        ("pathlib.Path.replace", OLD),
    ],
)
def test_kill_at_every_stage_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str, left: bytes
) -> None:
    path = tmp_path / "certificate.json"
    path.write_bytes(OLD)
    monkeypatch.setattr(moment, _die)
    status = _child(lambda: write_atomically(path, NEW))
    assert os.WIFSIGNALED(status)
    assert path.read_bytes() == left
    assert all(name == path.name or name.startswith(f".{path.name}.") for name in os.listdir(tmp_path))


def test_kill_at_any_time_leaves_one_of_the_two(tmp_path: Path) -> None:
    path, rng, seen = tmp_path / "certificate.json", random.Random(0), set()
    path.write_bytes(OLD)
    for tried in range(200):
        if tried >= 40 and len(seen) == 2:
            break
        child = os.fork()
        if child == 0:
            while True:
                write_atomically(path, NEW)
                write_atomically(path, OLD)
        time.sleep(rng.uniform(0, 0.1))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        content = path.read_bytes()
        assert content in (OLD, NEW)
        seen.add(content[0])
    assert len(seen) == 2, "every kill came before the first write: the test shows nothing"


def test_a_file_that_never_was_is_not_there_in_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "report.pdf"
    monkeypatch.setattr(os, "fsync", _die)
    _child(lambda: write_atomically(path, NEW))
    assert not path.exists()


def test_interrupt_from_the_keyboard_removes_the_temporary_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(descriptor: int) -> None:
        raise KeyboardInterrupt

    path = tmp_path / "certificate.json"
    path.write_bytes(OLD)
    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, NEW)
    assert path.read_bytes() == OLD
    assert os.listdir(tmp_path) == [path.name]
