"""Verifies a registry: files against their seals, rows against checksums, seals, tasks and archive, both ways."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from camssf.errors import InvalidArgument
from camssf.places import Place, files_below, is_remote, join, place
from camssf.shapes import Count, Text
from camssf_fleet.archive import RESULT, folder_of
from camssf_fleet.inputs import file_hash
from camssf_fleet.registry import DAMAGED, FOLDERS, IDENTITY, Registry
from camssf_fleet.rows import Row, Task, checksum
from camssf_fleet.seals import LAST_CHECKPOINT, LOG, SEALS, listed, read_seals
from camssf_fleet.tables import Table, connection, row_batches

UNSEALED = "its writer was stopped, the seal was removed, or another program wrote it"
MEND = (
    "Run `camssf batch` again with the same manifest and archive: it writes missing and changed rows and missing "
    "results again, and seals commits. If a fault remains, the archive does not have what it needs: restore a "
    "backup, or add the result again."
)
VACUUM = "Run `camssf registry vacuum` for the files that only older versions need: it gives these versions up."


@dataclass(frozen=True)
class Verification:
    """What `verify` found.

    Attributes:
        files, rows, documents: numbers that were compared with their checksums.
        documents_missing: number of documents outside an archive that are not at hand.
        faults: what is damaged, missing or of unknown origin, in words, with its place.
        advice: what to do, in words; "" without faults.
    """

    files: Count
    rows: Count
    documents: Count
    documents_missing: Count
    faults: tuple[Text, ...]
    advice: Text


@dataclass
class _Found:
    """What the tables hold.

    Attributes:
        files, documents, documents_missing: as in Verification.
        read: number of rows.
        rows, tasks: the key of each row; name, key and made_from of each task.
        archives: of each archive, by its place, the results' folders that rows name.
        deleted: keys of deleted rows.
        unreadable: what to do if a table's log or one of its files cannot be read.
        outdated: number of faults that concern older versions only.
    """

    files: int = 0
    read: int = 0
    documents: int = 0
    documents_missing: int = 0
    rows: dict[str, str] = field(default_factory=dict)
    tasks: list[tuple[str, str, str]] = field(default_factory=list)
    archives: dict[str, set[str]] = field(default_factory=dict)
    deleted: set[str] = field(default_factory=set)
    unreadable: str = ""
    outdated: int = 0


def verify(registry: Registry) -> Verification:
    """Compare all of a registry with its checksums, its seals, its tasks and the archives that its rows name.

    Nobody should write to it meanwhile: rows that are not acknowledged yet count as faults.

    A document outside an archive is compared if it is at hand. A passport is not read; `passport verify` does that.
    """
    found, faults = _Found(), list[str]()
    for table, name in FOLDERS.items():
        folder = registry.folder / name
        if folder.exists():
            faults += _table_faults(registry, table, folder, found)
    if not found.unreadable:
        faults += _task_faults(found)
    for archive, held in found.archives.items():
        faults += _archive_faults(_beside(registry.folder, archive), held, found)
    advice = [MEND] * (len(faults) > found.outdated) + [VACUUM] * (found.outdated > 0)
    numbers = (found.files, found.read, found.documents, found.documents_missing)
    return Verification(*numbers, faults=tuple(faults), advice=found.unreadable or " ".join(advice))


def _table_faults(registry: Registry, table: Table, folder: Place, found: _Found) -> Iterator[str]:
    """The faults of a table's files and rows."""
    seals, expected = read_seals(folder), dict[str, str]()
    for version, seal in seals.items():
        entry = f"{LOG}/{version:020}.json"
        if seal is None or entry not in seal.hashes:
            yield f"{folder / SEALS / f'{version:020}.json'} is no seal"
        else:
            expected |= seal.hashes  # the newest checkpoint's seal holds the hash of LAST_CHECKPOINT
            for file in seal.changed.gone:
                expected.pop(file, None)
    there = {path.relative_to(folder).as_posix(): path for path in files_below(folder)}
    for file in sorted(expected.keys() & there.keys()):
        found.files += 1
        if file_hash(there[file]) != expected[file]:
            yield f"{there[file]} differs from its seal"
    for file in _missing_log(set(expected), set(there)):
        yield f"{folder / file} is missing"
    try:
        active = registry.files(table)
    except InvalidArgument as error:
        found.unreadable = error.advice
        yield error.message
        return
    data = {file for file in expected if not file.startswith(f"{LOG}/")} - there.keys()
    for file in sorted(data - {path.removeprefix(f"{folder}/") for path in active}):
        found.outdated += 1
        yield f"{folder / file} is missing, which only older versions need"
    known = {f"{folder}/{file}" for file in expected}
    log = [str(path) for file, path in there.items() if file.startswith(f"{LOG}/")]
    for path in sorted({*active, *log} - known):
        yield f"{path} has no seal: {UNSEALED}"
    with connection(registry.folder, active) as con:
        for path in active:
            yield from _row_faults(con, registry, table, path, found)
    if table is Row:
        written, found.deleted = listed(seals.values())
        yield from (f"{folder}: the row {key[:12]} is missing" for key in sorted(written - found.rows.keys()))


