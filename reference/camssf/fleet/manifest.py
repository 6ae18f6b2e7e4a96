"""Reads a manifest of any size job by job; only hashes of the names stay in memory."""

from __future__ import annotations

import csv
import hashlib
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import chain, groupby
from pathlib import Path
from typing import Any

from camssf.errors import InvalidArgument
from camssf.files import local
from camssf.fleet.inputs import Stamp, basis_path, check_manifest, is_file, stamp, stamps
from camssf.fleet.run import COLUMNS, Job, delimiter_of, is_parquet, job_of
from camssf.version import __version__

UNIT_COLUMNS = ("serial", "camera_id", "lens", "captured")
"""Further columns with a meaning of their own; all others are kept as `extra`."""
BATCH = 4096
LONGEST_ROW = 1_000_000
"""Characters."""


@dataclass(frozen=True)
class Item:
    """One job of the manifest.

    Attributes:
        job: what to do; its folder is not used here.
        extra: columns unknown to camssf, from the name's first row.
        unit: serial, camera_id, lens, captured from the manifest; "" if missing.
        task: SHA-256 of name, rows, options, version, and the sizes and times of all files (sidecars and the basis
            file included); computed without reading the files.
    """

    job: Job
    extra: tuple[tuple[str, str], ...]
    unit: tuple[str, str, str, str]
    task: str


class Manifest:
    """A manifest that is read as it is iterated.

    Args:
        path: CSV as for `run.read_manifest`, but of any size and with any further columns; or Parquet.
        options: basis, engine and lens_shading of every job.

    Raises:
        InvalidArgument: the file cannot be read, lacks a column or has no rows.
    """

    def __init__(self, path: Path | str, options: Mapping[str, str]) -> None:
        self.path, self.options = local(path), dict(options)
        self.done = 0.0
        """Fraction of the manifest read so far, 0 to 1."""
        self._basis: Stamp | None = None

    def __iter__(self) -> Iterator[Item]:
        met: set[int] = set()
        empty = True
        basis = basis_path(self.options["basis"])
        self._basis = None if basis is None else stamp(basis)  # once, not once a row
        for name, group in groupby(self._rows(), key=lambda row: row["name"]):
            empty = False
            item = self._item(name, list(group))
            mark = int.from_bytes(hashlib.sha256(name.encode("utf-8", "surrogatepass")).digest()[:8], "big")
            if mark in met and not item.job.fault:
                fault = "the rows of this name do not stand together."
                item = replace(item, job=replace(item.job, fault=fault))
            met.add(mark)
            yield item
        if empty:
            raise InvalidArgument(f"{self.path} has no rows.", "Write one row a photo.")

    def _item(self, name: str, rows: Sequence[dict[str, str]]) -> Item:
        job = replace(
            job_of(self.path.parent, name, "", rows, self.options["basis"], self.options["engine"]),
            lens_shading=self.options["lens_shading"],
        )
        first = rows[0]
        unit = tuple(first.get(column, "") for column in UNIT_COLUMNS)
        try:
            if unit[3]:
                datetime.fromisoformat(unit[3])
        except ValueError:
            job = replace(job, fault=job.fault or f"{unit[3]!r} is no time in ISO 8601.")
        known = {*COLUMNS, *UNIT_COLUMNS, "fault"}
        extra = tuple((column, text) for column, text in first.items() if column not in known and text)
        return Item(job, extra, (unit[0], unit[1], unit[2], unit[3]), _task(job, extra, unit, self._basis))

    def _rows(self) -> Iterator[dict[str, str]]:
        """Rows as text, with lower-case column names."""
        rows = _parquet(self.path) if is_parquet(self.path) else self._csv()
        for part, row in rows:
            self.done = part
            yield row
        self.done = 1.0

    def _csv(self) -> Iterator[tuple[float, dict[str, str]]]:
        with _readable(self.path), self.path.open("rb") as raw:
            check_manifest(self.path, raw.read(16))
            size = max(1, raw.seek(0, 2))
            raw.seek(0)
            lines = _Lines(raw)
            header = next(lines, "")
            reader = csv.reader(chain([header], lines), delimiter=delimiter_of(header))
            fields = [field.strip().casefold() for field in next(reader, [])]
            _check_columns(self.path, fields)
            for values in reader:
                if not values:
                    continue
                row = dict.fromkeys(COLUMNS, "") | dict(zip(fields, (v.strip() for v in values), strict=False))
                long = len(values) > len(fields)
                row["fault"] = f"line {reader.line_num} has more fields than the header." if long else ""
                yield min(1.0, lines.read / size), row


