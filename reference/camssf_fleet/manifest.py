"""Reads a manifest, CSV or Parquet, into jobs: one for each name, whose rows are its shots."""

from __future__ import annotations

import csv
import hashlib
import io
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import chain, groupby
from pathlib import Path

from camssf.errors import InvalidArgument
from camssf.files import error_in_words, read_advice
from camssf.libraries import library
from camssf.photo.read.unit import Unit
from camssf.places import Place, absolute, is_remote, join, local_copy, place
from camssf.spectra.text import path_text
from camssf_fleet.inputs import basis_path, check_manifest, file_in, is_file, urls_among

COLUMNS = ("name", "photo", "lamp", "white", "dark", "chart")
"""Columns of the manifest; `name`, `photo` and `lamp` are required, but only `name` and `photo` need values."""
TABLES = ("lamp", "chart")
"""Columns that may name a table instead of a photo."""
UNIT_COLUMNS = ("serial", "camera_id", "lens", "captured")
"""Further columns with a meaning of their own; all others are kept as `extra`."""
LARGEST_MANIFEST = 10_000_000
"""Bytes that are read at once; a larger manifest can only be streamed."""
LONGEST_ROW = 1_000_000
"""Characters."""
FETCHED_ROWS = 4096
"""Rows of a Parquet file that are in memory at once."""
AUTO = "auto"
"""The lamp for an empty cell: unnamed light, as in `calibrate`."""
_MEANINGS = {*COLUMNS, *UNIT_COLUMNS, "fault"}
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?|summary\.csv", re.IGNORECASE)


@dataclass(frozen=True)
class Job:
    """One camera of the manifest.

    Attributes:
        name: as in the manifest.
        photos, lamps, white, dark: one for each shot, in the manifest's order; white and dark may be None.
        chart: for all shots.
        basis, lens_shading: as in `camssf.calibrate`.
        fault: why this job cannot run, "" if it can.
        folder: safe name of a folder, unique in the manifest; "" if the manifest is streamed.
        task: identifies the job in a registry (`archive.task_of`); "" without one.
        earlier: `made_from` of the newest result with curves of the same rows in a registry; "" without one.
        unit: serial, camera_id and lens in the manifest.
        captured: ISO 8601, "" if missing.
        extra: columns unknown to camssf, from the name's first row.
    """

    name: str
    photos: tuple[str, ...]
    lamps: tuple[str, ...]
    white: tuple[str | None, ...]
    dark: tuple[str | None, ...]
    chart: str
    basis: str = "auto"
    lens_shading: str = "as-stored"
    fault: str = ""
    folder: str = ""
    task: str = ""
    earlier: str = field(default="", repr=False)
    unit: Unit = field(default_factory=Unit)
    captured: str = ""
    extra: tuple[tuple[str, str], ...] = ()

    @property
    def specifications(self) -> list[tuple[str, str | None]]:
        """All file names and specifications, each after its column; None where there is none."""
        columns = zip(COLUMNS[1:], (self.photos, self.lamps, self.white, self.dark, (self.chart,)), strict=True)
        return [(column, cell) for column, cells in columns for cell in cells]


def rows_hash(job: Job) -> str:
    """SHA-256 of a job's rows and options, without its files."""
    return hashlib.sha256(repr(replace(job, task="")).encode()).hexdigest()