def _missing_log(expected: set[str], there: set[str]) -> list[str]:
    """Sealed files of the log that lack; Delta itself removes the oldest entries that a checkpoint replaces."""
    log = sorted(file for file in expected if file.startswith(f"{LOG}/"))
    checkpoints = [file for file in log if file.endswith(".checkpoint.parquet")][-1:]
    first = min((file for file in log if file in there and re.search(r"\d{20}\.json$", file)), default="")
    start = min(first, checkpoints[0]) if checkpoints else ""
    return [file for file in log if file not in there and (file >= start or file == LAST_CHECKPOINT)]


def _task_faults(found: _Found) -> Iterator[str]:
    """Tasks without the row of their result, and rows of a batch without a task."""
    for name, key, _ in found.tasks:
        if key and key not in found.rows:
            yield f"the result {key[:12]} of the task {name!r} has no row"
    made_from = {each for _, _, each in found.tasks}
    for key, row in found.rows.items():
        if row and row not in made_from:
            yield f"the row {key[:12]} of a batch has no task"


def _archive_faults(archive: Place, held: set[str], found: _Found) -> Iterator[str]:
    """Results of an archive without a row, and rows without their result."""
    there = {path.parent.name: path for path in files_below(archive) if path.name == RESULT}
    if not there:
        yield f"the archive {archive} of {len(held)} rows is missing or empty"
        return
    for each in sorted(held - there.keys()):
        yield f"{archive / folder_of(each) / RESULT} is missing"
    for each in sorted(there.keys() - held):
        key = file_hash(there[each])
        if key not in found.rows and key not in found.deleted:
            yield f"{there[each]} has no row"


@dataclass(frozen=True)
class _Held:
    """What is read of a row: its identity, and of a result what leads to its document."""

    identity: str
    made_from: str
    name: str
    key: str
    checksum: str
    place: str = ""
    passport: str = ""


def _held(row: dict[str, Any], table: Table) -> _Held:
    names = ("made_from", "name", "key", "checksum") + (("place", "passport") if table is Row else ())
    return _Held(row[IDENTITY[table]], *(row[name] for name in names))


def _row_faults(con: Any, registry: Registry, table: Table, file: str, found: _Found) -> Iterator[str]:
    """The faults of the rows of one file, and of their documents; notes the rows."""
    try:
        for row in row_batches(con, file):
            found.read += 1
            held = _held(row, table)
            if table is Task:
                found.tasks.append((held.name, held.key, held.made_from))
            elif held.key in found.rows:
                yield f"{file}: the row {held.key[:12]} is there twice"
            else:
                found.rows[held.key] = held.made_from
            if checksum(row) != held.checksum:
                yield f"{file}: the row {str(held.identity)[:12]} differs from its checksum"
            if table is Row and held.place:
                yield from _document_faults(registry, held, found)
    except Exception as error:  # DuckDB raises what a damaged file makes it raise
        if place(file).is_file():  # a batch takes a missing file out of the table, but stops at a damaged one
            found.unreadable = DAMAGED
        yield f"{file} cannot be read ({str(error).partition(chr(10))[0]})"


def _document_faults(registry: Registry, held: _Held, found: _Found) -> Iterator[str]:
    document, made_from = _beside(registry.folder, held.place), held.made_from
    in_archive = f"{folder_of(made_from)}/{RESULT}"
    archived = bool(made_from) and held.place.endswith(f"/{in_archive}")
    if archived:
        found.archives.setdefault(held.place.removesuffix(in_archive), set()).add(made_from)
    if not document.is_file():
        found.documents_missing += not archived
        return
    data = document.read_bytes()
    if held.passport and (data.count(b".") == 2 or b'"excerpt"' in data):
        return
    found.documents += 1
    if hashlib.sha256(data).hexdigest() != held.key:
        yield f"{document} differs from its row"


def _beside(folder: Place, path: str) -> Place:
    """The place of a path relative to a folder, without `..` unless links give it another meaning."""
    found = join(folder, path)
    plain = found if is_remote(found) else os.path.normpath(found)
    return place(plain if os.path.realpath(plain) == os.path.realpath(found) else found)
