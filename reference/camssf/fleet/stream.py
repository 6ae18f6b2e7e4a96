"""Runs a manifest of any size and writes results to an archive and their rows to a registry, without repeated work.

The folder of a result is named by the hash of its inputs: the contents of all files, the options, camssf's version.
So a duplicate finds its result there, and so does a restart after a run that was killed before it wrote the row.
Workers write only to the archive; the process that submits the jobs writes the rows, every FLUSH seconds.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import local_folder, readable, write_files
from camssf.fleet.inputs import basis_hash
from camssf.fleet.manifest import Item, Manifest, file_in, words_of
from camssf.fleet.pools import DEATHS, FLUSH, Done, here, on_dask
from camssf.fleet.registry import Registry
from camssf.fleet.rows import Origin, Row, Task, place_of, row, utc
from camssf.fleet.run import attempt_job, cores
from camssf.photo.read.sidecar import photo_hash
from camssf.photo.read.unit import Unit, read_unit
from camssf.version import __version__

MANY = 256
"""The registry is written after this many jobs, or after FLUSH seconds."""
SAID = ("make", "model", "camera_id", "serial", "lens", "focal_length", "aperture", "captured", "place", "extra")
"""Fields of a row that come from the manifest and the photo's file, not from the result; without the name."""
STATUSES = ("accepted", "doubtful", "refused", "failed")


@dataclass
class Summary:
    """Numbers of jobs of a manifest.

    Attributes:
        by_status: by status.
        by_code: by the code of the first reason, if there is one.
        by_model: by make and model ("" if unknown), and status.
        resumed: done in an earlier run.
        duplicates: made from the same files as another name.
        seconds: duration of the run.
    """

    by_status: Counter[str] = field(default_factory=Counter)
    by_code: Counter[str] = field(default_factory=Counter)
    by_model: dict[str, Counter[str]] = field(default_factory=dict)
    resumed: int = 0
    duplicates: int = 0
    seconds: float = 0.0

    @property
    def total(self) -> int:
        """Number of all jobs."""
        return self.by_status.total()

    def count(self, status: str, code: str, model: str) -> None:
        """Count one job."""
        self.by_status[status] += 1
        if code:
            self.by_code[code] += 1
        self.by_model.setdefault(model, Counter())[status] += 1

    @property
    def failed(self) -> int:
        """Number of jobs without curves."""
        return self.by_status["refused"] + self.by_status["failed"]


@dataclass(frozen=True)
class _ArchiveLayout:
    """Where results go: the archive, the registry that stores their paths, and whether pages are written too."""

    archive: Path
    registry: Path
    pages: bool

    def folder(self, made_from: str) -> Path:
        return self.archive / made_from[:2] / made_from

    def done(self, made_from: str) -> bool:
        """Whether the result exists, with its pages if they are wanted; nothing is read."""
        names = ("result.json", "report.html") if self.pages else ("result.json",)
        return all((self.folder(made_from) / name).is_file() for name in names)


Work = Callable[[Item, Path, bool], Done]
Tell = Callable[[str, float], None]


def run_stream(
    manifest: Manifest,
    archive: Path | str,
    registry: Registry,
    *,
    workers: int | None = None,
    dask: str | None = None,
    pages: bool = False,
    work: Work | None = None,
    progress: Tell | None = None,
) -> Summary:
    """Do the jobs of a manifest that are not done yet.

    A job is done if this archive has its result, even a refused one, and its rows, files (by size and time), options
    and version are unchanged. A job during which DEATHS processes died also counts as done.

    Args:
        manifest: the jobs.
        archive: folder of the results; created if missing.
        registry: receives their rows.
        workers: number of local processes; all cores unless given.
        dask: address of a Dask scheduler whose workers do the jobs instead. They need this version of camssf and the
            same paths for photos and archive.
        pages: also write report.html, ssf.png and ssf.csv next to each result.json.
        work: function that does one job, importable by a new process; `calibrate_item` unless given.
        progress: called with a message and a fraction.

    Raises:
        InvalidArgument: the manifest cannot be read, archive or registry cannot be written to, or the cluster does
            not answer or cannot do the jobs.
    """
    archive = local_folder(archive)
    begun, summary = time.monotonic(), Summary()
    desk = _ResultWriter(registry, summary)
    layout = _ArchiveLayout(archive.absolute(), registry.folder.absolute(), pages)
    todo = _left(manifest, registry, summary, layout)
    one = partial(_one, layout=layout, work=work or calibrate_item)
    tell = _teller(manifest, summary, progress, begun)
    try:
        if dask is None:
            here(todo, one, max(1, workers or cores()), desk, tell)
        else:
            on_dask(todo, one, (dask, archive.absolute()), desk, tell)
    finally:
        desk.flush()
    registry.gather()
    summary.seconds = time.monotonic() - begun
    return summary


