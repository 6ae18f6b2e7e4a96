"""Files and folders in object stores as well as on disks: `s3://`, `gs://`, `az://`, `memory://`.

A place is a `Path`, or for a URL a `upath.UPath`, which has the same methods. The stores' own libraries find the
credentials, in their environment variables and files; a URL that holds one is refused, so none gets into a document.
"""

from __future__ import annotations

import os
import posixpath
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeAlias

from camssf.errors import InvalidArgument
from camssf.files import ASIDE, check_local, local, local_folder, temporary_folder, write_file
from camssf.libraries import library

Place: TypeAlias = Path
"""Also a UPath, which is not a subclass."""

STORES = {"s3": "s3fs", "gs": "gcsfs", "az": "adlfs", "memory": "fsspec"}
"""Libraries by the scheme of a URL; the extra that installs each has the scheme's name, that of memory is `s3`."""
PICTURES = (".png", ".tif", ".tiff")
"""Mosaics as pictures, which a file beside them describes (`photo.read.unit`)."""
_URL = re.compile(r"\s*([a-z0-9]+)://(.*)", re.DOTALL)


def is_remote(path: str | os.PathLike[str]) -> bool:
    """Whether it is a URL of an object store."""
    match = _URL.match(str(path))
    return match is not None and match[1] in STORES


def place(path: str | os.PathLike[str]) -> Place:
    """The place of a path or of a URL.

    Raises:
        InvalidArgument: another kind of URL, one with credentials, or its library is missing.
    """
    if not is_remote(path):
        return local(path)
    url = str(path).strip()
    scheme, _, rest = url.partition("://")
    if re.search(r"[?#@]", rest):
        raise InvalidArgument(
            f"{scheme}://{re.sub(r'.*@|[?#].*', '', rest)} was given with a user, a query or a fragment.",
            "Leave it out; credentials come from the environment or the files of the store's own tools.",
        )
    extra = "s3" if scheme == "memory" else scheme
    library(STORES[scheme], f"{scheme}:// needs", extra)
    return library("upath", f"{scheme}:// needs", extra).UPath(url, use_listings_cache=False)  # type: ignore[no-any-return]


def folder_place(path: str | os.PathLike[str]) -> Place:
    """The place of a folder to write into; it need not exist yet.

    Raises:
        InvalidArgument: as `place`, or it or one of its parents is a file.
    """
    return place(path) if is_remote(path) else local_folder(path)


def check_place(words: str) -> None:
    """Check that a text is no URL but that of an object store."""
    if not is_remote(words):
        check_local(words)


