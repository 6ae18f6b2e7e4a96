"""Files whole or not at all, several all or none, whenever the process is killed. Failures: test_save.py."""

import errno
import os
import shutil
import signal
import stat
import sys
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from camssf.errors import InvalidArgument
from camssf.files import local, local_folder, write_file, write_files, write_together
from tests.support.failures import raising

pytestmark = pytest.mark.requirement("R-WHOLE-FILES")
URLS = ["s3://bucket/x", "gs://bucket/x", "http://host/x", "HTTPS://host/x", "file:///x", "az+blob://x", " s3://x"]


@pytest.mark.parametrize("content", [b"\x00bytes", "words, ψ", b"", b"x" * 3_000_000])
def test_a_file_is_what_was_written(tmp_path: Path, content: bytes | str) -> None:
    path = tmp_path / "file"
    for _ in range(2):
        write_file(path, content)
        assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("call", ["write", "fsync", "replace"])
@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_leaves_what_stood_there(tmp_path: Path, monkeypatch: Any, call: str, error: Any) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, call, raising(error))
    with pytest.raises(InvalidArgument if isinstance(error, OSError) else KeyboardInterrupt) as caught:
        write_file(path, b"new")
    monkeypatch.undo()
    assert isinstance(error, KeyboardInterrupt) or "No space left on device" in str(caught.value)
    assert path.read_bytes() == b"old"
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_a_disk_that_takes_less_at_a_time_still_gets_it_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.write
    monkeypatch.setattr(os, "write", lambda handle, data: real(handle, data[:7]))
    write_file(tmp_path / "file", bytes(range(100)))
    monkeypatch.undo()
    assert (tmp_path / "file").read_bytes() == bytes(range(100))


@pytest.mark.parametrize("path", [*(kind(url) for url in URLS for kind in (str, Path)), "", " ", "\t"], ids=repr)
def test_a_url_and_nothing_are_no_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: Any) -> None:
    monkeypatch.chdir(tmp_path)
    blank = not str(path).strip()
    words = "A path is empty" if blank else "://.* camssf reads and writes local files only"
    for call in (local, local_folder, lambda path: write_file(path, b""), lambda path: write_files(path, {"a": b""})):
        with pytest.raises(InvalidArgument, match=words) as caught:
            call(path)
        assert blank or "Copy it here first" in caught.value.advice
    assert not list(tmp_path.iterdir())


def test_the_advice_fits_the_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, advice in ((errno.ENOSPC, "Free some space"), (errno.EROFS, "that you may write to")):
        monkeypatch.setattr(os, "fsync", raising(OSError(number, os.strerror(number))))
        for call in (lambda: write_file(tmp_path / "a", b""), lambda: write_files(tmp_path, {"a": b""})):
            with pytest.raises(InvalidArgument) as caught:
                call()
            assert advice in caught.value.advice


@pytest.mark.parametrize(("place", "words", "advice"), [
    ("missing/file", "cannot be written", ""), ("a\0b", "cannot be written", ""),
    ("folder", "cannot be written.*it is a folder", "Name a file"), ("taken/a", "taken is a file", "Name a folder"),
])  # fmt: skip
def test_a_place_that_cannot_be_is_refused(tmp_path: Path, place: str, words: str, advice: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(InvalidArgument, match=words) as caught:
        write_file(tmp_path / place, b"")
    assert advice in caught.value.advice
    assert contents(tmp_path) == {"taken": b"mine"}


def test_none_removes_and_the_rest_is_written(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    assert write_files(folder, {"a": b"1", "b": "2", "c": None}) == [folder / "a", folder / "b"]
    assert write_files(folder, {"a": None, "c": b"3"}) == [folder / "c"]
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {"b": b"2", "c": b"3"}


@pytest.mark.parametrize("umask", [0o022, 0o002, 0o077])
@pytest.mark.skipif(os.name == "nt", reason="no umask there")
def test_the_umask_decides_who_may_read(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        write_file(tmp_path / "file", b"")
        write_files(tmp_path / "new" / "folder", {"a": b""})
    finally:
        os.umask(before)
    for path in tmp_path.rglob("*"):
        assert stat.S_IMODE(path.stat().st_mode) == (0o777 if path.is_dir() else 0o666) & ~umask, path


def contents(folder: Path) -> dict[str, bytes]:
    """The files below a folder by name."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


STEPS = ("open", "os.mkdir", "os.link", "os.rename", "os.remove", "os.rmdir")
"""Audit events before a file system may change."""


def killed_at_each_step(work: Callable[[], object], prepare: Callable[[], object]) -> Iterator[int]:
    """Do the work in processes, each of which is killed at its next of STEPS; ends when one survives."""
    for step in range(1000):
        prepare()
        child = os.fork()
        if child == 0:
            steps = count()

            def hook(event: str, _: Any, steps: Any = steps, step: int = step) -> None:
                if event in STEPS and next(steps) == step:
                    os.kill(os.getpid(), signal.SIGKILL)

            sys.addaudithook(hook)
            work()
            os._exit(0)
        if os.waitpid(child, 0)[1] == 0:
            return
        yield step


OLD = {"keep.txt": b"mine", "result.json": b"old", "ssf.csv": b"old", "gone": b"old"}
COMING = {"report.html": b"new", "result.json": b"new", "ssf.csv": b"new", "gone": None}
NEW = {"keep.txt": b"mine", "result.json": b"new", "ssf.csv": b"new", "report.html": b"new"}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork there")
@pytest.mark.full
@pytest.mark.parametrize("first", [False, True])
def test_a_kill_leaves_all_old_files_or_all_new_ones(tmp_path: Path, first: bool) -> None:
    """For whoever reads one file next, and for the next run, which leaves nothing else behind."""
    folder, old = tmp_path / "out", {} if first else OLD
    new = {name: content for name, content in (old | COMING).items() if content is not None}

    def prepare() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        write_files(folder, old)
        assert contents(folder) == old

    seen = set()
    for step in killed_at_each_step(lambda: write_files(folder, COMING), prepare):
        local(folder / "result.json")
        found = {name: data for name, data in contents(folder).items() if not name.startswith(".camssf")}
        assert found in (old, new), step
        seen.add(found == new)
        write_files(folder, {"other": b""})
        assert contents(folder) == found | {"other": b""}, step
    assert seen == {False, True}
    assert contents(folder) == new
    assert len(list(folder.iterdir())) == len(new)


@pytest.mark.full
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork there")
def test_a_kill_while_an_earlier_kill_is_mended(tmp_path: Path) -> None:
    folder = tmp_path / "out"

    def prepare() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        write_files(folder, OLD)
        if os.fork() == 0:
            sys.addaudithook(lambda event, words: event == "os.rename" and "ssf.csv" in str(words[0]) and os._exit(0))
            write_files(folder, COMING)
        os.wait()
        assert [contents(folder)[name] for name in ("result.json", "ssf.csv")] == [b"new", b"old"]

    for step in killed_at_each_step(lambda: local_folder(folder), prepare):
        local_folder(folder)
        assert contents(folder) == NEW, step
    assert contents(folder) == NEW


def test_a_running_writer_is_left_alone(tmp_path: Path) -> None:
    with write_together(tmp_path) as aside:
        (aside / "a").write_bytes(b"1")
        write_files(tmp_path, {"b": b"2"})
        assert local(tmp_path / "b").read_bytes() == b"2"
    assert contents(tmp_path) == {"a": b"1", "b": b"2"}
