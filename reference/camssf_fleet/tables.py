"""Queries the files of a registry's tables by DuckDB: views, values and SQL."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any, TypeAlias

from camssf.files import readable
from camssf.places import Place, file_system, is_remote
from camssf_fleet.rows import Row, Task, columns

Table: TypeAlias = type[Row] | type[Task]

FETCHED = 4096
"""Rows in memory at once."""

_CONFIG = {
    "autoinstall_known_extensions": "false",  # no network access
    "autoload_known_extensions": "false",  # no access to the home folder
    "temp_directory": "",  # no temporary files in the working folder
}


def create_views(con: Any, table: Table, files: Sequence[str]) -> None:
    """Create views of all rows in these files; a column missing in an older file is NULL.

    `every` has the columns of this release, `rows` has times in UTC without a zone, for NumPy and for Python, where
    DuckDB needs another library to give times with one.
    """
    kinds = columns(table) | {"checksum": "VARCHAR", "filename": "VARCHAR"}
    con.execute(f"CREATE TEMP TABLE nothing ({', '.join(f'{name} {kind}' for name, kind in kinds.items())})")
    read = ""
    if files:
        listed = ", ".join(quoted(path) for path in files)
        read = (
            f" UNION ALL BY NAME SELECT * FROM read_parquet([{listed}], union_by_name = true, filename = true, "
            "hive_partitioning = true, hive_types_autocast = false)"
        )
    con.execute(f"CREATE TEMP VIEW every AS SELECT {', '.join(kinds)} FROM (SELECT * FROM nothing{read})")
    con.execute(f"CREATE TEMP VIEW rows AS SELECT {in_utc(kinds)} FROM every")


@contextmanager
def connection(place: Place | None = None, sizes: Mapping[str, int] | None = None) -> Iterator[Any]:
    """A DuckDB connection in memory, without extensions or temporary files, that can read the place's files.

    Args:
        place: a folder; None for nothing but local files.
        sizes: of the files to be read, bytes; needed in an object store.
    """
    import duckdb

    con = duckdb.connect(":memory:", config=_CONFIG)
    try:
        con.execute("SET TimeZone = 'UTC'")
        if place is not None and is_remote(place):
            con.register_filesystem(file_system(place, sizes or {}))
        yield con
    finally:
        con.close()


def row_batches(con: Any, file: str, where: str = "true") -> Iterator[dict[str, Any]]:
    """The rows of one file with all its columns, also those of a later release; `where` is an SQL condition."""
    read = f"read_parquet([{quoted(file)}], hive_partitioning = true, hive_types_autocast = false)"
    kinds = {name: kind for name, kind, *_ in con.execute(f"DESCRIBE SELECT * FROM {read}").fetchall()}
    kinds = {name: "TIMESTAMPTZ" if kind == "TIMESTAMP WITH TIME ZONE" else kind for name, kind in kinds.items()}
    found = con.execute(f"SELECT {in_utc(kinds)} FROM {read} WHERE {where}")
    names = [each[0] for each in found.description]
    while rows := found.fetchmany(FETCHED):
        yield from (_with_zones(names, row) for row in rows)


def query_of(sql: str, values: Sequence[Any]) -> Callable[[Any], list[dict[str, Any]]]:
    """A function that returns the rows of a query over a connection."""
    return lambda con: dicts(con.execute(sql, list(values)))


def dicts(found: Any) -> list[dict[str, Any]]:
    """The rows of an answer; times get their zone, UTC."""
    names = [each[0] for each in found.description]
    return [_with_zones(names, each) for each in found.fetchall()]


def _with_zones(names: Sequence[str], values: Sequence[Any]) -> dict[str, Any]:
    pairs = zip(names, values, strict=True)
    return {name: value.replace(tzinfo=UTC) if isinstance(value, datetime) else value for name, value in pairs}


def in_utc(kinds: Mapping[str, str]) -> str:
    """The columns, with times in UTC without a zone."""
    return ", ".join(f"{n} AT TIME ZONE 'UTC' AS {n}" if k == "TIMESTAMPTZ" else n for n, k in kinds.items())


def in_partitions(names: Sequence[str], values: set[tuple[str, ...]], prefix: str = "") -> str:
    """The SQL condition that a row is in one of these partitions."""
    terms = (
        " AND ".join(f"{prefix}{name} = {quoted(value)}" for name, value in zip(names, each, strict=True))
        for each in sorted(values)
    )
    return " OR ".join(f"({term})" for term in terms if term) or "true"


def column(rows: Sequence[Mapping[str, Any]], name: str) -> list[Any]:
    """Values of one column as DuckDB takes them; a whole column as one parameter is faster than row by row."""
    values = (row[name] for row in rows)
    return [list(v) if isinstance(v, tuple) else readable(v) if isinstance(v, str) else v for v in values]


def quoted(text: str) -> str:
    """A text as SQL, for DuckDB and for deltalake."""
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
