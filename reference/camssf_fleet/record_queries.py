"""Queries the records of a registry by DuckDB: views, values and SQL."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np

from camssf.files import readable
from camssf.places import Place, file_system, is_remote
from camssf_fleet.records import COLUMNS, DELETION, EXCERPT, JOB, OF_RESULTS, RESULT, Row, columns

FETCHED = 4096
"""Records fetched at once."""
_CONFIG = {
    "autoinstall_known_extensions": "false",  # no network access
    "autoload_known_extensions": "false",  # no access to the home folder
    "temp_directory": "",  # no temporary files in the working folder
    "enable_external_file_cache": "false",  # nothing stays in memory of a file that is taken away
}
STREAMED = {"threads": "1", "preserve_insertion_order": "false"}
"""Settings by which the rows of a large answer are written as they are read, in any order."""


@cache
def _database(process: int) -> Any:
    """A database in memory; to make one takes 30 ms, so a process has one for all local files.

    Args:
        process: the number of this process; a child's copy of a parent's database may not work.
    """
    import duckdb

    return duckdb.connect(":memory:", config=_CONFIG)


@contextmanager
def connection(
    folder: Place | None = None, sizes: Mapping[str, int] | None = None, settings: Mapping[str, str] | None = None
) -> Iterator[Any]:
    """A DuckDB connection in memory, without extensions or temporary files, that can read a folder's files.

    Args:
        folder: a place; None for nothing but local files.
        sizes: of the files to be read, bytes; needed in an object store.
        settings: DuckDB's, of this connection's database alone.
    """
    import duckdb

    remote = folder is not None and is_remote(folder)
    if remote or settings:
        con = duckdb.connect(":memory:", config=_CONFIG | dict(settings or {}))
    else:
        con = _database(os.getpid()).cursor()
    try:
        con.execute("SET TimeZone = 'UTC'; SET parquet_metadata_cache = true")
        if folder is not None and remote:
            con.register_filesystem(file_system(folder, sizes or {}))
        yield con
    finally:
        con.close()


class Views:
    """A connection with views of the records in files, each created when a statement first names it: each takes time.

    `stored` has all records, `records` those that are not deleted, `said` of these what says something of a result.
    `results` has one row a result (`rows_of`), `rows` the same with times in UTC without a zone, for NumPy and for
    Python, where DuckDB needs another library to give times with one; so has `jobs`, with the ends of jobs.
    A column that lacks in an older file is null, and a later one is kept.

    Args:
        con: the connection.
        files: paths or URLs.
    """

    def __init__(self, con: Any, files: Sequence[str]) -> None:
        self._con, self._files, self._made = con, files, set[str]()

    def execute(self, sql: str, values: Sequence[Any] = ()) -> Any:
        """As of a DuckDB connection."""
        for name in map("".join, _VIEW.findall(sql)):
            if name.lower() not in self._made:
                self._made.add(name.lower())
                getattr(self, f"_{name.lower()}")()
        return self._con.execute(sql, values)

    def _stored(self) -> None:
        columns = ", ".join(f"{name} {kind}" for name, kind in COLUMNS.items())
        self.execute(f"CREATE TEMP TABLE nothing ({columns})")
        read = ""
        if self._files:
            paths = ", ".join(map(quoted, self._files))
            options = "union_by_name = true, filename = true, hive_partitioning = false"
            read = f" UNION ALL BY NAME SELECT * FROM read_parquet([{paths}], {options})"
        self.execute(f"CREATE TEMP VIEW stored AS SELECT *, '' AS filename FROM nothing{read}")

    def _deleted(self) -> None:
        records = f"SELECT unnest(records) AS record FROM stored WHERE kind = '{DELETION}'"
        self.execute(f"CREATE TEMP TABLE deleted AS {records}")

    def _records(self) -> None:
        (deleted,) = self.execute("SELECT count(*) FROM deleted").fetchone()
        without = " WHERE record NOT IN (FROM deleted)" if deleted else ""
        self.execute(f"CREATE TEMP VIEW records AS FROM stored{without}")

    def _said(self) -> None:
        self.execute(f"CREATE TEMP VIEW said AS FROM records WHERE kind IN {OF_RESULTS}")

    def _jobs(self) -> None:
        self.execute(f"CREATE TEMP VIEW jobs AS SELECT {in_utc(COLUMNS)} FROM records WHERE kind = '{JOB}'")

    def _results(self) -> None:
        several = "SELECT hash(key) AS hash FROM said GROUP BY ALL HAVING count(*) > 1"
        self.execute(f"CREATE TEMP TABLE several AS {several}")
        (count,) = self.execute("SELECT count(*) FROM several").fetchone()
        names = ", ".join([*columns(Row), "filename"])
        whole = f"SELECT {names} FROM said WHERE kind IN ('{RESULT}', '{EXCERPT}')"
        if count:
            folded = rows_of("hash(key) IN (FROM several)")
            whole += f" AND hash(key) NOT IN (FROM several) UNION ALL SELECT {names} FROM ({folded}) WHERE held"
        self.execute(f"CREATE TEMP VIEW results AS {whole}")

    def _rows(self) -> None:
        self.execute(f"CREATE TEMP VIEW rows AS SELECT {in_utc(columns(Row))} FROM results")


_VIEW = re.compile(r"(?i)\bFROM\s+(stored|deleted|records|said|results)\b|\b(rows|jobs)\b")
"""The views that a statement names. Users know `rows` and `jobs`, and may name them anywhere; our own statements name
the others after FROM alone."""


def rows_of(condition: str) -> str:
    """SQL for one row a result, of records that meet a condition: the last value that is said in each column.

    Last is what has the larger revision; then, a whole result goes before the excerpt in a passport; then the time
    of adding and the hash decide.
    """
    kinds = columns(Row) | {"filename": "VARCHAR"}
    folded = []
    for name, kind in kinds.items():
        if name in ("key", "added"):
            continue
        said = (
            f"{name} <> ''"
            if kind == "VARCHAR"
            else f"len({name}) > 0"
            if kind.endswith("[]")
            else f"{name} IS NOT NULL"
        )
        value, nothing = f"arg_max({name}, nth) FILTER ({said})", _EMPTY.get(kind[-2:])
        folded.append(f"coalesce({value}, {nothing}) AS {name}" if nothing else f"{value} AS {name}")
    return (
        f"SELECT key, min(added) AS added, {', '.join(folded)}, max(revision) AS revision, "
        f"bool_or(kind = '{RESULT}') AS whole, bool_or(kind <> 'fact') AS held FROM (SELECT *, row_number() OVER "
        f"(PARTITION BY key ORDER BY revision, kind = '{RESULT}', added, record) AS nth FROM said WHERE {condition}) "
        "GROUP BY key"
    )


_EMPTY = {"AR": "''", "[]": "[]"}
"""SQL for no value, by the end of a type's name: VARCHAR and lists."""


