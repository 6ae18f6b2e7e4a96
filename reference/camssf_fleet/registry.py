"""Stores results, one row each, in a Delta Lake table, for concurrent writers and readers.

A registry has two tables: `results`, partitioned by make and model, and `tasks`, the jobs of batches. `deltalake`
writes them and commits each change at once or not at all; DuckDB queries the files of one version of a table.

A write looks up which rows exist and merges them with what is said now (`merge`), then appends the new rows, or
replaces all if some rows changed. Every write carries the same Delta transaction identifier, so of two writes that
began at the same version the second one fails, and is repeated at the new version.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import unquote

from camssf.errors import InvalidArgument
from camssf.files import local, write_aside
from camssf.libraries import library
from camssf.photo.read.unit import Unit
from camssf.places import Place, folder_place, is_remote, storage_options, without_secrets
from camssf_fleet.merge import CORRECT, UNKNOWN, Added, fold
from camssf_fleet.rows import Row, Task, checksum, columns
from camssf_fleet.seals import LOG, SEALS, Changed, seal
from camssf_fleet.tables import (
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
    row_batches,
)

Answer = TypeVar("Answer")

FORMAT = "camssf-registry/1"
"""Name of the Delta tables, in their metadata."""
FOLDERS: dict[Table, str] = {Row: "results", Task: "tasks"}
IDENTITY: dict[Table, str] = {Row: "key", Task: "task"}
"""The column that identifies a row."""
STAMP: dict[Table, str] = {Row: "added", Task: "ended"}
"""The time of writing; a row that differs in it alone is not written again."""
PARTITIONS: dict[Table, tuple[str, ...]] = {Row: ("make", "model"), Task: ()}
ROW_GROUP = 4096
"""Rows of an exported file that are in memory at once; with covariances, 45 MB."""
STREAMED = "SET preserve_insertion_order = false; SET threads = 1"
ATTEMPTS = 50
"""Attempts to write while other processes write, and to read while another process vacuums."""
SHORT = ("name", "status", "code", "make", "model", "serial", "captured", "lamps", "half_width", "delta_e00", "key")
"""Columns of `Registry.listing`."""

WHICH_FOLDER = "Name the folder that `camssf registry add` or `camssf batch --registry` wrote to."
DAMAGED = (
    "Move the registry away and run the same `camssf batch` again: it makes a new one from the archive. "
    "Or restore a backup of the registry."
)

STATISTICS: dict[Table, str] = {Row: "key,captured,added", Task: "task,key,ended"}
"""Columns with a least and a largest value in the log: no serial number or name, which `delete` leaves there."""


@dataclass(frozen=True)
class Wanted:
    """A filter for results; the default selects all.

    Attributes:
        unit: make, model and serial are equal to its own; "" for any.
        statuses: status is one of these; empty for any.
    """

    unit: Unit = field(default_factory=Unit)
    statuses: tuple[str, ...] = ()

    def where(self) -> tuple[str, list[Any]]:
        """The filter as an SQL condition, and its values."""
        equal = {"make": self.unit.make, "model": self.unit.model, "serial": self.unit.serial}
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
        correct: what is added and contradicts the registry replaces its value.

    Raises:
        InvalidArgument: there is no registry, or it cannot be reached.
    """

    def __init__(self, folder: Path | str, *, new: bool = False, correct: bool = False) -> None:
        library("duckdb", "The registry needs", "fleet")
        library("deltalake", "The registry needs", "fleet")
        self.folder: Place = folder_place(folder)
        self._correct = correct
        if str(self.folder).startswith("memory:"):
            raise InvalidArgument("A registry cannot be in memory://.", "Name a folder, or a bucket of a store.")
        with self.failures():
            if not any(self._is_there(each) for each in FOLDERS) and not (new and _is_empty(self.folder)):
                raise _no_registry(self.folder, new)

    def _is_there(self, table: Table) -> bool:
        """Whether a table is there; one whose log is damaged is, and is named when it is read."""
        try:
            with self.failures():
                return self.table(table) is not None
        except InvalidArgument as error:
            if error.__cause__ is None or is_remote(self.folder):
                raise
            return True

    # Writing

    def add(self, rows: Sequence[Row], *, partly: bool = False, names: Sequence[str] = ()) -> tuple[Added, ...]:
        """Write rows in one commit, merged with what the registry and the rows before say of the same results.

        Args:
            rows: what is said now; a field that is empty empties nothing.
            partly: if a row contradicts the registry, write the others.
            names: of the rows' files, for messages.

        Raises:
            InvalidArgument: they cannot be written, or one contradicts the registry; then none of them is.
        """
        return self._write(Row, rows, partly, names)

    def note(self, tasks: Sequence[Task]) -> None:
        """Write finished jobs; call it after their rows are written, so that each task has its result."""
        self._write(Task, tasks)

    def _write(
        self, table: Table, rows: Sequence[Row] | Sequence[Task], partly: bool = False, names: Sequence[str] = ()
    ) -> tuple[Added, ...]:
        kinds, added = columns(table), list[Added]()
        if not rows:
            return ()
        with self.failures(), connection() as con:
            _fill(con, "fresh", kinds, [vars(each) for each in rows])
            fresh = dicts(con.execute(f"SELECT {in_utc(kinds)} FROM fresh ORDER BY rowid"))
            for row in fresh:
                row |= {name: row[name] or UNKNOWN for name in PARTITIONS[table]}
            self._create(table, con)

            def put(delta: Any) -> Changed | None:
                held = self._held(table, delta, fresh)
                how = (IDENTITY[table], STAMP[table], self._correct if table is Row else None)
                found, added[:] = fold(held, fresh, *how)
                files = [f"{name}: " for name in names] or [""] * len(added)
                told = zip(files, added, strict=True)
                wrong = [f"{file}{each.contradiction}" for file, each in told if each.contradiction]
                if wrong and not partly:
                    more = f" So do {len(wrong) - 1} more." if len(wrong) > 1 else ""
                    raise InvalidArgument(f"{wrong[0]}{more}", CORRECT)
                return self._put(table, delta, con, held, found)

            self.commit(table, put)
        return tuple(added)

    def _held(self, table: Table, delta: Any, fresh: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """The rows that the registry has of these, by identity."""
        identity = IDENTITY[table]
        sql = f"SELECT {identity}, filename FROM rows WHERE {identity} IN (SELECT unnest(?))"
        found = self.ask(query_of(sql, [[row[identity] for row in fresh]]), table, delta)
        where = f"{identity} IN ({', '.join(sorted({quoted(each[identity]) for each in found}))})"
        files = sorted({each["filename"] for each in found})
        rows = self.ask(lambda con: [r for file in files for r in row_batches(con, file, where)], table, delta)
        return {row[identity]: dict.fromkeys(columns(table)) | row for row in rows}

    def _put(
        self, table: Table, delta: Any, con: Any, held: dict[str, dict[str, Any]], found: dict[str, dict[str, Any]]
    ) -> Changed | None:
        """Append the new rows, or merge all if some have changed; returns what was written."""
        from arro3.core import Table as ArrowTable
        from deltalake import write_deltalake

        identity, partitions = IDENTITY[table], PARTITIONS[table]
        told = {key: {row["checksum"], checksum(row)} for key, row in held.items()}  # two if it was changed
        write = {key: row for key, row in found.items() if told.get(key) != {row["checksum"]}}
        if not write:
            return None
        _fill(con, "source", columns(table) | {"checksum": "VARCHAR"}, list(write.values()))
        source, done = ArrowTable(con.sql("FROM source")), Changed(tuple(write) if table is Row else ())
        how = {"commit_properties": transaction(), "writer_properties": zstd()}
        places = {tuple(held[key][name] for name in partitions) for key in write if key in held}
        if not places:
            write_deltalake(delta, source, mode="append", schema_mode="merge", **how)
            return done
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
        return done

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
            seal(self.folder / FOLDERS[table], 0, Changed())

    def commit(self, table: Table, write: Callable[[Any], Changed | None]) -> None:
        """Call `write` with the newest version of a table until no other writer came first; then seal what it did."""
        from deltalake.exceptions import CommitFailedError

        attempt = 0
        with self.failures():
            while (delta := self.table(table)) is not None:
                try:
                    if (changed := write(delta)) is not None:
                        seal(self.folder / FOLDERS[table], delta.version(), changed)
                    return
                except CommitFailedError:
                    if (attempt := attempt + 1) == ATTEMPTS:
                        raise
                    time.sleep(random.uniform(0, 0.05 * min(attempt, 20)))

    # Reading

    def files(self, table: Table = Row) -> dict[str, int]:
        """Size in bytes of each file of a table's version, by path or URL."""
        with self.failures():
            return self._sizes(table, self.table(table))

    def listing(self, wanted: Wanted | None = None) -> list[dict[str, Any]]:
        """The results, newest first, in the columns SHORT."""
        where, values = (wanted or Wanted()).where()
        return self.query(f"SELECT {', '.join(SHORT)} FROM rows WHERE {where} ORDER BY added DESC, key", values)

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
        """The newest version of a table; None if it is missing."""
        from deltalake import DeltaTable
        from deltalake.exceptions import DeltaError, TableNotFoundError

        try:
            delta = DeltaTable(self._uri(table), storage_options=storage_options(self.folder))
        except TableNotFoundError as error:
            folder = self.folder / FOLDERS[table]
            if (folder / SEALS).is_dir():
                fault = f"{self.folder}: the registry cannot be used ({folder / LOG} is missing)."
                raise InvalidArgument(fault, DAMAGED) from error
            return None
        except BaseException as error:
            if is_remote(self.folder) or not (isinstance(error, DeltaError) or _is_panic(error)):
                raise
            log = self.folder / FOLDERS[table] / LOG
            fault = f"{self.folder}: the registry cannot be used (a file of {log} is missing or damaged)."
            raise InvalidArgument(fault, DAMAGED) from error
        if delta.metadata().name != FORMAT:
            raise InvalidArgument(
                f"{self.folder} is no registry that this camssf can use: its format is {delta.metadata().name!r}, "
                f"not {FORMAT!r}.",
                "Use the camssf that wrote it, or name another folder.",
            )
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
            panic = _is_panic(error)
            remote = is_remote(self.folder) and isinstance(error, Exception)
            if not (panic or remote or isinstance(error, (OSError, duckdb.IOException, DeltaError))):
                raise
            words = getattr(error, "strerror", None) or without_secrets(error)
            damaged = DAMAGED if panic or isinstance(error, DeltaError) else "Check the folder."
            advice = "Check the address, the credentials and the network." if remote else damaged
            raise InvalidArgument(f"{self.folder}: the registry cannot be used ({words}).", advice) from error


def _is_panic(error: BaseException) -> bool:
    """Whether `deltalake` panicked, as it does where the log is damaged."""
    return type(error).__name__ == "PanicException"


def _fill(con: Any, name: str, kinds: dict[str, str], rows: list[dict[str, Any]]) -> None:
    """Make a table of rows in DuckDB."""
    each = ", ".join(f"unnest(?::{kind}[]) AS {name}" for name, kind in kinds.items())
    con.execute(f"CREATE OR REPLACE TABLE {name} AS SELECT {each}", [column(rows, name) for name in kinds])


def transaction() -> Any:
    """The identifier that every write of rows carries: of two that began at one version, the second fails."""
    from deltalake import CommitProperties, Transaction

    return CommitProperties(app_transactions=[Transaction("camssf", 1)])


def zstd() -> Any:
    """The compression of the files."""
    from deltalake import WriterProperties

    return WriterProperties(compression="ZSTD")


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
