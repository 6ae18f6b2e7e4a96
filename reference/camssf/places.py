"""Files and folders in object stores as well as on disks: `s3://`, `gs://`, `az://`, `memory://`.

A place is a `Path`, or for a URL a `upath.UPath`, which has the same methods. The stores' own libraries find the
credentials, in their environment variables and files; a URL that holds one is refused, so none gets into a document.
"""

from __future__ import annotations

import os
import posixpath
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

from camssf.errors import InvalidArgument
from camssf.files import check_local, local, local_folder, write_file
from camssf.libraries import library

Place: TypeAlias = Path
"""Also a UPath, which is not a subclass."""

STORES = {"s3": "s3fs", "gs": "gcsfs", "az": "adlfs", "memory": "fsspec"}
"""Libraries by the scheme of a URL; the extra that installs each has the scheme's name, that of memory is `s3`."""
_URL = re.compile(r"\s*([a-z0-9]+)://(.*)", re.DOTALL)


def is_remote(path: str | os.PathLike[str]) -> bool:
    """Whether it is a URL of an object store."""
    found = _URL.match(str(path))
    return found is not None and found[1] in STORES


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


def storage_options(folder: Place) -> dict[str, str] | None:
    """Options of `deltalake`: on S3 a commit is a conditional put, so that of two writers one fails."""
    return {"aws_conditional_put": "etag"} if str(folder).startswith("s3://") else None


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


def files_below(folder: Place) -> Iterator[Place]:
    """All files in a folder and its folders."""
    if is_remote(folder):
        fs, scheme = folder.fs, str(folder).partition("://")[0]  # type: ignore[attr-defined]
        yield from (place(f"{scheme}://{name.lstrip('/')}") for name in fs.find(folder.path))  # type: ignore[attr-defined]
    else:
        yield from (path for path in folder.rglob("*") if path.is_file())


def joined(folder: Place, path: str) -> Place:
    """A path relative to a folder, with `..` resolved; a URL or an absolute path stands for itself."""
    if is_remote(path) or not is_remote(folder):
        return place(path) if is_remote(path) else folder / path
    scheme, _, rest = str(folder).partition("://")
    return place(f"{scheme}://{posixpath.normpath(posixpath.join(rest, path))}")


@contextmanager
def local_copy(path: Place) -> Iterator[Path]:
    """A local copy of a file for the work within; of a local file itself."""
    if not is_remote(path):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="camssf-") as folder:
        copy = Path(folder) / path.name
        with reached(path, "read"), path.open("rb") as source, copy.open("wb") as target:
            shutil.copyfileobj(source, target)
        yield copy


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
