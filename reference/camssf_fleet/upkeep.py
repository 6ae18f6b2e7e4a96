"""Keeps a registry in order: mends it, merges small files, deletes old ones, deletes the results of a unit."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from camssf.photo.read.unit import Unit
from camssf.places import files_below
from camssf.shapes import Text
from camssf_fleet.registry import FOLDERS, PARTITIONS, Registry, Wanted, transaction, zstd
from camssf_fleet.rows import Row, Task
from camssf_fleet.seals import LOG, SEALS, Changed, listed, read_seals, seal
from camssf_fleet.tables import Table, connection, in_partitions, quoted

MANY_FILES = 64
"""A partition with so many small files is compacted during a batch and by `registry add`."""
LARGE_FILE = 16 * 2**20
"""Bytes; a file of this size or larger is not compacted."""


def optimize(registry: Registry, *, least: int = 2) -> None:
    """Merge small files; of partitions that have at least so many.

    Raises:
        InvalidArgument: the files cannot be written; then nothing is lost.
    """
    for table in FOLDERS:

        def compact(delta: Any, table: Table = table) -> Changed | None:
            partitions = PARTITIONS[table]
            names = ", ".join(f'"partition.{name}"' for name in partitions)
            with connection() as con:
                con.register("files", delta.get_add_actions(flatten=True))
                found = con.execute(
                    f"SELECT {names or 'count(*)'} FROM files WHERE size_bytes < {LARGE_FILE} "
                    f"{f'GROUP BY {names}' if names else ''} HAVING count(*) >= ?", [least],
                ).fetchall()  # fmt: skip
            if not found:
                return None
            filters = [(name, "in", sorted({each[i] for each in found})) for i, name in enumerate(partitions)]
            done = delta.optimize.compact(filters or None, target_size=LARGE_FILE, writer_properties=zstd())
            return Changed() if done["numFilesRemoved"] else None

        registry.commit(table, compact)


def mend(registry: Registry) -> None:
    """Take data files that are gone out of the tables, and seal the commits; `verify` names the rows that lack.

    Raises:
        InvalidArgument: a table cannot be read or written.
    """

    def forget(delta: Any) -> Changed:
        return Changed(gone=tuple(delta.repair(commit_properties=transaction())["files_removed"]))

    for table, name in FOLDERS.items():
        needed = registry.files(table)
        if needed and needed.keys() - set(map(str, files_below(registry.folder / name))):
            registry.commit(table, forget)
    seal_commits(registry)


def seal_commits(registry: Registry) -> None:
    """Seal the commits that have no seal; the last one lists the results that no seal lists.

    Raises:
        InvalidArgument: a table cannot be read or written.
    """
    for table, name in FOLDERS.items():
        folder = registry.folder / name
        entries, seals = (
            {path.name for path in files_below(folder / where) if re.fullmatch(r"\d{20}\.json", path.name)}
            for where in (LOG, SEALS)
        )
        if rest := sorted(entries - seals):
            new = Changed()
            if table is Row:
                written, _ = listed(read_seals(folder).values())
                keys = {str(each["key"]) for each in registry.query("SELECT key FROM rows")}
                new = Changed(added=tuple(sorted(keys - written)))
            for each in rest:
                seal(folder, int(each.removesuffix(".json")), new if each == rest[-1] else Changed())


def vacuum(registry: Registry, days: float = 7.0) -> int:
    """Delete files that no version of the last days needs; returns their number. Older versions can not be read.

    Raises:
        InvalidArgument: they cannot be deleted.
    """
    removed = 0
    for table in FOLDERS:
        with registry.failures():
            delta = registry.table(table)
            if delta is not None:
                hours, before = round(24 * days), delta.version()
                found = delta.vacuum(hours, dry_run=False, enforce_retention_duration=False)
                removed += len(found)
                folder = registry.folder / FOLDERS[table]
                files = {name for each in read_seals(folder).values() if each is not None for name in each.hashes}
                needed = {path.removeprefix(f"{folder}/") for path in registry.files(table)}
                there = {path.relative_to(folder).as_posix() for path in files_below(folder)}
                gone = {name for name in files - there - needed if not name.startswith(f"{LOG}/")}
                for version in range(before + 1, delta.version()):  # the vacuum's start
                    seal(folder, version, Changed())
                seal(folder, delta.version(), Changed(gone=tuple(sorted(gone))))
    return removed


@dataclass(frozen=True)
class Deleted:
    """A deleted result.

    Attributes:
        key: SHA-256 of its document.
        place: path of its document, relative to the registry; "" if unknown.
    """

    key: Text
    place: Text


def delete(registry: Registry, unit: Unit) -> tuple[Deleted, ...]:
    """Delete the rows of a unit and all older files that held them; returns each one's key and document's place.

    The documents remain. Versions before the deletion can not be read any more.
    """
    where, values = Wanted(unit).where()
    found = registry.query(f"SELECT key, place, make, model FROM rows WHERE {where} ORDER BY place", values)
    if not found:
        return ()
    keys = ", ".join(quoted(each["key"]) for each in found)
    places = {tuple(str(each[name]) for name in PARTITIONS[Row]) for each in found}
    for table, gone, condition in (
        (Task, Changed(), f"key IN ({keys})"),
        (
            Row,
            Changed(deleted=tuple(each["key"] for each in found)),
            f"({in_partitions(PARTITIONS[Row], places)}) AND key IN ({keys})",
        ),
    ):

        def drop(delta: Any, condition: str = condition, gone: Changed = gone) -> Changed | None:
            done = delta.delete(condition, commit_properties=transaction(), writer_properties=zstd())
            return gone if done["num_deleted_rows"] else None

        registry.commit(table, drop)
    vacuum(registry, 0)
    return tuple(Deleted(each["key"], each["place"]) for each in found)