def calibrate_item(item: Item, folder: Path, pages: bool) -> Done:
    """Calibrate one job into `folder`; for a refused capture the document has what is known about it."""
    from camssf.documents.result_json import document_bytes
    from camssf.report.build import report
    from camssf.report.provenance import read_provenance

    result = attempt_job(item.job)
    document = result.document()
    if pages:
        report(document, result.previews, provenance=read_provenance(item.job.photos)).save(folder)
    else:
        write_files(folder, {"result.json": document_bytes(document)})
    return Done(document["verdict"]["status"])


# In a worker


def _one(item: Item, *, layout: _ArchiveLayout, work: Work) -> Done:
    if item.job.fault:
        return Done("refused", InvalidArgument.code, f"In the manifest, {item.job.fault}")
    made_from = ""
    try:
        made_from = _made_from(item)
        kept = _kept(item, layout, made_from) if layout.done(made_from) else None
        if kept is not None:
            return Done(kept.status, kept.code, kept.reason, made_from, kept, found=True)
        try:
            done = work(item, layout.folder(made_from), layout.pages)
        except CalibrationError as error:
            return Done("refused", error.code, f"{error.message} {error.advice}", made_from)
        kept = _kept(item, layout, made_from)
        return (
            replace(done, made_from=made_from)
            if kept is None
            else Done(kept.status, kept.code, kept.reason, made_from, kept)
        )
    except Exception as error:
        words = " ".join(f"{type(error).__name__}: {error}".split())
        return Done("failed", "", f"{words} (this is camssf's fault, please report it)", made_from)


def _made_from(item: Item) -> str:
    """SHA-256 of all that determines a result: file contents, options and version, but not the photos' names."""
    job, contents = item.job, []
    for words in words_of(job):
        layout, path = file_in(words)
        contents.append(words if path is None else f"{layout}:{photo_hash(path)}")
    basis = basis_hash(job.basis)
    options = (
        len(job.photos),
        job.basis if basis is None else f"{Path(job.basis).stem}:{basis}",
        job.engine,
        job.lens_shading,
    )
    return hashlib.sha256(json.dumps([contents, options, __version__]).encode()).hexdigest()


def _kept(item: Item, layout: _ArchiveLayout, made_from: str) -> Row | None:
    """The row of the result in the archive; None if it is missing or damaged."""
    from camssf.documents.result_json import read_document

    file = layout.folder(made_from) / "result.json"
    try:
        document = read_document(file)
        data = file.read_bytes()
    except (OSError, InvalidArgument):
        return None

    serial, camera_id, lens, captured = item.unit
    unit = Unit(serial=serial, camera_id=camera_id, lens=lens)
    with suppress(CalibrationError):
        photographed = read_unit(item.job.photos[0])
        unit, captured = unit.filled(photographed.unit), captured or photographed.time
    place = place_of(file, layout.registry)
    origin = Origin(unit, captured, item.job.name, made_from, place=place, extra=dict(item.extra))
    return row(data, document, origin)


# In the process that hands out the work


def _left(manifest: Manifest, registry: Registry, summary: Summary, layout: _ArchiveLayout) -> Iterator[Item]:
    """Yield the jobs still to do and count those done; keeps hashes as integers, to save memory."""
    parts = [f"p{i}" for i in range(4)]
    made_from = ", ".join(
        f"coalesce(TRY_CAST('0x' || made_from[{16 * i + 1}:{16 * i + 16}] AS UBIGINT), 0) AS {part}"
        for i, part in enumerate(parts)
    )
    done = registry.arrays(
        f"SELECT ('0x' || task[:16])::UBIGINT AS task, list_position({list(STATUSES)}, status) - 1 AS status, code, "
        f"coalesce(TRY_CAST('0x' || key[:16] AS UBIGINT), 0) AS row, key <> '' AS kept, {made_from} "
        f"FROM rows WHERE key <> '' OR deaths >= {DEATHS} ORDER BY 1",
        table=Task,
    )
    known, models = np.asarray(done["task"], dtype=np.uint64), _models(registry)
    for item in manifest:
        mark = np.uint64(int(item.task[:16], 16))
        at = int(np.searchsorted(known, mark))
        there = at < len(known) and known[at] == mark
        if there and done["kept"][at]:
            there = layout.done("".join(f"{int(done[part][at]):016x}" for part in parts))
        if there:
            summary.resumed += 1
            summary.count(STATUSES[int(done["status"][at])], str(done["code"][at]), models(int(done["row"][at])))
        else:
            yield item


