"""Stores records in Parquet files that never change, each named by the SHA-256 of its content; DuckDB reads them.

A writer adds files. What takes files away (`compact`, `drop`) has written their other records into a new file before.
A new file has a random salt, so that it never has the name of a file that another process takes away. So there is
nothing to lock, and a process that is killed leaves each record once or twice; one that is there twice counts once.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

from camssf.errors import InvalidArgument
from camssf.files import temporary_folder
from camssf.places import (
    Place,
    files_below,
    is_remote,
    reached,
    without_secrets,
    write_place,
)
from camssf_fleet.inputs import file_hash
from camssf_fleet.record_queries import Views, connection, fill, quoted
from camssf_fleet.records import COLUMNS, HEAD, JOB

Answer = TypeVar("Answer")

NAME = re.compile(r"([0-9a-f]{64})\.parquet")
"""A file's name, with the SHA-256 of its content."""
ORDER = "kind, make, model, serial, key, record"
"""The order of the records in a file, so that most questions read a part of it."""
ROW_GROUP = 4096
"""Records of a file that are in memory at once; with covariances, 45 MB."""
LARGE_FILE = 16 * 2**20
"""Bytes; a file of this size or larger is not compacted."""
MANY_FILES = 64
"""With so many smaller files, `add` and `batch` compact them."""
ATTEMPTS = 50
"""Attempts to read while other processes compact."""

DAMAGED = (
    "Move the file away, and put it back from a backup, or run the same `camssf batch` again: it writes what its "
    "archive has and the registry lacks."
)


