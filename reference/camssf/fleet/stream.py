"""Manifest of any size → results in an archive and rows in a registry, as they come; nothing is done twice.

An archive's folder is named by what its result was made from: the contents of all files, the options, camssf's
version. So a duplicate finds its result there, and so does a run that was killed before it wrote the row. Workers
know the archive alone; the rows are written by the one process that handed out the work, every FLUSH seconds.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from camssf import __version__
from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import write_files
from camssf.fleet.manifest import Item, Manifest, file_in, words_of
from camssf.fleet.registry import Registry
from camssf.fleet.rows import Origin, Row, Task, row, utc
from camssf.fleet.run import begin, cores, file_hash, single_threads
from camssf.photo.unit import Unit, read_unit

FLUSH, MANY = 2.0, 256
"""Seconds and rows after which the registry is written."""
AHEAD = 4
"""Jobs a worker that wait for it."""
DEATHS = 2
"""Of processes that worked on a job, after which it is put aside until its files or its rows change."""
STATUSES = ("accepted", "doubtful", "refused", "failed")


@dataclass(frozen=True)
class Done:
    """What a worker tells of a job.

    Attributes:
        status, code, reason, made_from: as in `Task`.
        row: of its result; None without one.
        found: the result was in the archive already.
    """

    status: str
    code: str = ""
    reason: str = ""
    made_from: str = ""
    row: Row | None = None
    found: bool = False


@dataclass
class Summary:
    """What became of a manifest.

    Attributes:
        by_status: jobs by their status; by_code: by their first reason.
        resumed: of these, done in an earlier run.
        duplicates: of these, made from the same files as another.
        seconds: it took.
    """

    by_status: Counter[str] = field(default_factory=Counter)
    by_code: Counter[str] = field(default_factory=Counter)
    resumed: int = 0
    duplicates: int = 0
    seconds: float = 0.0

    @property
    def total(self) -> int:
        """All jobs."""
        return self.by_status.total()

    @property
    def failed(self) -> int:
        """Jobs without curves."""
        return self.by_status["refused"] + self.by_status["failed"]


Work = Callable[[Item, Path, bool], Done]
Tell = Callable[[str, float], None]


def run_stream(
    manifest: Manifest,
    archive: Path | str,
    registry: Registry,
    *,
    workers: int | None = None,
    pages: bool = False,
    work: Work | None = None,
    progress: Tell | None = None,
) -> Summary:
    """Do what a manifest asks for and was not done yet.

    A job is done that has a result, be it a refused one, and whose rows, files (by size and time), options and
    version are the same; so is one that cost DEATHS processes their lives. Any other is tried again.

    Args:
        manifest: the jobs.
        archive: folder of the results; made where it is missing.
        registry: where their rows go.
        workers: processes; all cores unless given.
        pages: leave report.html, ssf.png and ssf.csv beside each result.json.
        work: what to do with one job, importable by a new process; `calibrate_item` unless given.
        progress: called with words and a fraction.

    Raises:
        InvalidArgument: the manifest cannot be read, or archive or registry cannot be written to.
    """
    archive = Path(archive)
    begun, summary = time.monotonic(), Summary()
    desk = _Desk(registry, summary)
    todo = _left(manifest, registry, summary)
    one = partial(_one, archive=archive, pages=pages, work=work or calibrate_item)
    try:
        with single_threads():
            _spread(todo, one, max(1, workers or cores()), desk, _teller(manifest, summary, progress, begun))
    finally:
        desk.flush()
    registry.gather()
    summary.seconds = time.monotonic() - begun
    return summary


def calibrate_item(item: Item, folder: Path, pages: bool) -> Done:
    """Calibrate one job into `folder`; a refused capture leaves what is known of it."""
    from camssf.calibration import attempt
    from camssf.documents.report import document_bytes, report
    from camssf.options import Options

    job = item.job
    options = Options(basis=job.basis, engine=job.engine, lens_shading=job.lens_shading)
    result = attempt(job.photos, job.lamps, white=job.white, dark=job.dark, chart=job.chart, options=options)
    document = result.document()
    if pages:
        report(document, result.previews).save(folder)
    else:
        write_files(folder, {"result.json": document_bytes(document)})
    return Done(document["verdict"]["status"])


# In a worker


def _one(item: Item, *, archive: Path, pages: bool, work: Work) -> Done:
    if item.job.fault:
        return Done("refused", InvalidArgument.code, f"In the manifest, {item.job.fault}")
    made_from = ""
    try:
        made_from = _made_from(item)
        folder = archive / made_from[:2] / made_from
        kept = _kept(item, folder, made_from)
        if kept is not None:
            return Done(kept.status, kept.code, kept.reason, made_from, kept, found=True)
        try:
            done = work(item, folder, pages)
        except CalibrationError as error:
            return Done("refused", error.code, f"{error.message} {error.advice}", made_from)
        kept = _kept(item, folder, made_from)
        return (
            replace(done, made_from=made_from)
            if kept is None
            else Done(kept.status, kept.code, kept.reason, made_from, kept)
        )
    except Exception as error:
        words = " ".join(f"{type(error).__name__}: {error}".split())
        return Done("failed", "", f"{words} (this is camssf's fault, please report it)", made_from)


def _made_from(item: Item) -> str:
    """SHA-256 of what a result follows from, whatever it is called and wherever it lies."""
    job, contents = item.job, []
    for words in words_of(job):
        layout, path = file_in(words)
        contents.append(words if path is None else f"{layout}:{file_hash(path)}")
    options = (len(job.photos), job.basis, job.engine, job.lens_shading)
    return hashlib.sha256(json.dumps([contents, options, __version__]).encode()).hexdigest()


def _kept(item: Item, folder: Path, made_from: str) -> Row | None:
    """The row of the result that lies in the archive; None where there is none, or a damaged one."""
    from camssf.documents.report import read_document

    try:
        document = read_document(folder / "result.json")
        data = (folder / "result.json").read_bytes()
    except (OSError, InvalidArgument):
        return None

    serial, camera_id, lens, captured = item.unit
    unit = Unit(serial=serial, camera_id=camera_id, lens=lens)
    with suppress(CalibrationError):
        taken = read_unit(item.job.photos[0])
        unit, captured = unit.filled(taken.unit), captured or taken.time
    place = f"{made_from[:2]}/{made_from}/result.json"
    origin = Origin(unit, captured, item.job.name, made_from, place=place, extra=dict(item.extra))
    return row(data, document, origin)


# In the process that hands out the work


def _left(manifest: Manifest, registry: Registry, summary: Summary) -> Iterator[Item]:
    """The jobs that are still to do; what is done is counted. Eight bytes a task are held, not its words."""
    done = registry.arrays(
        f"SELECT ('0x' || task[:16])::UBIGINT AS task, list_position({list(STATUSES)}, status) - 1 AS status, code "
        f"FROM rows WHERE key <> '' OR deaths >= {DEATHS} ORDER BY 1",
        table=Task,
    )
    known = np.asarray(done["task"], dtype=np.uint64)
    for item in manifest:
        mark = np.uint64(int(item.task[:16], 16))
        at = int(np.searchsorted(known, mark))
        if at < len(known) and known[at] == mark:
            summary.resumed += 1
            summary.by_status[STATUSES[int(done["status"][at])]] += 1
            summary.by_code[str(done["code"][at])] += 1
        else:
            yield item


def _spread(
    todo: Iterator[Item], one: Callable[[Item], Done], count: int, desk: _Desk, tell: Callable[[], None]
) -> None:
    """Over processes. Where one dies, what may have killed it goes alone, so that only the culprit pays."""
    while suspects := _pool(todo, one, count, desk, tell):
        for item in suspects:
            if _pool(iter([item]), one, 1, desk, tell):
                words = "The process that worked on it died, twice (memory, or a damaged file). It is put aside."
                desk.take(item, Done("failed", "", words), deaths=DEATHS)


def _pool(
    todo: Iterator[Item], one: Callable[[Item], Done], count: int, desk: _Desk, tell: Callable[[], None]
) -> list[Item]:
    """Work until there is no more, or a process died: then what was under way. No process is begun for nothing."""
    item = next(todo, None)
    if item is None:
        return []
    running: dict[Future[Done], Item] = {}
    with ProcessPoolExecutor(count, get_context("spawn"), begin) as pool:
        try:
            while item is not None or running:
                while item is not None and len(running) < AHEAD * count:
                    running[pool.submit(one, item)] = item
                    item = next(todo, None)
                finished, _ = wait(running, timeout=FLUSH, return_when=FIRST_COMPLETED)
                for future in finished:
                    desk.take(running[future], future.result())
                    del running[future]
                desk.flush(if_due=True)
                tell()
        except BrokenProcessPool:
            return [*running.values(), *([] if item is None else [item])]
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return []


class _Desk:
    """Where what was done is gathered and written down."""

    def __init__(self, registry: Registry, summary: Summary) -> None:
        self._registry, self._summary = registry, summary
        self._rows: dict[str, tuple[Row, bool]] = {}
        self._tasks: list[Task] = []
        self._last = time.monotonic()

    def take(self, item: Item, done: Done, *, deaths: int = 0) -> None:
        """One job's end."""
        self._summary.by_status[done.status] += 1
        self._summary.by_code[done.code] += 1
        key = "" if done.row is None else done.row.key
        if done.row is not None and key in self._rows:
            self._summary.duplicates += 1
        elif done.row is not None:
            self._rows[key] = (done.row, done.found)
        ended = utc(datetime.now(UTC))
        name = item.job.name
        self._tasks.append(
            Task(item.task, done.made_from, ended, name, done.status, done.code, done.reason, key, deaths)
        )

    def flush(self, *, if_due: bool = False) -> None:
        """Rows first, then tasks: a task that is known has its row. What an earlier run wrote stays as it is."""
        due = time.monotonic() - self._last >= FLUSH or len(self._tasks) >= MANY
        if not self._tasks or (if_due and not due):
            return
        again = [key for key, (_, found) in self._rows.items() if found]
        there: set[str] = set()
        if again:
            asked = self._registry.query("SELECT key FROM rows WHERE list_contains(?, key)", [again])
            there = {str(each["key"]) for each in asked}
            self._summary.duplicates += len(there)
        self._registry.add([each for key, (each, _) in self._rows.items() if key not in there])
        self._registry.note(self._tasks)
        self._rows, self._tasks, self._last = {}, [], time.monotonic()


def _teller(manifest: Manifest, summary: Summary, progress: Tell | None, begun: float) -> Callable[[], None]:
    """Rate and time left, by the part of the manifest that was read."""

    def tell() -> None:
        if progress is None:
            return
        taken = time.monotonic() - begun
        fresh = summary.total - summary.resumed
        left = taken * (1 - manifest.done) / manifest.done if manifest.done else 0.0
        progress(f"{summary.total} done, {fresh / taken:.1f}/s, {left / 60:.0f} min left", manifest.done)

    return tell


def summary_json(summary: Summary) -> dict[str, Any]:
    """As plain data."""
    return {"format": "camssf-batch-summary/1", "total": summary.total} | vars(summary)
