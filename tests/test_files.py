"""Files whole or not at all. Several at once are tested where they are used: tests/test_report.py."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import Any

import pytest

from camssf.errors import InvalidArgument
from camssf.files import local, local_folder, write_file, write_files

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


URLS = ["s3://bucket/x", "gs://bucket/x", "http://host/x", "HTTPS://host/x", "file:///x", "az+blob://x", " s3://x"]


@pytest.mark.parametrize("url", URLS)
@pytest.mark.parametrize("kind", [str, Path])
def test_a_url_is_no_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, url: str, kind: Any) -> None:
    monkeypatch.chdir(tmp_path)
    for call in (local, local_folder, lambda path: write_file(path, b""), lambda path: write_files(path, {"a": b""})):
        with pytest.raises(InvalidArgument, match="camssf reads and writes local files only") as caught:
            call(kind(url))
        assert url.strip() in caught.value.message
        assert "Copy it here first" in caught.value.advice
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "path", ["s3", "a/s3:/x", "C:/photos", "C:\\photos", "D:5500", "nano24:/abs/mine.csv", "./x://y"]
)
def test_what_looks_like_a_url_only_from_afar(path: str) -> None:
    assert local(path) == Path(path)


def test_a_file_where_a_folder_should_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    for call in (
        lambda: write_files(tmp_path / "file", {"a": b""}),
        lambda: write_files(tmp_path / "file" / "below" / "it", {"a": b""}),
        lambda: write_file(tmp_path / "file" / "a", b""),
    ):
        with pytest.raises(InvalidArgument, match="file is a file") as caught:
            call()
        assert "Name a folder" in caught.value.advice
        assert "space" not in caught.value.advice
    assert (tmp_path / "file").read_text() == "mine"


def test_the_advice_fits_the_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(InvalidArgument, match="it is a folder") as caught:
        write_file(tmp_path / "folder", b"")
    assert "Name a file" in caught.value.advice
    for number, advice in ((errno.ENOSPC, "Free some space"), (errno.EROFS, "that you may write to")):

        def failing(*_: Any, number: int = number) -> None:
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr(os, "fsync", failing)
        for call in (lambda: write_file(tmp_path / "a", b""), lambda: write_files(tmp_path, {"a": b""})):
            with pytest.raises(InvalidArgument) as caught:
                call()
            assert advice in caught.value.advice


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
