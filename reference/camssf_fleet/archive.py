"""Keeps the results of a batch in an archive, and finds those of earlier runs.

The folder of a result is named by the hash of its inputs: the contents of all files, the options, camssf's version.
So a duplicate finds its result there, and so does a restart after a run that was killed before it wrote the row.
Workers write only to the archive; the process that submits the jobs writes the rows (`recorder`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from camssf.errors import CalibrationError, InvalidArgument, UnreadableRaw
from camssf.files import local, temporary_folder
from camssf.photo.read.unit import read_metadata
from camssf.places import Place, is_remote, reached, relative, remove, write_place
from camssf.version import __version__
from camssf_fleet.inputs import Stamp, file_in, layout_in, stamp, stamps
from camssf_fleet.manifest import Job, Manifest, rows_hash
from camssf_fleet.outcome import KEPT, Outcome, Summary
from camssf_fleet.pools import DEATHS
from camssf_fleet.record_queries import query_of
from camssf_fleet.records import Origin, Row, row
from camssf_fleet.registry import Registry

if TYPE_CHECKING:
    from camssf.documents.document import Document

RESULT_FILE = "result.json"
PARTS = tuple(f"p{i}" for i in range(4))
"""Columns for the four integers of `made_from`."""


def folder_of(made_from: str) -> str:
    """The folder of a result in its archive."""
    return f"{made_from[:2]}/{made_from}"


@dataclass(frozen=True)
class Archive:
    """A folder of results, each in a folder named by the hash of its inputs.

    Attributes:
        folder: of the archive.
        registry: folder of the registry that stores the results' paths.
    """

    folder: Place
    registry: Place

    def place(self, made_from: str) -> Place:
        """The folder of a result."""
        return self.folder / folder_of(made_from)

    def holds(self, made_from: str) -> bool:
        """Whether the result exists; it is not read."""
        if not is_remote(self.folder):
            local(self.place(made_from) / RESULT_FILE)  # finishes a write that was interrupted
        with reached(self.folder, "read"):
            return (self.place(made_from) / RESULT_FILE).is_file()

    def earlier(self, job: Job, made_from: str) -> Outcome | None:
        """The outcome of a result in the archive, with its row; None if it is missing or damaged."""
        return self._outcome(job, made_from) if self.holds(made_from) else None

    @contextmanager
    def working_folder(self, job: Job, made_from: str) -> Iterator[Path]:
        """The folder for a new result; for an object store a temporary one, whose files are then copied there.

        The result is copied last, so that whatever has a result is whole.
        """
        place = self.place(made_from)
        if not is_remote(place):
            yield place
            return
        with temporary_folder() as folder:
            yield folder
            for path in sorted(folder.iterdir(), key=lambda path: path.name == RESULT_FILE):
                write_place(place / path.name, path.read_bytes())

    def keep(self, job: Job, made_from: str, outcome: Outcome) -> Outcome:
        """The outcome with the row of the result, if there is one; of the earlier one if a photo is unreadable."""
        if outcome.code == UnreadableRaw.code and (kept := self.instead(job, outcome)).made_from:
            remove(self.place(made_from))  # the refusal, of which there is no row
            return kept
        if outcome.row is None:
            return self._outcome(job, made_from) or outcome
        return self._placed(outcome.row, made_from)

    def instead(self, job: Job, outcome: Outcome) -> Outcome:
        """A refusal without a result, with the row of the earlier result if there is one."""
        earlier = self.earlier(job, job.earlier) if job.earlier else None
        if earlier is None:
            return outcome
        return replace(outcome, reason=f"{outcome.reason} {KEPT}", row=earlier.row, made_from=job.earlier)

    def _outcome(self, job: Job, made_from: str) -> Outcome | None:
        """The outcome of a result that only its file knows."""
        from camssf.documents import forms
        from camssf.documents.document import Document

        file = self.place(made_from) / RESULT_FILE
        try:
            with reached(file, "read"):
                data = file.read_bytes()
            document = forms.read(data, Document, str(file), "")
        except (OSError, InvalidArgument):
            return None
        return None if document.verdict is None else self._placed(row_of(job, data, document), made_from)

    def _placed(self, row: Row, made_from: str) -> Outcome:
        place = relative(self.place(made_from) / RESULT_FILE, self.registry)
        row = replace(row, made_from=made_from, place=place)
        return Outcome(row.name, row.status, row.code, row.reason, row=row)


def row_of(job: Job, data: bytes, document: Document) -> Row:
    """The row of a job's result, without its place; what the manifest does not say of the unit, the first photo does.

    Args:
        job: the job.
        data: bytes of result.json.
        document: its content.
    """
    unit, captured = job.unit, job.captured
    with suppress(CalibrationError):
        photo_unit, photo_time = read_metadata(job.photos[0])
        unit, captured = unit.filled(photo_unit), captured or photo_time
    return row(data, document, Origin(unit, captured, job.name, extra=dict(job.extra)))


# In the process that hands out the work


def task_of(job: Job, basis: Stamp | None) -> str:
    """SHA-256 of a job, the version, and the sizes and times of all its files; no file is read."""
    stamped: list[Stamp | None] = [basis]
    for role, specification in job.specifications:
        _, path = file_in(role, specification)
        stamped += [None] if path is None else stamps(path)
        layout_file = layout_in(role, specification)
        stamped += [] if layout_file is None else stamps(layout_file)
    return hashlib.sha256(json.dumps([repr(job), stamped, __version__]).encode()).hexdigest()


def unfinished(manifest: Manifest, registry: Registry, summary: Summary, archive: Archive) -> Iterator[Job]:
    """Yield the jobs still to do, each with its `task`, and count those done: with result in the archive, and row.

    Hashes are kept as integers, to save memory.
    """
    made_from = ", ".join(f"{_bits('made_from', 16 * i)} AS {part}" for i, part in enumerate(PARTS))
    done = f"FROM jobs WHERE deaths >= {DEATHS} OR {_bits('key')} IN (SELECT {_bits('key')} FROM rows)"
    camera = "trim(concat_ws(' ', make, model)) AS camera"
    ends, tasks, curves = registry.files.ask(
        lambda con: (
            con.execute(f"SELECT DISTINCT status, code, {camera} {done} ORDER BY ALL").fetchall(),
            con.execute(
                f"SELECT {_bits('task')} AS task, coalesce(key, '') <> '' AS kept, {made_from}, dense_rank() OVER "
                f"(ORDER BY status, code, camera) - 1 AS ended FROM (SELECT *, {camera} {done}) ORDER BY task"
            ).fetchnumpy(),
            con.execute(
                f"SELECT {_bits('job')} AS job, {made_from} FROM jobs WHERE key <> '' AND "
                "status IN ('accepted', 'doubtful') ORDER BY job, added"
            ).fetchnumpy(),
        )
    )
    numbers, kept, *_, ended = tasks.values()
    same = np.asarray(next(iter(curves.values())), dtype=np.uint64)
    basis = None if manifest.basis_file is None else stamp(manifest.basis_file)  # once, not once a row
    for unstamped in manifest:
        job = replace(unstamped, task=task_of(unstamped, basis))
        first_bits = np.uint64(int(job.task[:16], 16))
        at = int(np.searchsorted(numbers, first_bits))
        there = at < len(numbers) and numbers[at] == first_bits
        if there and kept[at]:
            there = archive.holds(_made_from(tasks, at))
        if there:
            summary.resumed += 1
            status, code, camera = ends[int(ended[at])]
            if code and code not in summary.examples:
                for end in registry.files.ask(query_of("SELECT name, reason FROM jobs WHERE task = ?", [job.task])):
                    summary.examples[code] = ": ".join(map(str, end.values()))
            summary.count(status, code or "", camera)
            continue
        wanted = np.uint64(int(rows_hash(unstamped)[:16], 16))
        at = int(np.searchsorted(same, wanted, side="right")) - 1
        yield replace(job, earlier=_made_from(curves, at)) if at >= 0 and same[at] == wanted else job


def _made_from(columns: dict[str, Any], at: int) -> str:
    return "".join(f"{int(columns[part][at]):016x}" for part in PARTS)


def _bits(column: str, start: int = 0) -> str:
    """SQL for 64 bits of a hash, from this hexadecimal digit on; 0 of an empty one."""
    return f"coalesce(TRY_CAST('0x' || {column}[{start + 1}:{start + 16}] AS UBIGINT), 0)"