def fill(con: Any, name: str, kinds: Mapping[str, str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Make a table of rows in DuckDB; a whole column as one parameter is faster than row by row."""
    selected = ", ".join(f"unnest(?::{kind}[]) AS {column}" for column, kind in kinds.items())
    columns = [[row.get(column) for row in rows] for column in kinds]
    con.execute(f"CREATE TEMP TABLE {name} AS SELECT {selected}", columns)


def stored_value(column: str, value: Any) -> Any:
    """A value as DuckDB returns it once it is stored: lists, single precision where the column has it, plain text."""
    if isinstance(value, str):
        return readable(value)
    if COLUMNS[column] == "FLOAT[]":
        return np.asarray(value, np.float32).astype(float).tolist()
    if isinstance(value, (tuple, list)):
        return [readable(item) if isinstance(item, str) else item for item in value]
    return value


def dicts(answer: Any) -> list[dict[str, Any]]:
    """The rows of an answer; times get their zone, UTC."""
    return list(batches(answer))


def batches(answer: Any) -> Iterator[dict[str, Any]]:
    """As `dicts`, with FETCHED rows in memory at once."""
    names = [column[0] for column in answer.description]
    while rows := answer.fetchmany(FETCHED):
        for row in rows:
            pairs = zip(names, row, strict=True)
            yield {name: v.replace(tzinfo=UTC) if isinstance(v, datetime) else v for name, v in pairs}


def query_of(sql: str, values: Sequence[Any]) -> Callable[[Any], list[dict[str, Any]]]:
    """A function that returns the rows of a query over a connection."""
    return lambda con: dicts(con.execute(sql, list(values)))


def in_utc(kinds: Mapping[str, str]) -> str:
    """The columns, with times in UTC without a zone."""
    zoned = ("TIMESTAMPTZ", "TIMESTAMP WITH TIME ZONE")
    return ", ".join(f"{n} AT TIME ZONE 'UTC' AS {n}" if k in zoned else n for n, k in kinds.items())


def all_records(con: Any) -> Iterator[dict[str, Any]]:
    """All records that are stored, with all their columns, also those of a later release, and `filename`."""
    kinds = {name: kind for name, kind, *_ in con.execute("DESCRIBE FROM stored").fetchall()}
    return batches(con.execute(f"SELECT {in_utc(kinds)} FROM stored"))


def quoted(text: str) -> str:
    """A text as SQL."""
    return "'" + text.replace("'", "''") + "'"


def csv_cell(name: str, kind: str) -> str:
    """SQL for a column of a CSV; text that a spreadsheet would take for a formula gets a leading '."""
    if kind.endswith("[]"):
        return f"array_to_string({name}, ' ') AS {name}"
    if kind != "VARCHAR":
        return name
    return f"regexp_replace({name}, '(^|[;\\t])([=+\\-@\\t\\r\uff1d\uff0b\uff0d\uff20])', '\\1''\\2', 'g') AS {name}"


def as_json(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row for JSON: times as ISO 8601 in UTC."""
    return {
        name: value.isoformat().replace("+00:00", "Z") if isinstance(value, datetime) else value
        for name, value in row.items()
    }
