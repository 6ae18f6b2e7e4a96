"""A registry: what was said of many results, in records that never change.

A row shows what all records of a result say together (`record_queries.rows_of`). A later record adds or corrects, and
empties nothing. Each record is known by the hash of what it says, so that saying it again adds nothing.

After records are written, a list is, with the hashes of all records that no list has, and of the lists before it; so
`verification` knows what must be there.
"""

from __future__ import annotations

import getpass
import platform
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from camssf.errors import InvalidArgument
from camssf.files import local, readable, write_aside
from camssf.libraries import library
from camssf.photo.read.unit import Unit
from camssf.places import Place, folder_place
from camssf.shapes import Count, Text
from camssf_fleet.merge import CORRECT, FACTS, Added, Json, Sayings, in_words, merge
from camssf_fleet.record_files import DAMAGED, MANY_FILES, ROW_GROUP, RecordFiles
from camssf_fleet.record_queries import STREAMED, csv_cell, dicts, in_utc, query_of, quoted, rows_of, stored_value
from camssf_fleet.records import (
    COLUMNS,
    DELETION,
    EXCERPT,
    JOB,
    LIST,
    RESULT,
    JobEnd,
    Row,
    columns,
    is_empty,
    one_spelling,
    record_hash,
)

SHORT = ("name", "status", "code", "make", "model", "serial", "captured", "lamps", "half_width", "delta_e00", "key")
"""Columns of `Registry.listing`."""
LONGEST_LIST = 4096
"""Largest number of records in one list."""
WHICH_FOLDER = "Name the folder that `camssf registry add` or `camssf batch --registry` wrote to."


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
        equal = {name: one_spelling(getattr(self.unit, name)) for name in ("make", "model", "serial")}
        terms = [f"{name} = ?" for name, value in equal.items() if value]
        values: list[Any] = [value for value in equal.values() if value]
        if self.statuses:
            terms.append("list_contains(?, status)")
            values.append(list(self.statuses))
        return " AND ".join(terms) or "true", values


@dataclass(frozen=True)
class HistoryEntry:
    """What one record said.

    Attributes:
        added: UTC, ISO 8601.
        added_by: user and machine.
        key: of the result.
        what: in words.
    """

    added: str
    added_by: str
    key: str
    what: str


@dataclass(frozen=True)
class Deleted:
    """A deleted result.

    Attributes:
        key: SHA-256 of its document.
        place: path of its document, relative to the registry; "" if unknown.
    """

    key: Text
    place: Text


