"""Stores results, one row each, in a Delta Lake table, for concurrent writers and readers.

A registry has two tables: `results`, partitioned by make and model, and `tasks`, the jobs of batches. `deltalake`
writes them and commits each change at once or not at all; DuckDB queries the files of one version of a table.

A write looks up which rows exist, then appends the new rows, or merges all if some rows differ. Every write carries
the same Delta transaction identifier, so of two writes that began at the same version the second one fails, and is
repeated at the new version. The order of the commits, not a clock, decides which of two versions of a row counts.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import unquote

from camssf.errors import InvalidArgument
from camssf.files import local, write_aside
from camssf.fleet.rows import Row, Task, checksum, columns
from camssf.fleet.seals import seal
from camssf.fleet.tables import (
    Table,
    column,
    connection,
    create_views,
    csv_cell,
    dicts,
    in_partitions,
    in_utc,
    query_of,
    quoted,
)
from camssf.libraries import library
from camssf.photo.read.unit import Unit
from camssf.places import Place, folder_place, is_remote, storage_options, without_secrets

Answer = TypeVar("Answer")

FORMAT = "camssf-registry/1"
"""Name of the Delta tables, in their metadata."""
FOLDERS: dict[Table, str] = {Row: "results", Task: "tasks"}
IDENTITY: dict[Table, str] = {Row: "key", Task: "task"}
"""The column that identifies a row."""
STAMP: dict[Table, str] = {Row: "added", Task: "ended"}
"""The time of writing; a row that differs in it alone is not written again."""
PARTITIONS: dict[Table, tuple[str, ...]] = {Row: ("make", "model"), Task: ()}
UNKNOWN = "unknown"
"""Make or model of a camera that the photo does not name; Delta has no empty partition."""
ROW_GROUP = 4096
"""Rows of an exported file that are in memory at once; with covariances, 45 MB."""
STREAMED = "SET preserve_insertion_order = false; SET threads = 1"
ATTEMPTS = 50
"""Attempts to write while other processes write, and to read while another process vacuums."""
SHORT = ("name", "status", "code", "make", "model", "serial", "captured", "lamps", "half_width", "delta_e00", "key")
"""Columns of `Registry.listing`."""

WHICH_FOLDER = "Name the folder that `camssf registry add` or `camssf batch --registry` wrote to."
DAMAGED = "Restore it from a backup, or add the results from their archive to a new registry."

STATISTICS: dict[Table, str] = {Row: "key,captured,added", Task: "task,key,ended"}
"""Columns with a least and a largest value in the log: no serial number or name, which `delete` leaves there."""


@dataclass(frozen=True)
class Wanted:
    """A filter for results; the default selects all.

    Attributes:
        unit: make, model and serial are equal to its own; "" for any.
        name: equal to this; "" for any.
        statuses: status is one of these; empty for any.
    """

    unit: Unit = field(default_factory=Unit)
    name: str = ""
    statuses: tuple[str, ...] = ()

    def where(self) -> tuple[str, list[Any]]:
        """The filter as an SQL condition, and its values."""
        equal = {"make": self.unit.make, "model": self.unit.model, "serial": self.unit.serial, "name": self.name}
        terms = [f"{name} = ?" for name, value in equal.items() if value]
        values: list[Any] = [value for value in equal.values() if value]
        if self.statuses:
            terms.append("list_contains(?, status)")
            values.append(list(self.statuses))
        return " AND ".join(terms) or "true", values


class Registry:
    """A registry in a folder or in an object store.

    Args:
        folder: of the registry, or its URL.
        new: it may be missing; then the first write creates it.
        as_of: read the results as they were: a version's number, or a time in ISO 8601 with its offset; "" for now.

    Raises:
        InvalidArgument: there is no registry, it had no such version, or it cannot be reached.
    """

    def __init__(self, folder: Path | str, *, new: bool = False, as_of: str = "") -> None:
        library("duckdb", "The registry needs", "fleet")
        library("deltalake", "The registry needs", "fleet")
        self.folder: Place = folder_place(folder)
        self._as_of = _version(as_of)
        if str(self.folder).startswith("memory:"):
            raise InvalidArgument("A registry cannot be in memory://.", "Name a folder, or a bucket of a store.")
        with self.failures():
            if all(self.table(each) is None for each in FOLDERS) and not (new and _is_empty(self.folder)):
                raise _no_registry(self.folder, new)

    # Writing

    def add(self, rows: Sequence[Row]) -> None:
        """Write rows in one commit; a row that the registry holds already is not written again.

        Raises:
            InvalidArgument: they cannot be written; then none of them is.
        """
        self._write(Row, rows)

    def note(self, tasks: Sequence[Task]) -> None:
        """Write finished jobs, as `add`; call it after their rows are written, so that each task has its result."""
        self._write(Task, tasks)

    def _write(self, table: Table, rows: Sequence[Row] | Sequence[Task]) -> None:
        identity, kinds = IDENTITY[table], columns(table)
        last: list[Any] = list({getattr(each, identity): each for each in rows}.values())
        if not last:
            return
        with self.failures(), connection() as con:
            each = ", ".join(f"unnest(?::{kind}[]) AS {name}" for name, kind in kinds.items())
            con.execute(f"CREATE TABLE fresh AS SELECT {each}", [column(last, name) for name in kinds])
            for name in PARTITIONS[table]:
                con.execute(f"UPDATE fresh SET {name} = '{UNKNOWN}' WHERE {name} = ''")
            fresh = {row[identity]: row for row in dicts(con.execute(f"SELECT {in_utc(kinds)} FROM fresh"))}
            self._create(table, con)
            self.commit(table, lambda delta: self._put(table, delta, con, fresh))

    def _put(self, table: Table, delta: Any, con: Any, fresh: dict[str, dict[str, Any]]) -> bool:
        """Append the new rows, or merge all if some have changed; returns whether anything was written."""
        from arro3.core import Table as ArrowTable
        from deltalake import write_deltalake

        identity, stamp, partitions = IDENTITY[table], STAMP[table], PARTITIONS[table]
        names = ", ".join((identity, stamp, "checksum", *partitions))
        sql = f"SELECT {names} FROM rows WHERE {identity} IN (SELECT unnest(?))"
        stored = {each[identity]: each for each in self.ask(query_of(sql, [list(fresh)]), table, delta)}
        write, changed = {}, []
        for key, row in fresh.items():
            old = stored.get(key)
            if old is None or checksum(row | {stamp: old[stamp]}) != old["checksum"]:
                write[key] = checksum(row)
                changed += [] if old is None else [old]
        if not write:
            return False
        con.execute("CREATE OR REPLACE TABLE sums AS SELECT unnest(?) AS id, unnest(?) AS checksum",
                    [list(write), list(write.values())])  # fmt: skip
        source = ArrowTable(con.sql(f"SELECT fresh.*, checksum FROM fresh JOIN sums ON id = {identity}"))
        how = {"commit_properties": transaction(), "writer_properties": zstd()}
        if not changed:
            write_deltalake(delta, source, mode="append", schema_mode="merge", **how)
            return True
        places = {tuple(old[name] for name in partitions) for old in changed}
        (
            delta.merge(
                source,
                f"stored.{identity} = fresh.{identity} AND ({in_partitions(partitions, places, 'stored.')})",
                source_alias="fresh",
                target_alias="stored",
                merge_schema=True,
                **how,
            )
            .when_matched_update_all()
            .when_not_matched_insert_all()
            .execute()
        )
        return True

    def _create(self, table: Table, con: Any) -> None:
        from arro3.core import Table as ArrowTable
        from deltalake import DeltaTable, Schema
        from deltalake.exceptions import DeltaError

        if self.table(table) is not None:
            return
        if not is_remote(self.folder):
            Path(self.folder).mkdir(parents=True, exist_ok=True)
        empty = ArrowTable(con.sql("SELECT *, '' AS checksum FROM fresh LIMIT 0"))
        try:
            DeltaTable.create(
                self._uri(table),
                Schema.from_arrow(empty.schema),
                name=FORMAT,
                partition_by=list(PARTITIONS[table]) or None,
                configuration={"delta.dataSkippingStatsColumns": STATISTICS[table]},
                storage_options=storage_options(self.folder),
            )
        except DeltaError:
            if self.table(table) is None:  # else another writer created it meanwhile
                raise
        else:
            seal(self.folder / FOLDERS[table], 0)

    def commit(self, table: Table, write: Callable[[Any], bool]) -> bool:
        """Call `write` with the newest version of a table until no other writer came first; then seal the commit."""
        from deltalake.exceptions import CommitFailedError

        attempt = 0
        with self.failures():
            while (delta := self.table(table)) is not None:
                try:
                    if written := write(delta):
                        seal(self.folder / FOLDERS[table], delta.version())
                    return written
                except CommitFailedError:
                    if (attempt := attempt + 1) == ATTEMPTS:
                        raise
                    time.sleep(random.uniform(0, 0.05 * min(attempt, 20)))
        return False

    # Reading

    def files(self, table: Table = Row) -> dict[str, int]:
        """Size in bytes of each file of a table's version, by path or URL."""
        with self.failures():
            return self._sizes(table, self.table(table))

    def listing(self, wanted: Wanted | None = None, *, limit: int | None = None) -> list[dict[str, Any]]:
        """The results, newest first, in the columns SHORT."""
        where, values = (wanted or Wanted()).where()
        most = "" if limit is None else f" LIMIT {int(limit)}"
        return self.query(f"SELECT {', '.join(SHORT)} FROM rows WHERE {where} ORDER BY added DESC, key{most}", values)

    def query(self, sql: str, values: Sequence[Any] = (), table: Table = Row) -> list[dict[str, Any]]:
        """The rows that a query on the view `rows` returns."""
        return self.ask(query_of(sql, values), table)

    def arrays(self, sql: str, values: Sequence[Any] = (), table: Table = Row) -> dict[str, Any]:
        """As `query`, but returns NumPy columns; times are in UTC."""
        return self.ask(lambda con: dict(con.execute(sql, list(values)).fetchnumpy()), table)

    def export(self, path: Path | str) -> None:
        """Write all results to one local file: .parquet with all columns, .csv without curves.

        Raises:
            InvalidArgument: another suffix, or the file cannot be written.
        """
        path = local(path)
        if path.suffix not in (".parquet", ".csv"):
            raise InvalidArgument(f"{path} ends in neither .parquet nor .csv.", "Give the file one of these endings.")
        kinds, form = columns(Row), f"FORMAT parquet, COMPRESSION zstd, ROW_GROUP_SIZE {ROW_GROUP}"
        what = ", ".join(kinds)
        if path.suffix == ".csv":
            form = "FORMAT csv, HEADER true"
            what = ", ".join(csv_cell(name, kind) for name, kind in kinds.items() if kind != "FLOAT[]")
        sql = f"COPY (SELECT {what} FROM every) TO"
        with write_aside(path) as aside:
            # In any order and by one thread, rows are written as they are read.
            self.ask(lambda con: con.execute(f"{STREAMED}; {sql} {quoted(str(aside))} ({form})"))

    def damaged(self, key: str, what: str) -> InvalidArgument:
        """The error for a damaged row, with the file that holds it; `what` describes the damage."""
        found = self.ask(query_of("SELECT filename FROM every WHERE key = ?", [key]))
        place = found[0]["filename"] if found else self.folder
        return InvalidArgument(f"{place} is damaged: of the result {key[:12]}... {what}.", DAMAGED)

    def ask(self, ask: Callable[[Any], Answer], table: Table = Row, delta: Any = None) -> Answer:
        """Call `ask` with a connection that has both views; again if a file was vacuumed meanwhile."""
        import duckdb

        with self.failures():
            for attempt in range(ATTEMPTS):
                opened = delta or self.table(table)
                files = self._sizes(table, opened)
                try:
                    with connection(self.folder, files) as con:
                        create_views(con, table, list(files))
                        return ask(con)
                except (FileNotFoundError, duckdb.Error) as error:
                    newer = None if delta is not None else self.table(table)
                    if attempt + 1 == ATTEMPTS or newer is None or newer.version() == opened.version():
                        self._name_damaged(table, files, error)
                        raise
            raise AssertionError  # the last attempt returns or raises

    def _sizes(self, table: Table, delta: Any) -> dict[str, int]:
        """Size of each file of a table's version, by path or URL."""
        if delta is None:
            return {}
        found = delta.get_add_actions()
        paths, sizes = (found.column(name).to_pylist() for name in ("path", "size_bytes"))
        return dict(sorted((f"{self._uri(table)}/{unquote(p)}", n) for p, n in zip(paths, sizes, strict=True)))

    def _name_damaged(self, table: Table, files: dict[str, int], error: Exception) -> None:
        """Raise InvalidArgument for the first file that cannot be read by itself; return if all can."""
        import duckdb

        for path in files:
            try:
                with connection(self.folder, files) as con:
                    create_views(con, table, [path])
                    con.execute("SELECT bit_xor(hash(every)) FROM every").fetchone()
            except (duckdb.Error, OSError):
                what = "damaged, missing or out of reach" if is_remote(self.folder) else "damaged or missing"
                raise InvalidArgument(f"{path} is {what}.", DAMAGED) from error

    def _uri(self, table: Table) -> str:
        return str(self.folder / FOLDERS[table])

    def table(self, table: Table) -> Any:
        """The newest version of a table, or that of `as_of`; None if the table is missing."""
        from deltalake import DeltaTable
        from deltalake.exceptions import TableNotFoundError

        try:
            delta = DeltaTable(self._uri(table), storage_options=storage_options(self.folder))
        except TableNotFoundError:
            return None
        if delta.metadata().name != FORMAT:
            raise InvalidArgument(
                f"{self.folder} is no registry that this camssf can use: its format is {delta.metadata().name!r}, "
                f"not {FORMAT!r}.",
                "Use the camssf that wrote it, or name another folder.",
            )
        if table is Row and self._as_of is not None:
            delta.load_as_version(self._as_of)
        return delta

    @contextmanager
    def failures(self) -> Iterator[None]:
        """Turn errors of the libraries, the disk and the object store into InvalidArgument."""
        import duckdb
        from deltalake.exceptions import DeltaError

        try:
            yield
        except InvalidArgument:
            raise
        except BaseException as error:
            panic = type(error).__name__ == "PanicException"  # of deltalake, where the log is damaged
            remote = is_remote(self.folder) and isinstance(error, Exception)
            if not (panic or remote or isinstance(error, (OSError, duckdb.IOException, DeltaError))):
                raise
            words = getattr(error, "strerror", None) or without_secrets(error)
            advice = "Check the address, the credentials and the network." if remote else "Check the folder."
            raise InvalidArgument(f"{self.folder}: the registry cannot be used ({words}).", advice) from error


