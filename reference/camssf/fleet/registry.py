"""Stores results, one row each, in a folder of Parquet files, for concurrent writers and readers.

Each write makes one file: under a temporary name, flushed to disk, then renamed. So a file is complete or absent, and
writers never wait for each other. DuckDB reads all files as one table in memory; a DuckDB database file would lock
readers out during a write. A row written twice, because a writer died before it knew that the first write was safe,
counts once. `gather` merges small files; it deletes them only after it has written the merged file, so concurrent
readers and a second `gather` lose nothing.
"""

from __future__ import annotations

import json
import os
import secrets
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from camssf.errors import InvalidArgument
from camssf.files import local, local_folder, readable, write_file
from camssf.fleet.rows import Row, Task, columns
from camssf.libraries import library
from camssf.photo.read.unit import Unit

Table: TypeAlias = type[Row] | type[Task]
Answer = TypeVar("Answer")

FORMAT = "camssf-registry/1"
MARK = "registry.json"
FOLDERS: dict[Table, str] = {Row: "results", Task: "tasks"}
IDENTITY: dict[Table, tuple[str, str]] = {Row: ("key", "added"), Task: ("task", "ended")}
"""Columns that identify a row, and that tell which of two versions of it is newer."""
NEEDED: dict[Table, tuple[str, ...]] = {Row: ("key", "status", "added"), Task: ("task", "status", "ended")}
"""Columns that the files of every release have."""
MANY_FILES = 256
LARGE_FILE = 4 * 2**20
"""Bytes; `gather` does not merge files of this size or larger."""
ATTEMPTS = 5
"""Attempts to read while another process runs `gather`."""
SHORT = ("name", "status", "code", "make", "model", "serial", "captured", "lamps", "half_width", "delta_e00", "key")
"""Columns of `Registry.listing`."""

WHICH_FOLDER = "Name the folder that `camssf registry add` or `camssf batch --registry` wrote to."
MOVE_AWAY = "Move it away, and add its results again from their archive."

