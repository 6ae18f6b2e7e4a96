"""Checks that paths are local, and writes files all or none: first into a folder aside, then moved into place.

Files that belong together are moved one after another. The folder aside therefore holds a file COMMIT while they are
moved: if the process is killed then, whoever reads or writes the folder next moves the rest (`settle`). Before that,
the folder aside is only a leftover, which the next writer removes. A lock, which the system frees when a process
ends, tells a killed writer from a running one.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePath

from camssf.errors import InvalidArgument

PHOTO = (b"II*\0", b"MM\0*")
KINDS = dict.fromkeys(PHOTO, "a photo (DNG or TIFF)") | {
    b"\x89PNG": "a picture (PNG)", b"\xff\xd8\xff": "a picture (JPEG)", b"PK\x03\x04": "an archive (.npz or .zip)",
    b"PAR1": "Parquet", b"%PDF": "a PDF", b"-----BEGIN": "a key (PEM)", b"<": "a page",
}  # fmt: skip
"""Kinds of file by their first bytes."""

ASIDE, MOVING = ".camssf-new-", ".camssf-moving"
"""Begin of the name of a folder aside; name of a file that says that files are being moved into its folder."""
LOCK, COMMIT, NEW, OLD, GONE = "lock", "commit", "new", "old", "gone"
"""What a folder aside holds: GONE has an empty file for each one to be removed, OLD what is replaced or removed."""
PATIENCE = 5.0
"""Seconds to wait for another process that is moving files."""


def kind_of(data: bytes) -> str | None:
    """The kind of a file in words, for error messages; None if its first bytes are not known."""
    return next((words for begin, words in KINDS.items() if data.startswith(begin)), None)


def readable(text: str) -> str:
    """The text with U+FFFD for each lone surrogate, so that it can be encoded as UTF-8.

    Python represents bytes of a file name that are not UTF-8 as lone surrogates.
    """
    return re.sub("[\ud800-\udfff]", "\ufffd", text)


_URL = re.compile(r"\s*([A-Za-z][A-Za-z0-9+.-]+):(//|[/\\])")
"""The scheme of a URL: two letters or more, to exclude drives of Windows. A Path reduces the two slashes to one."""


def local(path: str | os.PathLike[str]) -> Path:
    """The path of a local file or folder. Every function with a path argument calls this.

    Raises:
        InvalidArgument: it is empty or a URL, or an interrupted write of its folder cannot be finished.
    """
    check_local(path)
    if not str(path).strip():
        raise InvalidArgument("A path is empty.", "Name a file or a folder; this folder is `.`.")
    path = Path(path)
    if os.path.exists(path.parent / MOVING):
        settle(path.parent)
    return path


def check_local(words: str | os.PathLike[str]) -> None:
    """Check that a text is not a URL; it need not be a path: a lamp's name, or `nano24:mine.csv`.

    Raises:
        InvalidArgument: it is a URL.
    """
    text = str(words)
    match = _URL.match(text)
    if match is None or (match[2] != "//" and not isinstance(words, PurePath)):
        return
    url = text if match[2] == "//" else f"{match[1]}:{'///' if match[1] == 'file' else '//'}{text[match.end() :]}"
    raise InvalidArgument(
        f"{url.strip()} is a URL; camssf reads and writes local files only.",
        "Copy it here first, or write into a local folder and copy the results from there.",
    )


def local_folder(path: str | os.PathLike[str]) -> Path:
    """The path of a folder to write into; it need not exist yet.

    Raises:
        InvalidArgument: it is a URL, or it or one of its parents is a file.
    """
    folder = local(path)
    for place in (folder, *folder.parents):
        with suppress(OSError, ValueError):
            if place.exists() and not place.is_dir():
                raise InvalidArgument(f"{place} is a file; a folder is needed here.", "Name a folder.")
    if "\0" in str(folder):
        raise InvalidArgument(f"{str(folder)!r} cannot be a folder.", "Name a folder.")
    if os.path.exists(folder / MOVING):
        settle(folder)
    return folder


def error_in_words(error: OSError | ValueError | OverflowError) -> str:
    """The system's words for a failed access, without number and path."""
    return getattr(error, "strerror", None) or str(error)


def read_advice(error: OSError | ValueError) -> str:
    """Advice for a failure to open a file."""
    if isinstance(error, IsADirectoryError):
        return "Name a file, not a folder."
    return "Check its permissions." if isinstance(error, PermissionError) else "Check the path."