def write_place(path: Place, content: bytes) -> None:
    """Write one file, whole or not at all; folders are made.

    Raises:
        InvalidArgument: it cannot be written.
    """
    if not is_remote(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidArgument(f"{path} cannot be written ({error.strerror}).", "Name another folder.") from error
        write_file(path, content)
        return
    with reached(path, "written"):
        path.write_bytes(content)


def touch(path: Place) -> None:
    """Make an empty file and its folders; unlike `write_place` it may be lost if the machine stops.

    Raises:
        InvalidArgument: it cannot be written.
    """
    if is_remote(path):
        write_place(path, b"")
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    except OSError as error:
        raise InvalidArgument(f"{path} cannot be written ({error.strerror}).", "Name another folder.") from error


def file_system(folder: Place, sizes: Mapping[str, int]) -> Any:
    """A file system of `fsspec` for files that never change; as it has their sizes, it asks the store for none.

    Args:
        folder: the place of a store.
        sizes: bytes by URL.
    """
    fs = type(folder.fs)(use_listings_cache=True)  # type: ignore[attr-defined]  # one a process: each reads for 0.5 s
    listing: dict[str, dict[str, Any]] = {}
    for url, size in sizes.items():
        name = url.partition("://")[2]
        entry: dict[str, Any] = {"name": name, "Key": name, "size": size, "type": "file", "StorageClass": "STANDARD"}
        entry |= dict.fromkeys(("LastModified", "last_modified", "mtime"), datetime.fromtimestamp(0, UTC))
        listing.setdefault(name.rpartition("/")[0], {})[name] = entry
    for parent, entries in listing.items():
        known = {entry["name"]: entry for entry in fs.dircache.get(parent, [])}
        fs.dircache[parent] = list((known | entries).values())
    return fs


def files_below(folder: Place) -> Iterator[Place]:
    """All files in a folder and its folders, without what a write has only prepared."""
    if is_remote(folder):
        fs, scheme = folder.fs, str(folder).partition("://")[0]  # type: ignore[attr-defined]
        yield from (place(f"{scheme}://{name.lstrip('/')}") for name in fs.find(folder.path))  # type: ignore[attr-defined]
    else:
        inner = (path for path in folder.rglob("*") if path.is_file())
        yield from (path for path in inner if ASIDE not in path.relative_to(folder).as_posix())


def join(folder: Place, path: str) -> str:
    """A path relative to a folder; a URL or an absolute path stands for itself."""
    if is_remote(path):
        return path.strip()
    if not is_remote(folder) or os.path.isabs(path):
        return str(folder / path) if not is_remote(folder) else path
    scheme, _, rest = str(folder).partition("://")
    return f"{scheme}://{posixpath.normpath(posixpath.join(rest, path))}"


def relative(file: Place, folder: Place) -> str:
    """The path of a file relative to a folder, if both are on disks or in one bucket; else the whole path or URL."""
    if not (is_remote(file) or is_remote(folder)):
        name = os.path.realpath(file)  # symbolic links resolved in both
        try:
            return Path(os.path.relpath(name, os.path.realpath(folder))).as_posix()
        except ValueError:  # on another drive
            return Path(name).as_posix()
    one, other = (str(place).split("/") for place in (file, folder))
    if one[:3] != other[:3]:
        return str(file if is_remote(file) else file.absolute())
    return posixpath.relpath("/".join(one[3:]) or ".", "/".join(other[3:]) or ".")


def absolute(folder: Place) -> Place:
    """The same place for a process with another working folder."""
    return folder if is_remote(folder) else folder.absolute()


def remove(folder: Place) -> None:
    """Remove a folder with its files, if it can be done."""
    with suppress(Exception):
        if is_remote(folder):
            folder.fs.rm(folder.path, recursive=True)  # type: ignore[attr-defined]
        else:
            shutil.rmtree(folder)


def fetch(path: Place, folder: Path) -> Path:
    """Copy a file of an object store into a local folder, with the file beside it that describes a picture.

    Raises:
        InvalidArgument: it cannot be read.
    """
    folder.mkdir(parents=True, exist_ok=True)
    copy = folder / path.name
    with reached(path, "read"):
        with path.open("rb") as source, copy.open("wb") as target:
            shutil.copyfileobj(source, target)
        sidecar = path.with_name(f"{path.name}.json")
        if path.suffix.casefold() in PICTURES and sidecar.is_file():
            (folder / sidecar.name).write_bytes(sidecar.read_bytes())
    return copy


@contextmanager
def local_copy(path: Place) -> Iterator[Path]:
    """A local copy of a file for the work within; of a local file itself."""
    if not is_remote(path):
        yield path
        return
    with temporary_folder() as folder:
        yield fetch(path, folder)


@contextmanager
def reached(path: Place, what: str) -> Iterator[None]:
    """Turn the errors of an object store's libraries into InvalidArgument; `what` completes "cannot be ..."."""
    try:
        yield
    except InvalidArgument:
        raise
    except Exception as error:
        if not is_remote(path):
            raise
        raise InvalidArgument(
            f"{path} cannot be {what} ({without_secrets(error)}).",
            "Check the address, the credentials and the network.",
        ) from error


def without_secrets(error: BaseException) -> str:
    """The first line of an error, at most 200 characters, without the values of credentials in the environment."""
    text = str(error).partition("\n")[0] or type(error).__name__
    for name, value in os.environ.items():
        if len(value) >= 8 and re.search("KEY|SECRET|TOKEN|PASSWORD|SAS|CREDENTIAL", name.upper()):
            text = text.replace(value, "***")
    return text[:200]