def _models(registry: Registry) -> Callable[[int], str]:
    """A function from the first 64 bits of a row's key to its make and model; keeps twelve bytes for each row."""
    name = "trim(make || ' ' || model)"
    names = [each["name"] for each in registry.query(f"SELECT DISTINCT {name} AS name FROM rows ORDER BY 1")]
    found = registry.arrays(
        "SELECT TRY_CAST('0x' || key[:16] AS UBIGINT) AS key, "
        f"(dense_rank() OVER (ORDER BY {name}) - 1)::INTEGER AS model FROM rows "
        "WHERE TRY_CAST('0x' || key[:16] AS UBIGINT) IS NOT NULL ORDER BY 1"
    )
    keys = np.asarray(found["key"], dtype=np.uint64)

    def model(key: int) -> str:
        at = int(np.searchsorted(keys, np.uint64(key)))
        return str(names[int(found["model"][at])]) if at < len(keys) and keys[at] == key else ""

    return model


class _ResultWriter:
    """Buffers rows and writes them to the registry."""

    def __init__(self, registry: Registry, summary: Summary) -> None:
        self._registry, self._summary = registry, summary
        self._rows: dict[str, tuple[Row, bool]] = {}
        self._tasks: list[Task] = []
        self._last, self._begun = time.monotonic(), utc(datetime.now(UTC))

    def take(self, item: Item, done: Done, *, deaths: int = 0) -> None:
        """Add one finished job to the buffer and to the summary."""
        model = "" if done.row is None else f"{done.row.make} {done.row.model}".strip()
        self._summary.count(done.status, done.code, model)
        key = "" if done.row is None else done.row.key
        before = self._rows.get(key)
        if done.row is not None and before is not None:
            self._summary.duplicates += done.row.name != before[0].name
            if _said(done.row) != _said(before[0]):
                self._rows[key] = replace(done.row, added=max(done.row.added, before[0].added)), before[1]
        elif done.row is not None:
            self._rows[key] = done.row, done.found
        ended = utc(datetime.now(UTC))
        name = item.job.name
        self._tasks.append(
            Task(item.task, done.made_from, ended, name, done.status, done.code, done.reason, key, deaths)
        )

    def flush(self, *, if_due: bool = False) -> None:
        """Write the buffer, rows before tasks, so that each task in the registry has its row."""
        due = time.monotonic() - self._last >= FLUSH or len(self._tasks) >= MANY
        if not self._tasks or (if_due and not due):
            return
        self._registry.add(self._fresh())
        self._registry.note(self._tasks)
        self._rows, self._tasks, self._last = {}, [], time.monotonic()

    def _fresh(self) -> list[Row]:
        """The buffered rows that differ from those in the registry."""
        again = [key for key, (_, found) in self._rows.items() if found]
        there: dict[str, dict[str, Any]] = {}
        if again:
            asked = f"SELECT key, added, {', '.join(('name', *SAID))} FROM rows WHERE list_contains(?, key)"
            there = {str(each["key"]): each for each in self._registry.query(asked, [again])}
        rows = []
        for key, (row_, _) in self._rows.items():
            old = there.get(key)
            if old is None:
                rows.append(row_)
                continue
            another = old["name"] != readable(row_.name)
            self._summary.duplicates += another
            twin = another and old["added"] >= self._begun  # duplicate in this run: the row may have either name
            if _said(row_) != tuple(old[name] or None for name in SAID) or (another and not twin):
                rows.append(replace(row_, added=max(row_.added, old["added"] + timedelta(microseconds=1))))
        return rows


def _said(one: Row) -> tuple[Any, ...]:
    """The fields SAID of a row, as the registry stores them."""
    values = (getattr(one, name) for name in SAID)
    return tuple((readable(value) if isinstance(value, str) else value) or None for value in values)


def _teller(manifest: Manifest, summary: Summary, progress: Tell | None, begun: float) -> Callable[[], None]:
    """A function that reports rate and time left, from the fraction of the manifest read so far."""

    def tell() -> None:
        if progress is None:
            return
        elapsed = time.monotonic() - begun
        fresh = summary.total - summary.resumed
        left = elapsed * (1 - manifest.done) / manifest.done if manifest.done else 0.0
        progress(f"{summary.total} done, {fresh / elapsed:.1f}/s, {left / 60:.0f} min left", manifest.done)

    return tell


def summary_json(summary: Summary) -> dict[str, Any]:
    """The summary as plain data."""
    return {"format": "camssf-batch-summary/1", "total": summary.total} | vars(summary)