class Manifest:
    """A manifest; iterating over it reads it job by job, and only hashes of the names stay in memory.

    The first line is COLUMNS, paths are relative to the manifest. A bad row gives a job with a fault.

    Args:
        path: CSV, or Parquet by its suffix.
        basis, lens_shading: of every job, as in `camssf.calibrate`.

    Raises:
        InvalidArgument: the path or the basis is a URL; while reading: the file cannot be read, lacks a column or has
            no rows.
    """

    def __init__(self, path: Path | str, *, basis: str = "auto", lens_shading: str = "as-stored") -> None:
        self.path = place(path)
        self.home = self.path.parent
        """Folder that the files' names in the manifest are relative to."""
        self.basis_file = basis_path(basis)
        self.done = 0.0
        """Fraction of the manifest read so far, 0 to 1."""
        self.jobs = 0
        """Number of jobs in what was read so far."""
        self._options = {"basis": basis, "lens_shading": lens_shading}

    def absolute(self) -> Manifest:
        """The same manifest, whose jobs have absolute paths, for processes with another working folder."""
        options = self._options | ({} if self.basis_file is None else {"basis": str(self.basis_file.absolute())})
        manifest = Manifest(self.path, **options)
        manifest.home = absolute(self.home)
        return manifest

    def __iter__(self) -> Iterator[Job]:
        """The jobs as they are read: of any number, with any further columns; the rows of a name stand together."""
        names: set[int] = set()
        self.jobs = 0
        for name, rows in groupby(self._rows(), key=lambda row: row["name"]):
            job = self._job(name, list(rows))
            digest = int.from_bytes(hashlib.sha256(name.encode("utf-8", "surrogatepass")).digest()[:8], "big")
            if digest in names and not job.fault:
                job = replace(job, fault="the rows of this name do not stand together.")
            names.add(digest)
            self.jobs += 1
            yield job

    def read_all(self) -> tuple[Job, ...]:
        """All jobs, each with a folder of its own; the rows of a name may stand apart.

        Raises:
            InvalidArgument: as for iterating; the file is larger than LARGEST_MANIFEST, or has another column.
        """
        with _readable(self.path):
            if self.path.stat().st_size > LARGEST_MANIFEST:
                raise InvalidArgument(
                    f"{self.path} is larger than {LARGEST_MANIFEST} bytes.",
                    "Name a --registry: then it may have any size.",
                )
        rows_of: dict[str, list[dict[str, str]]] = {}
        for row in self._rows(further=False):
            rows_of.setdefault(row["name"], []).append(row)
        folders, self.jobs = _folders(list(rows_of)), len(rows_of)
        return tuple(replace(self._job(name, rows), folder=folders[name]) for name, rows in rows_of.items())

    def _rows(self, *, further: bool = True) -> Iterator[dict[str, str]]:
        """Rows as text, with lower-case column names; other columns than COLUMNS only with `further`."""
        empty = True
        read = _parquet if self.path.suffix.casefold() == ".parquet" else _csv
        with local_copy(self.path) as path:
            for part, row in read(path, further):
                self.done, empty = part, False
                yield dict.fromkeys(COLUMNS, "") | row
        self.done = 1.0
        if empty:
            raise InvalidArgument(f"{self.path} has no rows.", "Write one row a photo.")

    def _job(self, name: str, rows: Sequence[dict[str, str]]) -> Job:
        home, first = self.home, rows[0]

        def frames(column: str) -> tuple[str | None, ...]:
            return tuple(None if row[column].casefold() in ("", "none") else join(home, row[column]) for row in rows)

        charts = list(dict.fromkeys(row["chart"] or "classic24" for row in rows))
        serial, camera_id, lens, captured = (first.get(column, "") for column in UNIT_COLUMNS)
        return Job(
            name,
            tuple(join(home, row["photo"]) for row in rows),
            tuple(_specification(home, "lamp", row["lamp"] or AUTO) for row in rows),
            frames("white"),
            frames("dark"),
            _specification(home, "chart", charts[0]),
            **self._options,
            fault=" ".join(_faults(home, name, rows, charts)),
            unit=Unit(serial=serial, camera_id=camera_id, lens=lens),
            captured=captured,
            extra=tuple((column, text) for column, text in first.items() if column not in _MEANINGS and text),
        )


# Rows


def _csv(path: Path, further: bool) -> Iterator[tuple[float, dict[str, str]]]:
    """The fraction of the file read so far, and a row."""
    with _readable(path), path.open("rb") as raw:
        check_manifest(path, raw.peek(16))  # a pipe cannot be rewound
        text, read = io.TextIOWrapper(raw, encoding="utf-8-sig", newline=None), 0

        def lines() -> Iterator[str]:
            nonlocal read
            while line := text.readline(LONGEST_ROW):
                if len(line) == LONGEST_ROW and not line.endswith("\n"):
                    raise csv.Error("a line is too long")
                read += len(line) if line.isascii() else len(line.encode())
                yield line

        size, rest = max(1, os.fstat(raw.fileno()).st_size), lines()
        header = next(rest, "")
        semicolons = ";" in header and "," not in header
        reader = csv.reader(chain([header], rest), delimiter=";" if semicolons else ",")
        fields = _columns(path, next(reader, []), further)
        for values in filter(None, reader):
            long = f"line {reader.line_num} has more fields than the header."
            fault = {"fault": long if len(values) > len(fields) else ""}
            yield min(1.0, read / size), dict(zip(fields, map(str.strip, values), strict=False)) | fault


