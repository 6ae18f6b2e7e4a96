"""Keeps the results of a batch in an archive and their rows in a registry, without repeated work.

The folder of a result is named by the hash of its inputs: the contents of all files, the options, camssf's version.
So a duplicate finds its result there, and so does a restart after a run that was killed before it wrote the row.
Workers write only to the archive; the process that submits the jobs writes the rows, every FLUSH seconds.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import readable
from camssf.fleet.inputs import Stamp, file_in, stamp, stamps
from camssf.fleet.manifest import Job, Manifest
from camssf.fleet.outcome import Outcome, Progress, Summary
from camssf.fleet.pools import DEATHS, FLUSH
from camssf.fleet.registry import Registry
from camssf.fleet.rows import Origin, Row, Task, row, utc
from camssf.fleet.upkeep import MANY_FILES, optimize
from camssf.photo.read.unit import read_unit
from camssf.places import Place, is_remote, reached, relative, write_place
from camssf.version import __version__

LARGEST_BUFFER = 256
"""The registry is written after this many jobs, or after FLUSH seconds."""
GIVEN = ("make", "model", "camera_id", "serial", "lens", "focal_length", "aperture", "captured", "place", "extra")
"""Fields of a row that come from the manifest and the photo's file, not from the result; without the name."""
RESULT = "result.json"
STATUSES = ("accepted", "doubtful", "refused", "failed")


@dataclass(frozen=True)
class Archive:
    """A folder of results, each in a folder named by the hash of its inputs.

    Attributes:
        folder: of the archive.
        registry: folder of the registry that stores the results' paths.
        pages: whether a result without its pages counts as missing.
    """

    folder: Place
    registry: Place
    pages: bool

    def place(self, made_from: str) -> Place:
        """The folder of a result."""
        return self.folder / made_from[:2] / made_from

    def holds(self, made_from: str) -> bool:
        """Whether the result exists, with its pages if they are wanted; nothing is read."""
        names = (RESULT, "report.html") if self.pages else (RESULT,)
        with reached(self.folder, "read"):
            return all((self.place(made_from) / name).is_file() for name in names)

    def earlier(self, job: Job, made_from: str) -> Outcome | None:
        """The outcome of a result in the archive; None if it is missing or damaged."""
        kept = self._row(job, made_from) if self.holds(made_from) else None
        return None if kept is None else replace(_outcome(kept), resumed=True)

    @contextmanager
    def working_folder(self, job: Job, made_from: str) -> Iterator[Path]:
        """The folder for a new result; for an object store a temporary one, whose files are then copied there.

        The result is copied last, so that whatever has a result is whole.
        """
        place = self.place(made_from)
        if not is_remote(place):
            yield place
            return
        with tempfile.TemporaryDirectory(prefix="camssf-") as name:
            yield Path(name)
            for path in sorted(Path(name).iterdir(), key=lambda path: path.name == RESULT):
                write_place(place / path.name, path.read_bytes())

    def keep(self, job: Job, made_from: str, outcome: Outcome) -> Outcome:
        """The outcome with the row of the result, if there is one."""
        kept = self._row(job, made_from)
        return outcome if kept is None else _outcome(kept)

    def _row(self, job: Job, made_from: str) -> Row | None:
        from camssf.documents.result_json import check_document, parse_json

        file = self.place(made_from) / RESULT
        try:
            with reached(file, "read"):
                data = file.read_bytes()
            document = check_document(parse_json(data, str(file), ""), str(file))
        except (OSError, InvalidArgument):
            return None
        unit, captured = job.unit, job.captured
        with suppress(CalibrationError):
            photographed = read_unit(job.photos[0])
            unit, captured = unit.filled(photographed.unit), captured or photographed.time
        place = relative(file, self.registry)
        return row(data, document, Origin(unit, captured, job.name, made_from, place=place, extra=dict(job.extra)))


def _outcome(kept: Row) -> Outcome:
    return Outcome(kept.name, kept.status, kept.code, kept.reason, row=kept)


# In the process that hands out the work


def task_of(job: Job, basis: Stamp | None) -> str:
    """SHA-256 of a job, the version, and the sizes and times of all its files; no file is read."""
    found: list[Stamp | None] = [basis]
    for specification in job.specifications:
        _, path = file_in(specification)
        found += [None] if path is None else stamps(path)
    return hashlib.sha256(json.dumps([repr(job), found, __version__]).encode()).hexdigest()


