"""Output files appear whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from certify.files import make_folder, require_writable, write_atomically
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


def test_missing_folder_is_named_before_the_work_starts(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "certificate.json"
    with pytest.raises(InputError, match=r"certificate\.json: cannot be written: its folder does not exist"):
        require_writable(path)


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