_CONFIG = {
    "autoinstall_known_extensions": "false",  # no network access
    "autoload_known_extensions": "false",  # no access to the home folder
    "temp_directory": "",  # no temporary files in the working folder
}


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
    """A registry in a folder; with `new` the folder may be missing, and the first write creates it."""

    def __init__(self, folder: Path | str, *, new: bool = False) -> None:
        library("duckdb", "The registry needs", "fleet")
        self.folder = local_folder(folder)
        if not new and not self.folder.exists():
            raise InvalidArgument(f"There is no folder {self.folder}.", WHICH_FOLDER)
        found = _format(self.folder, new)
        if found != FORMAT:
            raise _no_registry(self.folder, found, new)

    # Writing

    def add(self, rows: Sequence[Row]) -> None:
        """Write rows; they are on disk when this returns.

        Raises:
            InvalidArgument: they cannot be written; then none of them is.
        """
        self._write(Row, rows)

    def note(self, tasks: Sequence[Task]) -> None:
        """Write finished jobs, as `add`; call it after their rows are written, so that each task has its result."""
        self._write(Task, tasks)

    def _write(self, table: Table, rows: Sequence[Row] | Sequence[Task]) -> None:
        if not rows:
            return
        with _failures(self.folder):
            place = self._place(table)
            with connection() as con:
                kinds = columns(table)
                each = ", ".join(f"unnest(?::{kind}[]) AS {name}" for name, kind in kinds.items())
                con.execute(f"CREATE TABLE fresh AS SELECT {each}", [_column(rows, name) for name in kinds])
                _put(con, "SELECT * FROM fresh", place)

    def _place(self, table: Table) -> Path:
        place = self.folder / FOLDERS[table]
        if not (self.folder / MARK).exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            write_file(self.folder / MARK, json.dumps({"format": FORMAT}) + "\n")
        place.mkdir(exist_ok=True)
        return place

    def gather(self) -> None:
        """Merge the small files into one.

        Raises:
            InvalidArgument: the file cannot be written; then nothing is lost.
        """
        import duckdb

        for table in FOLDERS:
            small = self._files(table)
            with _failures(self.folder):
                try:
                    small = [path for path in small if path.stat().st_size < LARGE_FILE]
                    if len(small) < 2:
                        continue
                    with connection() as con:
                        self._view(con, table, small)
                        _put(con, f"SELECT * FROM every {_once(table)}", self.folder / FOLDERS[table])
                except (FileNotFoundError, duckdb.Error) as error:
                    if not all(path.exists() for path in small):
                        continue  # another process gathers
                    _name_damaged(table, small, error)
                    raise
                for path in small:
                    path.unlink(missing_ok=True)

    # Reading

    def files(self) -> int:
        """Number of files with results."""
        return len(self._files(Row))

    def listing(self, wanted: Wanted | None = None, *, limit: int | None = None) -> list[dict[str, Any]]:
        """The results, newest first, in the columns SHORT."""
        where, values = (wanted or Wanted()).where()
        most = "" if limit is None else f" LIMIT {int(limit)}"
        return self.query(f"SELECT {', '.join(SHORT)} FROM rows WHERE {where} ORDER BY added DESC, key{most}", values)

    def count(self) -> dict[str, int]:
        """Numbers of results by status."""
        found = self.query("SELECT status, count(*) AS n FROM rows GROUP BY status ORDER BY status")
        return {each["status"]: each["n"] for each in found}

    def query(self, sql: str, values: Sequence[Any] = (), table: Table = Row) -> list[dict[str, Any]]:
        """The rows that a query returns; it selects from the view `rows`, which has every row once."""

        def ask(con: Any) -> list[dict[str, Any]]:
            found = con.execute(sql, list(values))
            names = [each[0] for each in found.description]
            return [dict(zip(names, each, strict=True)) for each in found.fetchall()]

        return self._ask(ask, table)

    def arrays(self, sql: str, values: Sequence[Any] = (), table: Table = Row) -> dict[str, Any]:
        """As `query`, but returns NumPy columns."""
        return self._ask(lambda con: dict(con.execute(sql, list(values)).fetchnumpy()), table)

    def _ask(self, ask: Callable[[Any], Answer], table: Table = Row) -> Answer:
        """Call `ask` with a connection that has the view `rows`; repeat if files were gathered meanwhile."""
        import duckdb

        with _failures(self.folder):
            for attempt in range(ATTEMPTS):
                files = self._files(table)
                try:
                    with connection() as con:
                        self._view(con, table, files)
                        identity, _ = IDENTITY[table]
                        count = f"SELECT count(*) > count(DISTINCT {identity}) FROM every"
                        doubled = con.execute(count).fetchone()[0]
                        con.execute(f"CREATE TEMP VIEW rows AS SELECT * FROM every {_once(table) if doubled else ''}")
                        return ask(con)
                except (FileNotFoundError, duckdb.Error) as error:
                    if attempt + 1 == ATTEMPTS or all(path.exists() for path in files):
                        _name_damaged(table, files, error)
                        raise
            raise AssertionError  # the last attempt returns or raises

    def export(self, path: Path | str) -> None:
        """Write all results to one file: .parquet with all columns, .csv without curves.

        Raises:
            InvalidArgument: another suffix, or the file cannot be written.
        """
        path = local(path)
        if path.suffix not in (".parquet", ".csv"):
            raise InvalidArgument(f"{path} ends in neither .parquet nor .csv.", "Give the file one of these endings.")
        what = "*"
        if path.suffix == ".csv":
            plain = {name: kind for name, kind in columns(Row).items() if kind != "FLOAT[]"}
            what = ", ".join(_cell(name, kind) for name, kind in plain.items())
        _check_place(path)
        self._ask(lambda con: _put(con, f"SELECT {what} FROM rows ORDER BY added, key", path.parent, path.name))

    def damaged(self, key: str, what: str) -> InvalidArgument:
        """The error for a damaged row, with the file that holds it; `what` describes the damage."""
        holds = "SELECT count(*) FROM read_parquet(?) WHERE key = ?"
        with connection() as con:
            found = [p for p in self._files(Row) if con.execute(holds, [str(p), key]).fetchone()[0]]
        place = found[0] if found else self.folder
        return InvalidArgument(f"{place} is damaged: of the result {key[:12]}... {what}.", MOVE_AWAY)

    def _files(self, table: Table) -> list[Path]:
        return sorted((self.folder / FOLDERS[table]).glob("[!.]*.parquet"))

    @staticmethod
    def _view(con: Any, table: Table, files: Sequence[Path]) -> None:
        """Create the view `every` of all rows in these files; a column missing in an older file is NULL."""
        con.execute(f"CREATE TEMP TABLE nothing ({_declared(table)})")
        if not files:
            con.execute("CREATE TEMP VIEW every AS SELECT * FROM nothing")
            return
        names = ", ".join(columns(table))
        listed = ", ".join(_quoted(str(path)) for path in files)
        needed = ", ".join(map(_quoted, NEEDED[table]))
        foreign = con.execute(
            f"SELECT file_name FROM parquet_schema([{listed}]) GROUP BY file_name "
            f"HAVING count(DISTINCT name) FILTER (name IN ({needed})) < {len(NEEDED[table])} ORDER BY 1"
        ).fetchone()
        if foreign is not None:
            raise InvalidArgument(
                f"{foreign[0]} is no file of a registry: it lacks {', '.join(NEEDED[table][:-1])} or "
                f"{NEEDED[table][-1]}.",
                "Move it away.",
            )
        con.execute(
            f"CREATE TEMP VIEW every AS SELECT {names} FROM (SELECT * FROM nothing UNION ALL BY NAME "
            f"SELECT * FROM read_parquet([{listed}], union_by_name = true))"
        )