def transaction() -> Any:
    """The identifier that every write of rows carries: of two that began at one version, the second fails."""
    from deltalake import CommitProperties, Transaction

    return CommitProperties(app_transactions=[Transaction("camssf", 1)])


def zstd() -> Any:
    """The compression of the files."""
    from deltalake import WriterProperties

    return WriterProperties(compression="ZSTD")


def _version(as_of: str) -> int | datetime | None:
    if not as_of:
        return None
    if as_of.isdecimal():
        return int(as_of)
    try:
        time = datetime.fromisoformat(as_of)
    except ValueError:
        time = datetime.min
    if time.tzinfo is None:
        raise InvalidArgument(
            f"{as_of!r} is neither the number of a version nor a time with its offset.",
            "Write it as 12, or as 2026-11-22T10:00:00+01:00.",
        )
    return time


def _is_empty(folder: Place) -> bool:
    """Whether the folder is missing or empty, apart from hidden files and other writers' half-made tables."""
    if not folder.exists():
        return True
    try:
        return all(path.name.startswith(".") or path.name in FOLDERS.values() for path in folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return not folder.exists()


def _no_registry(folder: Place, new: bool) -> InvalidArgument:
    if not folder.exists():
        return InvalidArgument(f"There is no folder {folder}.", WHICH_FOLDER)
    if new:
        return InvalidArgument(f"{folder} is no registry: it holds something else.", "Name a new or an empty folder.")
    return InvalidArgument(f"{folder} is no registry: it holds no table of results.", WHICH_FOLDER)
