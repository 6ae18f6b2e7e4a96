"""Checks that paths are local, and writes files atomically: first to a temporary file, then moved into place."""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePath

from camssf.errors import InvalidArgument

PHOTO = (b"II*\0", b"MM\0*")
KINDS = dict.fromkeys(PHOTO, "a photo (DNG or TIFF)") | {
    b"\x89PNG": "a picture (PNG)", b"\xff\xd8\xff": "a picture (JPEG)", b"PK\x03\x04": "an archive (.npz or .zip)",
    b"PAR1": "Parquet", b"%PDF": "a PDF", b"-----BEGIN": "a key (PEM)", b"<": "a page",
}  # fmt: skip
"""Kinds of file by their first bytes."""


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
        InvalidArgument: it is a URL.
    """
    check_local(path)
    return Path(path)


def check_local(words: str | os.PathLike[str]) -> None:
    """Check that a text is not a URL; it need not be a path: a lamp's name, or `nano24:mine.csv`.

    Raises:
        InvalidArgument: it is a URL.
    """
    text = str(words)
    found = _URL.match(text)
    if found is None or (found[2] != "//" and not isinstance(words, PurePath)):
        return
    url = text if found[2] == "//" else f"{found[1]}:{'///' if found[1] == 'file' else '//'}{text[found.end() :]}"
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
    for each in (folder, *folder.parents):
        with suppress(OSError, ValueError):
            if each.exists() and not each.is_dir():
                raise InvalidArgument(f"{each} is a file; a folder is needed here.", "Name a folder.")
    return folder


def error_in_words(error: OSError | ValueError | OverflowError) -> str:
    """The system's words for a failed access, without number and path."""
    return getattr(error, "strerror", None) or str(error)


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
    with write_aside(path) as aside, open(aside, "r+b") as stream:
        _fill(stream.fileno(), content)


@contextmanager
def write_aside(path: Path | str) -> Iterator[Path]:
    """A new file beside another one, for the work within to fill; then it is moved into its place.

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
        handle, name = tempfile.mkstemp(prefix=".camssf-", dir=path.absolute().parent)
        os.close(handle)
        aside = Path(name)
        try:
            yield aside
            with open(aside, "r+b") as stream:
                os.fsync(stream.fileno())  # before it replaces another file
            os.chmod(aside, 0o644)  # with mkstemp's 0600, other users could not read the file
            os.replace(aside, path)
        except BaseException:
            aside.unlink(missing_ok=True)
            raise
    except (OSError, ValueError) as error:
        raise InvalidArgument(
            f"{path} cannot be written ({error_in_words(error)}).", f"{write_advice(error)}; nothing was changed."
        ) from error


def write_files(folder: Path | str, contents: Mapping[str, bytes | str | None]) -> list[Path]:
    """Write the files of a folder, all or none. On any failure the folder is as it was before.

    Args:
        folder: created if it does not exist.
        contents: by name; text as UTF-8; None removes the file.

    Returns:
        The files that were written.

    Raises:
        InvalidArgument: the folder cannot be written to.
    """
    folder = local_folder(folder)
    try:
        with made_folder(folder):
            _exchange(folder, contents)
    except (OSError, ValueError) as error:
        raise InvalidArgument(
            f"{folder} cannot be written to ({error_in_words(error)}).",
            f"{write_advice(error)}; nothing was left behind.",
        ) from error
    return [folder / name for name, content in contents.items() if content is not None]


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


def _exchange(folder: Path, contents: Mapping[str, bytes | str | None]) -> None:
    """Write to a temporary folder, then move the files into place; on failure restore the old ones."""
    beside = Path(tempfile.mkdtemp(prefix=".camssf-", dir=folder))
    committing = False
    try:
        for name, content in contents.items():
            if (folder / name).is_dir():
                raise IsADirectoryError(errno.EISDIR, f"{name} is a folder there")
            if (folder / name).is_file():
                shutil.copy2(folder / name, beside / f"old-{name}")
            if content is not None:
                with open(beside / name, "xb") as stream:
                    _fill(stream.fileno(), content)
                    os.fsync(stream.fileno())
        committing = True
        for name, content in contents.items():
            if content is None:
                (folder / name).unlink(missing_ok=True)
            else:
                os.replace(beside / name, folder / name)
    except BaseException:
        for name in contents if committing else ():
            if (beside / f"old-{name}").exists():
                os.replace(beside / f"old-{name}", folder / name)
            elif (folder / name).is_file():
                (folder / name).unlink()
        raise
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _fill(handle: int, content: bytes | str) -> None:
    """Write the whole content."""
    rest = memoryview(readable(content).encode() if isinstance(content, str) else content)
    while rest:
        rest = rest[os.write(handle, rest) :]