def _name_damaged(table: Table, files: Sequence[Path], error: Exception) -> None:
    """Raise InvalidArgument for the first file that cannot be read by itself; return if all can."""
    import duckdb

    for path in files:
        try:
            with connection() as con:
                whole = _is_parquet(path)
                if whole:
                    Registry._view(con, table, [path])
                    con.execute("SELECT bit_xor(hash(every)) FROM every").fetchone()
        except FileNotFoundError:  # another process gathered it
            continue
        except duckdb.Error:
            whole = not path.exists()
        if not whole:
            raise InvalidArgument(f"{path} is damaged.", MOVE_AWAY) from error


def _check_place(path: Path) -> None:
    """Raise InvalidArgument if no file can be written there; later errors then concern the registry."""
    probe = path.parent / f".camssf-{os.getpid()}-{secrets.token_hex(8)}"
    try:
        if path.is_dir():
            raise IsADirectoryError(21, "Is a directory")
        probe.touch()
        probe.unlink()
    except (OSError, ValueError) as error:
        words = getattr(error, "strerror", None) or error
        raise InvalidArgument(f"{path} cannot be written ({words}).", "Name another place for it.") from error


def _format(folder: Path, new: bool) -> str | None:
    """The format in the folder's MARK file. Without the file: FORMAT if `new` and the folder is empty, else None."""
    for _ in range(2):  # another writer may create the registry between the two checks: then try again
        try:
            mark = json.loads((folder / MARK).read_text("utf-8"))
            return str(mark.get("format")) if isinstance(mark, dict) else None
        except FileNotFoundError:
            if _empty(folder):
                return FORMAT if new else None
        except (OSError, ValueError):
            return None
    return None