def _parquet(path: Path, further: bool) -> Iterator[tuple[float, dict[str, str]]]:
    """As `_csv`."""
    duckdb = library("duckdb", "A manifest in Parquet needs", "fleet")
    from camssf_fleet.record_queries import connection

    with _readable(path), connection() as con:
        try:
            (total,) = con.execute("SELECT count(*) FROM read_parquet(?)", [str(path)]).fetchone()
            answer = con.execute("SELECT COLUMNS(*)::VARCHAR FROM read_parquet(?)", [str(path)])
            fields = _columns(path, [str(column[0]) for column in answer.description], further)
            fetched = 0
            while rows := answer.fetchmany(FETCHED_ROWS):
                fetched += len(rows)
                for values in rows:
                    texts = ("" if value is None else str(value).strip() for value in values)
                    yield fetched / total, dict(zip(fields, texts, strict=True)) | {"fault": ""}
        except duckdb.Error as error:
            words = str(error).partition("\n")[0]
            raise InvalidArgument(f"{path}: cannot be read ({words}).", "Give a Parquet file.") from error


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except csv.Error as error:
        raise InvalidArgument(f"{path}: is not sound CSV ({error}).", "Save it again as CSV.") from error
    except OSError as error:
        raise InvalidArgument(f"{path} cannot be read ({error_in_words(error)}).", read_advice(error)) from error
    except ValueError as error:
        raise InvalidArgument(f"{path}: cannot be read ({error}).", "Give a CSV file in UTF-8.") from error


def _columns(path: Path, header: Sequence[str], further: bool) -> list[str]:
    """The columns' names in lower case, checked."""
    fields = [field.strip().casefold() for field in header]
    missing = [column for column in COLUMNS[:3] if column not in fields]
    doubled = len(set(fields)) < len(fields)
    if missing or doubled or not (further or set(fields) <= set(COLUMNS)):
        fault = f"has {'a doubled' if doubled else 'an unknown'} column in {', '.join(fields)}"
        fault = f"lacks the column {missing[0]}" if missing else fault
        more = ", and more if you like." if further else "."
        raise InvalidArgument(f"{path} {fault}.", f"Its first line is {','.join(COLUMNS)}{more}")
    return fields


# The job of a name's rows


def _faults(home: Place, name: str, rows: Sequence[dict[str, str]], charts: Sequence[str]) -> Iterator[str]:
    """Why the rows cannot be calibrated; paths are relative to `home`."""
    yield from (row["fault"] for row in rows if row["fault"])
    if not name:
        yield "a row has no name."
    if not all(row["photo"] for row in rows):
        yield "a row has no photo."
    yield from urls_among(row[column] for row in rows for column in COLUMNS[1:])
    if any(is_remote(row[column].partition(":")[2]) or is_remote(row[column]) for row in rows for column in TABLES):
        yield "a lamp or a chart is a URL; their files must be local."
    yield from _backslashes(home, rows)
    if len(charts) > 1:
        yield f"its shots name different charts: {', '.join(charts)}."
    captured = rows[0].get("captured", "")
    try:
        if captured:
            datetime.fromisoformat(captured)
    except ValueError:
        yield f"{captured!r} is no time in ISO 8601."


def _specification(home: Place, column: str, text: str) -> str:
    """A lamp or chart; the path of a file, also in `layout:file`, is relative to the manifest."""
    layout, path = ("", None) if is_remote(home) or is_remote(text) else file_in(column, text, home)
    return text if path is None else f"{layout}:{path_text(path)}" if layout else path_text(path)


def _backslashes(home: Place, rows: Sequence[dict[str, str]]) -> Iterator[str]:
    """The fault of a manifest with Windows paths that is read on another system."""
    for row in rows if os.sep == "/" and not is_remote(home) else ():
        for column in COLUMNS[1:]:
            path = row[column].partition(":")[2] if column == "chart" and ":" in row[column] else row[column]
            if "\\" in path and not is_file(home / path):
                yield f"{path} is written with backslashes, which are no folders here: write / instead."
                return


def _folders(names: Sequence[str]) -> dict[str, str]:
    """A safe folder name for each name: readable, and unique on any file system."""
    folded = [name.casefold() for name in names]
    folders = {}
    for name in names:
        safe = re.sub(r"[^\w .()+-]+", "_", name)[:80].strip(" .")
        tag = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
        plain = safe == name and safe and not _RESERVED.fullmatch(safe) and folded.count(name.casefold()) == 1
        lead = "_" if _RESERVED.fullmatch(safe) else "" if safe else "unnamed"
        folders[name] = safe if plain else f"{lead}{safe}-{tag}"
    return folders