def write_advice(error: OSError | ValueError) -> str:
    """Advice for a failure to write."""
    if isinstance(error, IsADirectoryError):
        return "Name a file"
    if isinstance(error, FileNotFoundError):
        return "Make its folder first, or name another"
    number = getattr(error, "errno", None)
    short = isinstance(error, OSError) and number is None  # a short write of NumPy's tofile
    if short or number in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return "Free some space, or choose another place"
    return "Choose a place that you may write to"


def write_file(path: Path | str, content: bytes | str) -> None:
    """Write one file; text as UTF-8. On any failure, Ctrl-C included, an existing file stays unchanged.

    Raises:
        InvalidArgument: it cannot be written there.
    """
    with write_aside(path) as aside:
        _create(aside, content)


@contextmanager
def write_aside(path: Path | str) -> Iterator[Path]:
    """The path of a new file, which the work within writes; then it is moved into the place of another one.

    On any failure, Ctrl-C included, an existing file stays unchanged.

    Raises:
        InvalidArgument: it cannot be written there.
    """
    path = local(path)
    local_folder(path.parent)
    try:
        if path.exists() and not path.is_file():  # to replace a device would destroy it
            kind = "a folder" if path.is_dir() else "a device or a pipe"
            raise InvalidArgument(f"{path} cannot be written (it is {kind}).", "Name a file; nothing was changed.")
        with _folder_aside(path.absolute().parent) as folder:
            aside = folder / NEW / path.name
            yield aside
            _flush(aside)
            os.replace(aside, path)
    except (OSError, ValueError) as error:
        raise InvalidArgument(
            f"{path} cannot be written ({error_in_words(error)}).", f"{write_advice(error)}; nothing was changed."
        ) from error


def write_files(folder: Path | str, contents: Mapping[str, bytes | str | None]) -> list[Path]:
    """Write the files of a folder, all or none (`write_together`).

    Args:
        folder: created if it does not exist.
        contents: by name; text as UTF-8; None removes the file.

    Returns:
        The files that were written.

    Raises:
        InvalidArgument: the folder cannot be written to.
    """
    with write_together(folder, [name for name, content in contents.items() if content is None]) as aside:
        for name, content in contents.items():
            if content is not None:
                _create(aside / name, content)
    return [Path(folder) / name for name, content in contents.items() if content is not None]


@contextmanager
def write_together(folder: Path | str, remove: Iterable[str] = ()) -> Iterator[Path]:
    """A new folder, which the work within fills; then its files, also those in folders, go to `folder`, all or none.

    Other files of `folder` stay. On any failure, Ctrl-C included, it is as it was before. If the process is killed,
    every reader that calls `local` and every later write find all old files or all new ones.

    Args:
        folder: created if it does not exist.
        remove: names of files in `folder` to remove.

    Raises:
        InvalidArgument: the folder cannot be written to.
    """
    folder = local_folder(folder)
    try:
        with made_folder(folder), _folder_aside(folder) as aside:
            yield aside / NEW
            _commit(aside, [Path(name) for name in remove])
    except OSError as error:
        raise InvalidArgument(
            f"{folder} cannot be written to ({error_in_words(error)}).",
            f"{write_advice(error)}; nothing was left behind.",
        ) from error


def settle(folder: Path) -> None:
    """Finish what a killed process had begun to move into a folder, and remove what it had only prepared.

    What a running process prepares is left alone; one that is moving files is waited for.

    Raises:
        InvalidArgument: it cannot be finished.
    """
    for aside in folder.glob(f"{ASIDE}*"):
        try:
            lock = os.open(aside / LOCK, os.O_RDWR | os.O_CREAT)
            until = time.monotonic() + PATIENCE
            while not (free := _locked(lock)) and os.path.exists(aside / COMMIT) and time.monotonic() < until:
                time.sleep(0.01)
            try:
                if free and os.path.exists(aside / COMMIT):
                    _move(aside)
            finally:
                _release(aside, lock, free)
        except OSError as error:
            if os.path.exists(aside / COMMIT):
                raise InvalidArgument(
                    f"Writing to {folder} was interrupted, and cannot be finished ({error_in_words(error)}).",
                    f"{write_advice(error)}, then run the same command again.",
                ) from error
    _unmark(folder)


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Make a folder for the work within; if that fails, the folders that were made and are empty go again."""
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for path in made:
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        raise


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder for the work within, in the system's folder for temporary files.

    Raises:
        InvalidArgument: it cannot be made.
    """
    try:
        folder = tempfile.TemporaryDirectory(prefix="camssf-", ignore_cleanup_errors=True)
    except OSError as error:
        raise InvalidArgument(
            f"There is no room for temporary files ({error_in_words(error)}).",
            "Free some space, or set TMPDIR to a folder that you may write to.",
        ) from error
    with folder as name:
        yield Path(name)