def _no_registry(folder: Path, found: str | None, new: bool) -> InvalidArgument:
    """The error for a folder whose mark is missing or of another format."""
    if found is not None:
        return InvalidArgument(
            f"{folder} is no registry that this camssf can use: its format is {found!r}, not {FORMAT!r}.",
            "Use the camssf that wrote it, or name another folder.",
        )
    if new:
        why, advice = "it is a file, or holds something else", "Name a new or an empty folder."
    else:
        why, advice = f"it holds no {MARK}", WHICH_FOLDER
    return InvalidArgument(f"{folder} is no registry: {why}.", advice)


def _empty(folder: Path) -> bool:
    """Whether the folder is missing or empty, apart from temporary files of other writers."""
    try:
        return all(path.name.startswith(".") for path in folder.iterdir())
    except FileNotFoundError:
        return True
    except OSError:
        return False


@contextmanager
def connection() -> Iterator[Any]:
    """A DuckDB connection in memory, without extensions, network access or temporary files."""
    import duckdb

    con = duckdb.connect(":memory:", config=_CONFIG)
    try:
        yield con
    finally:
        con.close()


@contextmanager
def _failures(folder: Path) -> Iterator[None]:
    import duckdb

    try:
        yield
    except (OSError, duckdb.IOException) as error:
        words = getattr(error, "strerror", None) or str(error).partition("\n")[0]
        raise InvalidArgument(f"{folder}: the registry cannot be used ({words}).", "Check the folder.") from error


def _put(con: Any, sql: str, folder: Path, name: str | None = None) -> None:
    """Write a query's result to a file: under a temporary name, flushed to disk, then renamed."""
    suffix = "csv" if name is not None and name.endswith(".csv") else "parquet"
    token = f"{os.getpid()}-{threading.get_ident()}-{secrets.token_hex(8)}"
    aside = folder / f".camssf-{token}"
    form = "FORMAT csv, HEADER true" if suffix == "csv" else "FORMAT parquet, COMPRESSION zstd"
    try:
        con.execute(f"COPY ({sql}) TO {_quoted(str(aside))} ({form})")
        handle = os.open(aside, os.O_RDWR)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
        os.replace(aside, folder / (name or f"{token}.{suffix}"))
        _sync_folder(folder)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise


def _sync_folder(folder: Path) -> None:
    """Flush the folder's entry to disk; systems that cannot open a folder are left alone."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _once(table: Table) -> str:
    identity, newer = IDENTITY[table]
    return f"QUALIFY row_number() OVER (PARTITION BY {identity} ORDER BY {newer} DESC) = 1"


def _declared(table: Table) -> str:
    return ", ".join(f"{name} {kind}" for name, kind in columns(table).items())


def _column(rows: Sequence[Row] | Sequence[Task], name: str) -> list[Any]:
    """Values of one column as DuckDB takes them; a whole column as one parameter is faster than row by row."""
    values = (getattr(each, name) for each in rows)
    return [list(v) if isinstance(v, tuple) else readable(v) if isinstance(v, str) else v for v in values]


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"


def _cell(name: str, kind: str) -> str:
    """SQL for a column of a CSV; text that a spreadsheet would take for a formula gets a leading '."""
    if kind.endswith("[]"):
        return f"array_to_string({name}, ' ') AS {name}"
    if kind != "VARCHAR":
        return name
    return f"regexp_replace({name}, '(^|[;\\t])([=+\\-@\\t\\r\uff1d\uff0b\uff0d\uff20])', '\\1''\\2', 'g') AS {name}"


def _is_parquet(path: Path) -> bool:
    """Whether the file begins and ends with Parquet's magic bytes."""
    with open(path, "rb") as stream:
        head = stream.read(4)
        stream.seek(-min(4, path.stat().st_size), os.SEEK_END)
        return head == stream.read(4) == b"PAR1"


def as_json(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row for JSON: times as ISO 8601 in UTC."""
    return {name: f"{v.isoformat()}Z" if hasattr(v, "isoformat") else v for name, v in row.items()}
