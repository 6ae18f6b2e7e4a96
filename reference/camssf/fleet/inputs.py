"""What a job is made from: by contents where a result is named after them, by size and time where none is read."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import TypeAlias

from camssf.curves.basis import NAMES, read_basis
from camssf.errors import InvalidArgument
from camssf.files import PHOTO, check_local, kind_of, local
from camssf.photo.sidecar import sidecar_of

Stamp: TypeAlias = tuple[int, int]
"""A file's size, bytes, and its time, ns."""

_known: dict[str, tuple[Stamp, str]] = {}


def is_file(path: Path) -> bool:
    """A name that no file can have is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def check_manifest(path: Path, begin: bytes) -> None:
    """Raise where a file that begins so can be no manifest."""
    kind = kind_of(begin)
    if kind is not None:
        advice = "Write a CSV file that names it: one row a photo." if begin.startswith(PHOTO) else "Give a CSV file."
        raise InvalidArgument(f"{path} is {kind}, not a manifest.", advice)


def urls_among(cells: Iterable[str]) -> list[str]:
    """What is wrong with the first cell of a manifest that is a URL: below its folder it would look like a path."""
    for cell in cells:
        for words in (cell, cell.partition(":")[2]):  # nano24:https://...
            try:
                check_local(words)
            except InvalidArgument as error:
                return [f"{error.message} {error.advice}"]
    return []


def file_hash(path: Path) -> str:
    """SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def stamps(path: Path) -> list[Stamp | None]:
    """Of a file, and of its sidecar where it may have one and has; None of one that is not there."""
    beside = sidecar_of(path)
    return [stamp(path)] if beside is None else [stamp(path), stamp(beside)]


def stamp(path: Path) -> Stamp | None:
    """Of one file; None where it is not there."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_size, found.st_mtime_ns


def basis_path(spec: str) -> Path | None:
    """The file of a basis; None of a shipped one, which the version says.

    Raises:
        InvalidArgument: a URL.
    """
    path = local(spec)
    return path if spec not in (*NAMES, "auto") and is_file(path) else None


def basis_hash(spec: str) -> str | None:
    """SHA-256 of a basis' file, None of a shipped one; read once a process, and again when the file is another.

    What `read_basis` remembers of the file that stood there before is then forgotten: a cluster's worker outlives it.
    """
    path = basis_path(spec)
    mark = None if path is None else stamp(path)
    if path is None or mark is None:
        return None
    known = _known.get(spec)
    if known is None or known[0] != mark:
        known = _known[spec] = mark, file_hash(path)
        read_basis.cache_clear()
    return known[1]
