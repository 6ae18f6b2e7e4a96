"""Keeps a registry in order: merges small files, deletes old ones, deletes the results of a unit."""

from __future__ import annotations

from typing import Any

from camssf.fleet.registry import FOLDERS, PARTITIONS, Registry, Wanted, transaction, zstd
from camssf.fleet.rows import Row, Task
from camssf.fleet.seals import seal
from camssf.fleet.tables import Table, connection, in_partitions, quoted
from camssf.photo.read.unit import Unit

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

        def compact(delta: Any, table: Table = table) -> bool:
            partitions = PARTITIONS[table]
            names = ", ".join(f'"partition.{name}"' for name in partitions)
            with connection() as con:
                con.register("files", delta.get_add_actions(flatten=True))
                found = con.execute(
                    f"SELECT {names or 'count(*)'} FROM files WHERE size_bytes < {LARGE_FILE} "
                    f"{f'GROUP BY {names}' if names else ''} HAVING count(*) >= ?", [least],
                ).fetchall()  # fmt: skip
            if not found:
                return False
            filters = [(name, "in", sorted({each[i] for each in found})) for i, name in enumerate(partitions)]
            done = delta.optimize.compact(filters or None, target_size=LARGE_FILE, writer_properties=zstd())
            return bool(done["numFilesRemoved"])

        registry.commit(table, compact)


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
                for version in range(before + 1, delta.version() + 1):  # the vacuum's start and its end
                    seal(registry.folder / FOLDERS[table], version)
    return removed


def delete(registry: Registry, unit: Unit) -> list[dict[str, Any]]:
    """Delete the rows of a unit and all older files that held them; returns each one's key and document's place.

    The documents remain. Versions before the deletion can not be read any more.
    """
    where, values = Wanted(unit).where()
    found = registry.query(f"SELECT key, place, make, model FROM rows WHERE {where} ORDER BY place", values)
    if not found:
        return []
    keys = ", ".join(quoted(each["key"]) for each in found)
    places = {tuple(str(each[name]) for name in PARTITIONS[Row]) for each in found}
    for table, condition in (
        (Task, f"key IN ({keys})"),
        (Row, f"({in_partitions(PARTITIONS[Row], places)}) AND key IN ({keys})"),
    ):

        def drop(delta: Any, condition: str = condition) -> bool:
            done = delta.delete(condition, commit_properties=transaction(), writer_properties=zstd())
            return bool(done["num_deleted_rows"])

        registry.commit(table, drop)
    vacuum(registry, 0)
    return [{name: each[name] for name in ("key", "place")} for each in found]