@dataclass(frozen=True)
class Deletion:
    """What `Registry.delete` removed.

    Attributes:
        results: each deleted result.
        records: number of records that were deleted.
        files: number of files that were written again without them.
    """

    results: tuple[Deleted, ...]
    records: Count
    files: Count


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
        self.folder: Place = folder_place(folder)
        self._correct = correct
        if str(self.folder).startswith("memory:"):
            raise InvalidArgument("A registry cannot be in memory://.", "Name a folder, or a bucket of a store.")
        self.files = RecordFiles(self.folder)
        with self.files.failures():
            # Another writer may begin the registry between two looks: the last one is for its files.
            if not self.files.sizes() and not (new and (_is_empty(self.folder) or self.files.sizes())):
                raise _no_registry(self.folder, new)

    # Writing

    def add(self, rows: Sequence[Row], *, names: Sequence[str] = ()) -> tuple[Added, ...]:
        """Add what rows say, and list it.

        Args:
            rows: what is said now; a field that is empty empties nothing.
            names: of the rows' files, for messages.

        Raises:
            InvalidArgument: they cannot be written, or one contradicts the registry or a row before, then nothing is;
                or they were written and the list cannot be, which the message says.
        """
        added = self.append(rows, (), names=names)
        try:
            self.list_records()
            self.files.compact(MANY_FILES)
        except InvalidArgument as error:
            message = f"The results were added, but then: {error.message}"
            raise InvalidArgument(message, "Mend the cause; the next `camssf registry add` does the rest.") from error
        return added

    def append(
        self,
        rows: Sequence[Row],
        ends: Callable[[tuple[Added, ...]], Sequence[JobEnd]] | Sequence[JobEnd] = (),
        *,
        partly: bool = False,
        names: Sequence[str] = (),
    ) -> tuple[Added, ...]:
        """Add what rows say and how jobs ended; `list_records` must follow, after any number of calls.

        Args:
            rows: as in `add`.
            ends: of jobs, or a function that gets what became of the rows and returns them.
            partly: if a row contradicts the registry, write the others.
            names: as in `add`.
        """
        stated = [_said_by(row) for row in rows]
        held = self._held([row["key"] for row in stated])
        records, added, now = list[Json](), list[Added](), datetime.now(UTC)
        for row in stated:
            old = held.get(row["key"])
            statement = merge(old, row, self._correct)
            added.append(statement.added)
            if statement.added.contradiction:
                continue
            records += [record | {"added": row["added"]} for record in statement.records(old)]
            held[row["key"]] = statement.after(old)
        wrong = [
            f"{f'{name}: ' if name else ''}{row.contradiction}"
            for name, row in zip(names or [""] * len(added), added, strict=True)
            if row.contradiction
        ]
        if wrong and not partly:
            more = f" So do {len(wrong) - 1} more." if len(wrong) > 1 else ""
            raise InvalidArgument(f"{wrong[0]}{more}", CORRECT)
        jobs = ends(tuple(added)) if callable(ends) else ends
        self._write(records + self._new_ends([_plain(vars(end)) | {"kind": JOB, "revision": 0} for end in jobs]), now)
        return tuple(added)

    def _new_ends(self, ends: Sequence[Json]) -> list[Json]:
        """The ends of jobs that no record says already."""
        hashes = [record_hash(end) for end in ends]
        sql = "SELECT record, task FROM records WHERE kind = 'job' AND list_contains(?, record)"
        known = set(self.files.ask(lambda con: con.execute(sql, [hashes]).fetchall())) if ends else set()
        return [end for hashed, end in zip(hashes, ends, strict=True) if (hashed, end["task"]) not in known]

    def _held(self, keys: Sequence[str]) -> dict[str, Json]:
        """What the registry says of results, by key, also of those of which it has only facts."""
        if not keys:
            return {}
        kinds = columns(Row) | {"revision": "", "whole": "", "held": ""}
        sql = f"SELECT {in_utc(kinds)} FROM ({rows_of('list_contains(?, key)')})"
        names = in_utc({name: COLUMNS[name] for name in FACTS})
        facts = f"SELECT key, revision, {names} FROM said WHERE list_contains(?, key)"
        rows, said = self.files.ask(lambda con: [query_of(text, [list(keys)])(con) for text in (sql, facts)])
        sayings = Sayings()
        for record in said:
            sayings.add(record)
        disputed = sayings.disputed()
        return {row["key"]: row | {"disputed": tuple(disputed.get(row["key"], ()))} for row in rows}

    def _write(self, records: Sequence[Json], now: datetime) -> None:
        """Write records with their hashes, and who adds them; one that says what a deleted one said is a revision."""
        if not records:
            return
        by, named, deleted = _user(), [], set[str]()
        if records[0]["kind"] != LIST:  # no list is ever deleted
            deleted = {record for (record,) in self.files.ask(lambda con: con.execute("FROM deleted").fetchall())}
        for record in records:
            hashed = record_hash(record)
            while hashed in deleted:
                record["revision"] += 1
                hashed = record_hash(record)
            named.append({"added": now, "added_by": by} | record | {"record": hashed})
        self.files.write(named)

    def list_records(self) -> None:
        """Write lists of the records that no list has.

        If one list was lost, and a list of these records after the lists before it has its hash, it is written again.
        """
        sql = (
            "SELECT DISTINCT record, coalesce(key, '') AS key FROM records WHERE kind <> 'list' "
            "AND record NOT IN (SELECT unnest(records) FROM records WHERE kind = 'list') ORDER BY record",
            "SELECT record, previous FROM records WHERE kind = 'list'",
        )
        unlisted, there = self.files.ask(lambda con: [query_of(text, [])(con) for text in sql])
        if not unlisted:
            return
        known = {row["record"]: row["previous"] or [] for row in there}
        lost = {record for previous in known.values() for record in previous} - known.keys()
        lists = _lists(unlisted, heads(known))
        again = _lists(unlisted, heads(known, lost)) if lost else lists
        self._write(again if record_hash(again[-1]) in lost else lists, datetime.now(UTC))

    def delete(self, unit: Unit) -> Deletion:
        """Delete all records of a unit's results, and of its jobs, and the files that held them.

        A list of their hashes remains. The documents remain, too.

        Raises:
            InvalidArgument: the files cannot be read or written; the same call then does the rest.
        """
        where, values = Wanted(unit).where()

        def question(con: Any) -> tuple[list[Json], list[Json]]:
            results = dicts(con.execute(f"SELECT key, place FROM rows WHERE {where} ORDER BY place, key", values))
            alone = f"{where} AND (kind = '{JOB}' OR key NOT IN (SELECT key FROM rows))"  # no result of another unit
            said = f"kind NOT IN ('{LIST}', '{DELETION}') AND (list_contains(?, key) OR ({alone}))"
            sql = f"SELECT DISTINCT record, coalesce(key, '') AS key FROM records WHERE {said} ORDER BY ALL"
            records = con.execute(sql, [[row["key"] for row in results], *values])
            return results, dicts(records)

        results, records = self.files.ask(question)
        if records:
            self.files.holders([row["record"] for row in records])  # raises before anything is written
            said = {"records": [row["record"] for row in records], "keys": [row["key"] for row in records]}
            self._write([{"kind": DELETION, "revision": 0} | said], datetime.now(UTC))
            self.list_records()
        deleted = self.files.ask(lambda con: con.execute("SELECT DISTINCT record FROM deleted").fetchall())
        files = self.files.drop([record for (record,) in deleted])
        return Deletion(tuple(Deleted(**row) for row in results), len(records), files)

    # Reading

    def listing(self, wanted: Wanted | None = None) -> list[Json]:
        """The results, newest first, in the columns SHORT."""
        where, values = (wanted or Wanted()).where()
        return self.query(f"SELECT {', '.join(SHORT)} FROM rows WHERE {where} ORDER BY added DESC, key", values)

    def query(self, sql: str, values: Sequence[Any] = ()) -> list[Json]:
        """The rows that a query on the views `rows` and `jobs` returns."""
        return self.files.ask(query_of(sql, values))

    def arrays(self, sql: str, values: Sequence[Any] = ()) -> dict[str, Any]:
        """As `query`, but returns NumPy columns; times are in UTC."""
        return self.files.ask(lambda con: dict(con.execute(sql, list(values)).fetchnumpy()))

    def history(self, unit: Unit) -> list[HistoryEntry]:
        """What was said of a unit's results: of each result in the order of saying, whatever the clock said.

        A result belongs to the unit if any of its records ever said so.
        """
        where, values = Wanted(unit).where()
        once = "row_number() OVER (PARTITION BY record ORDER BY added) = 1"
        of_unit = f"SELECT {in_utc(COLUMNS)} FROM said WHERE key IN (SELECT key FROM said WHERE {where})"
        sql = f"{of_unit} QUALIFY {once} ORDER BY revision, kind = 'fact', added, record"
        held, changes = dict[str, Json](), list[HistoryEntry]()
        first: dict[str, None] = {}
        for record in self.files.ask(query_of(sql, values)):
            old = held.get(record["key"])
            statement = merge(old, record, True)
            facts = [f"{word} {in_words(record[name])}" for name, word in FACTS.items() if not is_empty(record[name])]
            what = [f"{record['status']} {record['kind']}", *facts] if old is None else statement.added.changes
            when = f"{record['added']:%Y-%m-%dT%H:%M:%SZ}"
            changes.append(
                HistoryEntry(when, record["added_by"] or "", record["key"], ", ".join(what) or "name or place")
            )
            held[record["key"]] = statement.after(old)
            first.setdefault(record["key"])
        return [change for key in first for change in changes if change.key == key]

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
        sql = f"COPY (SELECT {what} FROM results) TO"
        with write_aside(path) as aside:
            self.files.ask(lambda con: con.execute(f"{sql} {quoted(str(aside))} ({form})"), settings=STREAMED)

    def damaged(self, key: str, what: str) -> InvalidArgument:
        """The error for a damaged row, with the file that holds it; `what` describes the damage."""
        holders = self.query("SELECT filename FROM results WHERE key = ?", [key])
        place = holders[0]["filename"] if holders else self.folder
        return InvalidArgument(f"{place} is damaged: of the result {key[:12]}... {what}.", DAMAGED)


