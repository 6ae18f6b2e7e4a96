"""Files whole or not at all: written beside their places, then put there."""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from camssf.errors import InvalidArgument


def readable(text: str) -> str:
    """The text as UTF-8 can hold it: U+FFFD for a byte of a file's name that is no UTF-8, and for half a character.

    Python keeps such bytes as lone surrogates, which no encoding takes.
    """
    return re.sub("[\ud800-\udfff]", "\ufffd", text)


def write_file(path: Path | str, content: bytes | str) -> None:
    """Write one file; text as UTF-8. On any failure, Ctrl-C included, what stood there stays.

    Raises:
        InvalidArgument: it cannot be written there.
    """
    path = Path(path)
    try:
        handle, aside = tempfile.mkstemp(prefix=".camssf-", dir=path.absolute().parent)
        try:
            with os.fdopen(handle, "wb") as stream:
                _fill(stream.fileno(), content)
            os.chmod(aside, 0o644)  # mkstemp's 0600 would shut other users out of an installation
            os.replace(aside, path)
        except BaseException:
            Path(aside).unlink(missing_ok=True)
            raise
    except (OSError, ValueError) as error:
        raise InvalidArgument(
            f"{path} cannot be written ({getattr(error, 'strerror', None) or error}).",
            "Free some space, or choose a place that you may write to; nothing was changed.",
        ) from error


def write_files(folder: Path | str, contents: Mapping[str, bytes | str | None]) -> list[Path]:
    """Write the files of a folder, all or none; None removes one. On any failure the folder is as it was before.

    Args:
        folder: made where it does not exist.
        contents: by name; text as UTF-8.

    Returns:
        The files that were written.

    Raises:
        InvalidArgument: the folder cannot be written to.
    """
    folder = Path(folder)
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _exchange(folder, contents)
    except BaseException as error:
        for path in made:
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        if isinstance(error, (OSError, ValueError)):
            raise InvalidArgument(
                f"{folder} cannot be written to ({getattr(error, 'strerror', None) or error}).",
                "Free some space or choose another output folder; nothing was left behind.",
            ) from error
        raise
    return [folder / name for name, content in contents.items() if content is not None]


def _exchange(folder: Path, contents: Mapping[str, bytes | str | None]) -> None:
    """Write beside, then replace; on failure put the old files back."""
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
    """All of it, on the disk before anything is replaced by it."""
    rest = memoryview(readable(content).encode() if isinstance(content, str) else content)
    while rest:
        rest = rest[os.write(handle, rest) :]
    os.fsync(handle)
