"""Output files appear whole or not at all, those of one folder together."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from certify.files import make_folder, require_folder, require_writable, write_atomically, write_together
from symbolic.errors import InputError


def test_file_is_replaced_whole_and_nothing_else_is_left(tmp_path: Path) -> None:
    path = tmp_path / "certificate.json"
    path.write_text("old")
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["certificate.json"]


def test_old_file_survives_a_failed_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "certificate.json"
    path.write_text("old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match=r"certificate\.json: cannot be written: No space left on device"):
        write_atomically(path, b"new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["certificate.json"]


def test_folder_in_place_of_a_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"{tmp_path}: cannot be written: it is a folder"):
        write_atomically(tmp_path, b"")


def test_place_that_cannot_become_a_folder_is_named_before_the_work_starts(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"c\.json: cannot be written: .*file is not a folder"):
        require_writable(tmp_path / "file" / "deeper" / "c.json")
    with pytest.raises(InputError, match=r"deeper: cannot be made a folder: .*file is not a folder"):
        require_folder(tmp_path / "file" / "deeper")


def test_missing_folders_are_made_with_the_file(tmp_path: Path) -> None:
    path = tmp_path / "new" / "deeper" / "c.json"
    require_writable(path)
    assert os.listdir(tmp_path) == []
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"


def test_files_of_a_folder_change_together(tmp_path: Path) -> None:
    (tmp_path / "old").write_text("old")
    (tmp_path / "gone").write_text("old")
    write_together(tmp_path, {"old": b"new", "more": b"new", "gone": None, "never": None})
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"old": "new", "more": "new"}


def test_no_file_of_a_folder_changes_if_one_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    full = iter([None, OSError(28, "No space left on device")])

    def second_fails(descriptor: int) -> None:
        error = next(full)
        if error is not None:
            raise error

    (tmp_path / "first").write_text("old")
    monkeypatch.setattr(os, "fsync", second_fails)
    with pytest.raises(InputError, match="second: cannot be written: No space left"):
        write_together(tmp_path, {"first": b"new", "second": b"new"})
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="folder: cannot be written: it is a folder"):
        write_together(tmp_path, {"first": b"new", "folder": b"new"})
    assert (tmp_path / "first").read_text() == "old"
    assert sorted(os.listdir(tmp_path)) == ["first", "folder"]


def test_writable_place_passes_and_stays_untouched(tmp_path: Path) -> None:
    require_writable(tmp_path / "certificate.json")
    assert os.listdir(tmp_path) == []


def test_file_in_place_of_a_folder_is_named(tmp_path: Path) -> None:
    path = tmp_path / "out"
    path.write_text("")
    with pytest.raises(InputError, match="out: cannot be made a folder"):
        make_folder(path)


def test_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
