"""Files whole or not at all. Several at once are tested where they are used: tests/test_report.py."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import Any

import pytest

from camssf.errors import InvalidArgument
from camssf.files import write_file, write_files

pytestmark = pytest.mark.requirement("R-WHOLE-FILES")


@pytest.mark.parametrize("content", [b"\x00bytes", "words, ψ", b"", b"x" * 3_000_000])
def test_a_file_is_what_was_written(tmp_path: Path, content: bytes | str) -> None:
    path = tmp_path / "file"
    for _ in range(2):
        write_file(path, content)
        assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("call", ["write", "fsync", "chmod", "replace"])
@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_leaves_what_stood_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str, error: BaseException
) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")

    def failing(*_: Any) -> Any:
        raise error

    monkeypatch.setattr(os, call, failing)
    with pytest.raises(InvalidArgument if isinstance(error, OSError) else KeyboardInterrupt) as caught:
        write_file(path, b"new")
    monkeypatch.undo()
    if isinstance(caught.value, InvalidArgument):
        assert "No space left on device" in str(caught.value)
        assert caught.value.advice
    assert path.read_bytes() == b"old"
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_a_disk_that_takes_less_at_a_time_still_gets_it_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.write
    monkeypatch.setattr(os, "write", lambda handle, data: real(handle, data[:7]))
    write_file(tmp_path / "file", bytes(range(100)))
    monkeypatch.undo()
    assert (tmp_path / "file").read_bytes() == bytes(range(100))


@pytest.mark.parametrize("place", ["missing/file", "folder", "a\0b"])
def test_a_place_that_cannot_be_is_refused(tmp_path: Path, place: str) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(InvalidArgument, match="cannot be written"):
        write_file(tmp_path / place, b"")
    assert [each.name for each in tmp_path.iterdir()] == ["folder"]


def test_none_removes_and_the_rest_is_written(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    assert write_files(folder, {"a": b"1", "b": "2", "c": None}) == [folder / "a", folder / "b"]
    assert write_files(folder, {"a": None, "c": b"3"}) == [folder / "c"]
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {"b": b"2", "c": b"3"}