class RecordFiles:
    """The files of a registry.

    Attributes:
        folder: of the files, a place.
    """

    def __init__(self, folder: Place) -> None:
        self.folder = folder

    def sizes(self) -> dict[str, int]:
        """Size in bytes of each file, by path or URL; files with another kind of name are left out."""
        with self.failures():
            if is_remote(self.folder):
                scheme, fs = str(self.folder).partition("://")[0], self.folder.fs  # type: ignore[attr-defined]
                entries = fs.find(self.folder.path, maxdepth=1, detail=True)  # type: ignore[attr-defined]
                sizes = {f"{scheme}://{name.lstrip('/')}": int(info["size"]) for name, info in entries.items()}
            else:
                sizes = {}
                with suppress(FileNotFoundError), os.scandir(self.folder) as entries:
                    for entry in entries:
                        with suppress(FileNotFoundError):  # compacted meanwhile
                            sizes[str(self.folder / entry.name)] = entry.stat().st_size
            return {path: size for path, size in sorted(sizes.items()) if NAME.fullmatch(_name(path))}

    def others(self) -> list[str]:
        """Files in the folder that are not a registry's, without hidden ones."""
        names = (path for path in files_below(self.folder) if not path.name.startswith("."))
        return [str(path) for path in names if not NAME.fullmatch(path.name)]

    # Writing

    def write(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Write records into a new file, and the ends of jobs into another, so that no file's loss takes both.

        Args:
            records: values of COLUMNS; one that lacks is null.

        Raises:
            InvalidArgument: they cannot be written; then the ends of jobs are not.
        """
        ends = [record for record in records if record["kind"] == JOB]
        for part in ([record for record in records if record["kind"] != JOB], ends):
            if part:
                with self.failures(), connection() as con:
                    fill(con, "fresh", COLUMNS, part)
                    self._write(con, "FROM fresh")

    def _write(self, con: Any, source: str) -> Place:
        """Write the records of a query; returns the file."""
        with temporary_folder() as folder:
            path = folder / "records.parquet"
            con.execute(
                f"COPY ({source} ORDER BY {ORDER}) TO {quoted(str(path))} (FORMAT parquet, COMPRESSION zstd, "
                f"ROW_GROUP_SIZE {ROW_GROUP}, KV_METADATA {{salt: {quoted(secrets.token_hex(16))}}})"
            )
            content = path.read_bytes()
        file = self.folder / f"{hashlib.sha256(content).hexdigest()}.parquet"
        write_place(file, content)
        return file

    def compact(self, least: int = 2) -> int:
        """Merge smaller files into larger ones, if there are at least so many; returns the number taken away.

        Files that are damaged or strange stay as they are, for `verification` to name.

        Raises:
            InvalidArgument: the files cannot be read or written; then nothing is lost.
        """
        sizes = self.sizes()
        small = {path: size for path, size in sizes.items() if size < LARGE_FILE}
        if len(small) < least:
            return 0
        sql = f"SELECT filename, bool_or(kind = '{JOB}') FROM stored GROUP BY filename"
        of_jobs = dict(self.ask(lambda con: con.execute(sql).fetchall()))
        taken = 0
        sound = {path: size for path, size in small.items() if self.fault(path, sizes) is None}
        for jobs in (False, True):
            group, filled = list[str](), 0
            for path, size in sound.items():
                if of_jobs.get(path) != jobs:
                    continue
                group.append(path)
                filled += size
                if filled >= LARGE_FILE:
                    taken += self._rewrite(group)
                    group, filled = [], 0
            taken += self._rewrite(group) if len(group) > 1 else 0
        return taken

    def holders(self, records: Sequence[str]) -> list[str]:
        """The files that hold any of these records, by their hashes.

        Raises:
            InvalidArgument: the files cannot be read, or one is damaged.
        """
        sql = "SELECT DISTINCT filename FROM stored WHERE list_contains(?, record)"
        files = sorted(file for (file,) in self.ask(lambda con: con.execute(sql, [list(records)]).fetchall()))
        sizes = self.sizes()
        for file in files:
            if (fault := self.fault(file, sizes)) is not None:
                raise InvalidArgument(f"{file} {fault}.", DAMAGED)
        return files

    def drop(self, records: Sequence[str]) -> int:
        """Take deleted records, by their hashes, out of all files that hold them; returns the number of these files.

        Raises:
            InvalidArgument: as `holders`, or a file cannot be written; then the records are still in some.
        """
        return sum(self._rewrite([file]) for file in self.holders(records))

    def _rewrite(self, paths: Sequence[str]) -> int:
        """Write the records of files, without deleted ones, into one file, and take the files away."""
        kept = (
            f"SELECT * EXCLUDE filename FROM records WHERE filename IN ({', '.join(map(quoted, paths))}) "
            "QUALIFY row_number() OVER (PARTITION BY record, task ORDER BY added) = 1"
        )

        def merge(con: Any) -> set[str]:
            con.execute(f"CREATE TEMP TABLE kept AS {kept}")
            if con.execute("SELECT count(*) FROM kept").fetchone() != (0,):
                self._write(con, "FROM kept")
            return {name for (name,) in con.execute("SELECT DISTINCT filename FROM stored").fetchall()}

        taken = self.ask(merge).intersection(paths)
        for path in sorted(taken):
            self._remove(path)
        return len(taken)

    def fault(self, path: str, sizes: Mapping[str, int]) -> str | None:
        """What is wrong with a file's content, in words; None if nothing is, or if it is gone.

        Args:
            path: of the file.
            sizes: of all files.
        """
        import duckdb

        try:
            if f"{file_hash(self.folder / _name(path))}.parquet" != _name(path):
                return "differs from its name: it was changed or cut"
            kinds = self._kinds(path, sizes)
        except (duckdb.Error, OSError) as error:
            return f"cannot be read ({_in_words(error)})" if path in self.sizes() else None
        wrong = [name for name in HEAD if name not in kinds]
        wrong += [name for name, kind in COLUMNS.items() if kinds.get(name, kind) != kind]
        return f"is no file of a registry (its columns {', '.join(wrong)})" if wrong else None

    def _kinds(self, path: str, sizes: Mapping[str, int]) -> dict[str, str]:
        """The columns of a file and their DuckDB types; reads the whole file.

        Raises:
            duckdb.Error, OSError: it cannot be read.
        """
        with connection(self.folder, sizes) as con:
            read = f"FROM read_parquet({quoted(path)}, hive_partitioning = false)"
            con.execute(f"SELECT bit_xor(hash(stored)) {read} AS stored").fetchone()
            described = con.execute(f"DESCRIBE {read}")
            return {name: kind.replace(" WITH TIME ZONE", "TZ") for name, kind, *_ in described.fetchall()}

    def _remove(self, path: str) -> None:
        file = self.folder / _name(path)
        with self.failures(), reached(file, "removed"), suppress(FileNotFoundError):  # another process took it away
            file.unlink()

    # Reading

    def ask(
        self,
        question: Callable[[Views], Answer],
        files: Sequence[str] | None = None,
        settings: Mapping[str, str] | None = None,
    ) -> Answer:
        """Call a function with a connection that has the views; again if a file was compacted meanwhile.

        Args:
            question: gets the connection.
            files: read these only.
            settings: as for `connection`.

        Raises:
            InvalidArgument: a file is damaged, or the files cannot be read.
        """
        import duckdb

        with self.failures():
            for attempt in range(ATTEMPTS):
                sizes = self.sizes()
                sizes = sizes if files is None else {path: sizes[path] for path in files if path in sizes}
                try:
                    with connection(self.folder, sizes, settings) as con:
                        return question(Views(con, list(sizes)))
                except (FileNotFoundError, duckdb.Error) as error:
                    if attempt + 1 == ATTEMPTS or not sizes.keys() - self.sizes().keys():
                        self._name_damaged(sizes, error)
                        raise
            raise AssertionError  # the last attempt returns or raises

    def _name_damaged(self, sizes: Mapping[str, int], error: Exception) -> None:
        """Raise InvalidArgument for the first file that cannot be read by itself; return if all can."""
        import duckdb

        for path in sizes:
            try:
                self._kinds(path, sizes)
            except (duckdb.Error, OSError) as fault:
                what = "damaged, missing or out of reach" if is_remote(self.folder) else "damaged or missing"
                raise InvalidArgument(f"{path} is {what} ({_in_words(fault)}).", DAMAGED) from error

    @contextmanager
    def failures(self) -> Iterator[None]:
        """Turn errors of the libraries, the disk and the object store into InvalidArgument."""
        import duckdb

        try:
            yield
        except InvalidArgument:
            raise
        except Exception as error:
            remote = is_remote(self.folder)
            if not (remote or isinstance(error, (OSError, duckdb.IOException))):
                raise
            words = getattr(error, "strerror", None) or without_secrets(error)
            advice = "Check the address, the credentials and the network." if remote else "Check the folder."
            raise InvalidArgument(f"{self.folder}: the registry cannot be used ({words}).", advice) from error


def _in_words(error: Exception) -> str:
    """What a library or the system says of a file."""
    return getattr(error, "strerror", None) or str(error).partition("\n")[0]


def _name(path: str) -> str:
    """The last part of a path or URL."""
    return re.split(r"[/\\]", path)[-1]