def unfinished(manifest: Manifest, registry: Registry, summary: Summary, archive: Archive) -> Iterator[Job]:
    """Yield the jobs still to do, each with its `task`, and count those done.

    Hashes are kept as integers, to save memory.
    """
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
    tasks, models = np.asarray(done["task"], dtype=np.uint64), _models(registry)
    basis = None if manifest.basis_file is None else stamp(manifest.basis_file)  # once, not once a row
    for each in manifest:
        job = replace(each, task=task_of(each, basis))
        first_bits = np.uint64(int(job.task[:16], 16))
        at = int(np.searchsorted(tasks, first_bits))
        there = at < len(tasks) and tasks[at] == first_bits
        if there and done["kept"][at]:
            there = archive.holds("".join(f"{int(done[part][at]):016x}" for part in parts))
        if there:
            summary.resumed += 1
            summary.count(STATUSES[int(done["status"][at])], str(done["code"][at]), models(int(done["row"][at])))
        else:
            yield job


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


class RegistryRecorder:
    """Buffers rows and writes them to the registry."""

    def __init__(self, manifest: Manifest, registry: Registry, summary: Summary, progress: Progress | None) -> None:
        self._manifest, self._registry, self._summary, self._progress = manifest, registry, summary, progress
        self._rows: dict[str, tuple[Row, bool]] = {}
        self._tasks: list[Task] = []
        self._started = self._last = time.monotonic()
        self._begun = utc(datetime.now(UTC))

    def add(self, job: Job, outcome: Outcome) -> None:
        """Add one finished job to the buffer and to the summary."""
        self._summary.add(outcome)
        new, key = outcome.row, "" if outcome.row is None else outcome.row.key
        before = self._rows.get(key)
        if new is not None and before is not None:
            self._summary.duplicates += new.name != before[0].name
            if _given(new) != _given(before[0]):
                self._rows[key] = new, before[1]
        elif new is not None:
            self._rows[key] = new, outcome.resumed
        reason = f"{outcome.reason} It is put aside." if outcome.deaths else outcome.reason
        end = (utc(datetime.now(UTC)), job.name, outcome.status, outcome.code, reason, key, outcome.deaths)
        self._tasks.append(Task(job.task, outcome.made_from, *end))

    def update(self) -> None:
        """Write the buffer if it is due; report rate and time left, from the fraction of the manifest read so far."""
        if time.monotonic() - self._last >= FLUSH or len(self._tasks) >= LARGEST_BUFFER:
            self.flush()
        if self._progress is not None:
            elapsed, done = time.monotonic() - self._started, self._manifest.done
            rate = (self._summary.total - self._summary.resumed) / elapsed
            left = elapsed * (1 - done) / done if done else 0.0
            self._progress(f"{self._summary.total} done, {rate:.1f}/s, {left / 60:.0f} min left", done)

    def flush(self) -> None:
        """Write the buffer, rows before tasks, so that each task in the registry has its row."""
        if self._tasks:
            self._registry.add(self._changed())
            self._registry.note(self._tasks)
            optimize(self._registry, least=MANY_FILES)
            self._rows, self._tasks, self._last = {}, [], time.monotonic()

    def finish(self) -> None:
        """Merge the registry's small files."""
        optimize(self._registry)

    def _changed(self) -> list[Row]:
        """The buffered rows that differ from those in the registry."""
        again = [key for key, (_, found) in self._rows.items() if found]
        stored: dict[str, dict[str, Any]] = {}
        if again:
            sql = f"SELECT key, added, {', '.join(('name', *GIVEN))} FROM rows WHERE list_contains(?, key)"
            stored = {str(each["key"]): each for each in self._registry.query(sql, [again])}
        rows = []
        for key, (new, _) in self._rows.items():
            old = stored.get(key)
            if old is None:
                rows.append(new)
                continue
            another = old["name"] != readable(new.name)
            self._summary.duplicates += another
            twin = another and old["added"] >= self._begun  # duplicate in this run: the row may have either name
            if _given(new) != tuple(old[name] or None for name in GIVEN) or (another and not twin):
                rows.append(new)
        return rows


def _given(each: Row) -> tuple[Any, ...]:
    """The fields GIVEN of a row, as the registry stores them."""
    values = (getattr(each, name) for name in GIVEN)
    return tuple((readable(value) if isinstance(value, str) else value) or None for value in values)
