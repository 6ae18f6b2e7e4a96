"""Identifies the input files of a job: by SHA-256 of their contents, or by size and time without reading them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import TypeAlias

from camssf.errors import InvalidArgument
from camssf.files import PHOTO, kind_of, local
from camssf.photo.read.unit import PIECE, sidecar_of
from camssf.places import Place, check_place, is_remote, place, reached
from camssf.spectra.charts import chart_parts
from camssf.spectra.lamps import is_lamp_name

Stamp: TypeAlias = tuple[int, int]
"""A file's size, bytes, and its modification time, ns."""

_basis_hashes: dict[str, str] = {}
"""The hash of each basis file that was read."""


def is_file(path: Path) -> bool:
    """Whether the path is a file; False too if the name is invalid on this system."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def check_manifest(path: Path, begin: bytes) -> None:
    """Raise InvalidArgument if the file's first bytes show that it is no manifest."""
    kind = kind_of(begin)
    if kind is not None:
        advice = "Write a CSV file that names it: one row a photo." if begin.startswith(PHOTO) else "Give a CSV file."
        raise InvalidArgument(f"{path} is {kind}, not a manifest.", advice)


def urls_among(cells: Iterable[str]) -> list[str]:
    """The error message for the first cell that is a URL, if any; joined to the folder it would look like a path."""
    for cell in cells:
        for text in (cell, cell.partition(":")[2]):  # nano24:https://...
            try:
                check_place(text)
            except InvalidArgument as error:
                return [f"{error.message} {error.advice}"]
    return []


def file_in(role: str, specification: str | None, home: Path = Path()) -> tuple[str, Place | None]:
    """The layout and the file of a specification, as in `nano24:mine.csv`; None if it names no file in `home`.

    The layout may itself be a file in `home`, as in `card.json:mine.csv`; then its path is returned.

    Args:
        role: "lamp" or "chart", whose known names go before files; anything else is always a file.
        specification: its name or file.
        home: the folder that paths are relative to.
    """
    text = specification or ""
    if is_remote(text):
        return "", place(text)
    layout, name = (
        chart_parts(text) if role == "chart" else ("", "" if role == "lamp" and is_lamp_name(text) else text)
    )
    if not name or not is_file(home / name):
        return "", None
    return str(layout_in(role, text, home) or layout), home / name


def layout_in(role: str, specification: str | None, home: Path = Path()) -> Path | None:
    """The layout file of a chart, as in `card.json:mine.csv`; None if there is no such file in `home`."""
    name = chart_parts(specification or "")[0] if role == "chart" else ""
    return home / name if name.casefold().endswith(".json") and is_file(home / name) else None


def file_hash(path: Place) -> str:
    """SHA-256 of a file."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(PIECE):
            digest.update(piece)
    return digest.hexdigest()


def stamps(path: Place) -> list[Stamp | None]:
    """Stamps of a file and, if it may have one, of its sidecar; None for a missing file."""
    sidecar = sidecar_of(path)
    return [stamp(path)] if sidecar is None else [stamp(path), stamp(sidecar)]


def stamp(path: Place) -> Stamp | None:
    """The stamp of one file; None if it is missing. In an object store its tag stands for the time."""
    if is_remote(path):
        with reached(path, "read"):
            try:
                info = path.fs.info(path.path)  # type: ignore[attr-defined]
            except FileNotFoundError:
                return None
            tag = next((info[name] for name in ("ETag", "etag", "LastModified", "created") if name in info), "")
            return int(info["size"]), int(hashlib.sha256(str(tag).encode()).hexdigest()[:15], 16)
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_size, status.st_mtime_ns


def basis_path(spec: str) -> Path | None:
    """The file of a basis; None for a shipped one, which the version identifies.

    Raises:
        InvalidArgument: the name is a URL.
    """
    from camssf.recovery.basis import NAMES

    path = local(spec)
    return path if spec not in (*NAMES, "auto") and is_file(path) else None


def basis_hash(spec: str) -> str | None:
    """SHA-256 of a basis file, None for a shipped one.

    A change clears the cache of `read_basis`, because a cluster's worker may live longer than the file.
    """
    from camssf.recovery.basis import read_basis

    path = basis_path(spec)
    if path is None:
        return None
    digest = file_hash(path)
    if _basis_hashes.setdefault(spec, digest) != digest:
        read_basis.cache_clear()
        _basis_hashes[spec] = digest
    return digest