def _said_by(row: Row) -> Json:
    """A row as a record: of a passport's excerpt if it has a passport and no covariance."""
    excerpt = bool(row.passport) and not row.code_covariance
    return _plain(vars(row)) | {"kind": EXCERPT if excerpt else RESULT}


def _plain(values: dict[str, Any]) -> Json:
    return {name: stored_value(name, value) for name, value in values.items()}


def _lists(unlisted: Sequence[Json], previous: list[str]) -> list[Json]:
    """Lists of records, one after the other, the first after the lists `previous`."""
    lists = list[Json]()
    for first in range(0, len(unlisted), LONGEST_LIST):
        part = unlisted[first : first + LONGEST_LIST]
        content = {"records": [row["record"] for row in part], "keys": [row["key"] for row in part]}
        lists.append({"kind": LIST, "revision": 0, "previous": previous} | content)
        previous = [record_hash(lists[-1])]
    return lists


def heads(lists: Mapping[str, Sequence[str]], without: Collection[str] = ()) -> list[str]:
    """The newest lists: those that no other names; one, unless several writers wrote at once.

    Args:
        lists: the lists before each list.
        without: leave out these, and all after them.
    """
    after, size = set(without), -1
    while size < len(after):
        size = len(after)
        after |= {record for record, previous in lists.items() if not after.isdisjoint(previous)}
    rest = {record: previous for record, previous in lists.items() if record not in after}
    return sorted(rest.keys() - {record for previous in rest.values() for record in previous})


def _user() -> str:
    """Who runs this program, and where."""
    try:
        name = getpass.getuser()
    except (OSError, KeyError, ImportError):  # no entry for the user's number, as in some containers
        name = "unknown"
    return readable(f"{name}@{platform.node()}")


def _is_empty(folder: Place) -> bool:
    """Whether the folder is missing or empty, apart from hidden files."""
    if not folder.exists():
        return True
    try:
        return all(path.name.startswith(".") for path in folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return not folder.exists()


def _no_registry(folder: Place, new: bool) -> InvalidArgument:
    if not folder.exists():
        return InvalidArgument(f"There is no folder {folder}.", WHICH_FOLDER)
    if new:
        return InvalidArgument(f"{folder} is no registry: it holds something else.", "Name a new or an empty folder.")
    return InvalidArgument(f"{folder} is no registry: it holds no file of records.", WHICH_FOLDER)