class _Lines:
    """Lines of UTF-8 text with any line ending, at most LONGEST_ROW long; `read` counts the bytes approximately."""

    def __init__(self, raw: Any) -> None:
        self._text, self.read = io.TextIOWrapper(raw, encoding="utf-8-sig", newline=None), 0

    def __iter__(self) -> _Lines:
        return self

    def __next__(self) -> str:
        text = self._text.readline(LONGEST_ROW)
        if not text:
            raise StopIteration
        if len(text) == LONGEST_ROW and not text.endswith("\n"):
            raise csv.Error("a line is too long")
        self.read += len(text) if text.isascii() else len(text.encode())
        return text


def _parquet(path: Path) -> Iterator[tuple[float, dict[str, str]]]:
    import duckdb

    from camssf.fleet.registry import connection

    with _readable(path), connection() as con:
        try:
            (total,) = con.execute("SELECT count(*) FROM read_parquet(?)", [str(path)]).fetchone()
            found = con.execute("SELECT COLUMNS(*)::VARCHAR FROM read_parquet(?)", [str(path)])
            fields = [str(each[0]).strip().casefold() for each in found.description]
            _check_columns(path, fields)
            count = 0
            while rows := found.fetchmany(BATCH):
                for values in rows:
                    count += 1
                    texts = ("" if value is None else str(value).strip() for value in values)
                    yield (
                        count / total,
                        dict.fromkeys(COLUMNS, "") | dict(zip(fields, texts, strict=True)) | {"fault": ""},
                    )
        except duckdb.Error as error:
            words = str(error).partition("\n")[0]
            raise InvalidArgument(f"{path}: cannot be read ({words}).", "Give a Parquet file.") from error


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except csv.Error as error:
        raise InvalidArgument(f"{path}: is not sound CSV ({error}).", "Save it again as CSV.") from error
    except (OSError, ValueError) as error:
        raise InvalidArgument(f"{path}: cannot be read ({error}).", "Give a CSV file in UTF-8.") from error


def _check_columns(path: Path, fields: Sequence[str]) -> None:
    missing = [column for column in COLUMNS[:3] if column not in fields]
    if missing or len(set(fields)) < len(fields):
        fault = f"lacks the column {missing[0]}" if missing else f"has a doubled column in {', '.join(fields)}"
        raise InvalidArgument(f"{path} {fault}.", f"Its first line is {','.join(COLUMNS)}, and more if you like.")


def words_of(job: Job) -> list[str | None]:
    """All file names and specifications in a job: photos, lamps, white, dark, chart; None where there is none."""
    return [*job.photos, *job.lamps, *job.white, *job.dark, job.chart]


def file_in(words: str | None) -> tuple[str, Path | None]:
    """The layout and the file of a specification, as in `nano24:mine.csv`; None if it names no file."""
    if not words:
        return "", None
    if is_file(Path(words)):
        return "", Path(words)
    layout, _, tail = words.partition(":")
    return (layout, Path(tail)) if tail and is_file(Path(tail)) else ("", None)


def _task(job: Job, extra: Sequence[tuple[str, str]], unit: Sequence[str], basis: Stamp | None) -> str:
    found: list[Stamp | None] = []
    for words in words_of(job):
        _, path = file_in(words)
        found += [None] if path is None else stamps(path)
    if basis is not None:
        found.append(basis)
    told = json.dumps([list(vars(job).values()), list(extra), list(unit), found, __version__])
    return hashlib.sha256(told.encode()).hexdigest()