@contextmanager
def _folder_aside(folder: Path) -> Iterator[Path]:
    """A locked folder aside, to be removed afterwards."""
    settle(folder)
    while True:
        aside = folder / f"{ASIDE}{secrets.token_hex(4)}"
        aside.mkdir()
        with suppress(FileNotFoundError):  # another process may take it for a leftover before it is locked
            lock = os.open(aside / LOCK, os.O_RDWR | os.O_CREAT)
            if _locked(lock) and os.path.exists(aside / LOCK):
                break
            os.close(lock)
    try:
        (aside / NEW).mkdir()
        yield aside
    finally:
        _release(aside, lock, True)


def _release(aside: Path, lock: int, mine: bool) -> None:
    """Close the lock of a folder aside; remove it if it is this process's, unless its files must still be moved."""
    remove = mine and not os.path.exists(aside / COMMIT)
    if remove:
        shutil.rmtree(aside, ignore_errors=True)
    os.close(lock)
    if remove:
        shutil.rmtree(aside, ignore_errors=True)  # Windows removes no open file, here the lock
        _unmark(aside.parent)


def _unmark(folder: Path) -> None:
    """Remove MOVING, if there is no folder aside."""
    with suppress(OSError):
        if os.path.exists(folder / MOVING) and not any(folder.glob(f"{ASIDE}*")):
            (folder / MOVING).unlink()


def _locked(handle: int) -> bool:
    """Lock an open file, if no other process has; True also where the file system knows no locks."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return True
    return True


def _commit(aside: Path, remove: list[Path]) -> None:
    """Move the new files of a folder aside into its folder; on a failure restore the old ones."""
    folder, new, old = aside.parent, aside / NEW, aside / OLD
    names = [path.relative_to(new) for path in sorted(new.rglob("*")) if path.is_file()]
    for name in names:
        _flush(new / name)
    (aside / GONE).mkdir()
    for name in remove:
        (aside / GONE / name).touch()
    for name in (*names, *remove):
        if (folder / name).is_dir():
            raise IsADirectoryError(errno.EISDIR, f"{name} is a folder there")
        if (folder / name).is_file():
            (old / name).parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(folder / name, old / name)
            except OSError:  # a file system without links
                shutil.copy2(folder / name, old / name)
    (folder / MOVING).touch()
    try:
        (aside / COMMIT).touch()
        _move(aside)
    except BaseException:
        for name in remove:
            (aside / GONE / name).touch()
        for name in names:
            if not (new / name).exists():
                os.replace(folder / name, new / name)
        for name in (*names, *remove):
            if (old / name).exists():
                os.replace(old / name, folder / name)
        (aside / COMMIT).unlink(missing_ok=True)
        raise


def _move(aside: Path) -> None:
    """Move the new files of a folder aside, but for those moved already, and remove what is to go."""
    folder, new = aside.parent, aside / NEW
    for path in sorted(new.rglob("*")):
        if path.is_file():
            target = folder / path.relative_to(new)
            target.parent.mkdir(parents=True, exist_ok=True)
            os.replace(path, target)
    for path in (aside / GONE).iterdir():
        (folder / path.name).unlink(missing_ok=True)
        path.unlink()
    (aside / COMMIT).unlink()


def _create(path: Path, content: bytes | str) -> None:
    """Write a new file; the umask decides its mode."""
    rest = memoryview(readable(content).encode() if isinstance(content, str) else content)
    with open(path, "xb", buffering=0) as stream:
        while rest:
            rest = rest[os.write(stream.fileno(), rest) :]


def _flush(path: Path) -> None:
    """Have a file on the disk, before it replaces another one."""
    with open(path, "r+b") as stream:
        os.fsync(stream.fileno())
