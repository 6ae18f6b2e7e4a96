"""Verifies a registry: files against their seals, rows against their checksums, documents against their rows."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from camssf.errors import InvalidArgument
from camssf.fleet.inputs import file_hash
from camssf.fleet.registry import DAMAGED, FOLDERS, IDENTITY, Registry
from camssf.fleet.rows import Row, checksum
from camssf.fleet.seals import LOG, SEALS, read_seal
from camssf.fleet.tables import Table, connection, row_batches
from camssf.places import Place, files_below, join, place


@dataclass(frozen=True)
class Verification:
    """What `verify` found.

    Attributes:
        files, rows, documents: numbers that were compared with their checksums.
        documents_missing: number of documents that are not at hand.
        unsealed: files of commits without a seal; their rows have been checked all the same.
        faults: what is damaged, in words, with its place.
    """

    files: int
    rows: int
    documents: int
    documents_missing: int
    unsealed: tuple[str, ...]
    faults: tuple[str, ...]


def verify(registry: Registry) -> Verification:
    """Compare all of a registry with its checksums, and the documents of its results that are at hand.

    A document is at hand if a file is at its row's place. That of a passport is not read; `passport verify` does.
    """
    counts, unsealed, faults = {"files": 0, "rows": 0, "documents": 0, "documents_missing": 0}, [], []
    for table, name in FOLDERS.items():
        folder = registry.folder / name
        if not (folder / LOG).is_dir():
            continue
        expected, wrong = _seals(folder)
        faults += wrong
        there = {path.relative_to(folder).as_posix(): path for path in files_below(folder)}
        for file in sorted(expected.keys() & there.keys()):
            counts["files"] += 1
            if file_hash(there[file]) != expected[file]:
                faults.append(f"{there[file]} differs from its seal")
        try:
            active = registry.files(table)
        except InvalidArgument as error:
            faults.append(f"{folder}: {error.message}")
            continue
        known = {str(there[file]) for file in expected.keys() & there.keys()}
        log = [str(path) for file, path in there.items() if file.startswith(f"{LOG}/")]
        unsealed += sorted({*active, *log} - known)
        with connection(registry.folder, active) as con:
            for file in active:
                faults += _row_faults(con, registry, table, file, counts)
    return Verification(**counts, unsealed=tuple(unsealed), faults=tuple(faults))


def check_registry(registry: Registry) -> None:
    """Raise InvalidArgument if anything in the registry is damaged."""
    found = verify(registry)
    if found.faults:
        more = f" ({len(found.faults)} faults)" if len(found.faults) > 1 else ""
        raise InvalidArgument(f"The registry is damaged: {found.faults[0]}{more}.", DAMAGED)


def _seals(folder: Place) -> tuple[dict[str, str], list[str]]:
    """The SHA-256 of each sealed file, relative to the table, and the seals that are damaged themselves.

    The newest checkpoint's seal holds that of LAST_CHECKPOINT. A seal that a killed writer did not finish is hidden.
    """
    expected: dict[str, str] = {}
    faults = []
    for path in sorted(each for each in files_below(folder / SEALS) if not each.name.startswith(".")):
        hashes = read_seal(path.read_bytes())
        if hashes is None or f"{LOG}/{path.name}" not in hashes:
            faults.append(f"{path} is no seal")
            continue
        expected |= hashes
    return expected, faults


def _row_faults(con: Any, registry: Registry, table: Table, file: str, counts: dict[str, int]) -> Iterator[str]:
    """The faults of the rows of one file, and of their documents."""
    identity = IDENTITY[table]
    try:
        for row in row_batches(con, file):
            counts["rows"] += 1
            if checksum(row) != row["checksum"]:
                yield f"{file}: the row {str(row[identity])[:12]} differs from its checksum"
            if table is Row and row["place"]:
                yield from _document_faults(registry, row, counts)
    except Exception as error:  # DuckDB raises what a damaged file makes it raise
        yield f"{file} cannot be read ({str(error).partition(chr(10))[0]})"


def _document_faults(registry: Registry, row: dict[str, Any], counts: dict[str, int]) -> Iterator[str]:
    document = place(join(registry.folder, row["place"]))
    if not document.is_file():
        counts["documents_missing"] += 1
        return
    data = document.read_bytes()
    if row["passport"] and (data.count(b".") == 2 or b'"excerpt"' in data):
        return
    counts["documents"] += 1
    if hashlib.sha256(data).hexdigest() != row["key"]:
        yield f"{document} differs from its row"
