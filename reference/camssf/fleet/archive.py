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

import numpy as np

from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import temporary_folder
from camssf.fleet.inputs import Stamp, file_in, layout_in, stamp, stamps
from camssf.fleet.manifest import Job, Manifest
from camssf.fleet.outcome import Outcome, Summary
from camssf.fleet.pools import DEATHS
from camssf.fleet.registry import Registry
from camssf.fleet.rows import Origin, Task, row
from camssf.photo.read.unit import read_unit
from camssf.places import Place, is_remote, reached, relative, write_place
from camssf.version import __version__

RESULT = "result.json"


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
            for path in sorted(folder.iterdir(), key=lambda path: path.name == RESULT):
                write_place(place / path.name, path.read_bytes())

    def keep(self, job: Job, made_from: str, outcome: Outcome) -> Outcome:
        """The outcome with the row of the result, if there is one."""
        return self._outcome(job, made_from) or outcome

    def _outcome(self, job: Job, made_from: str) -> Outcome | None:
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
        kept = row(data, document, Origin(unit, captured, job.name, made_from, place=place, extra=dict(job.extra)))
        return Outcome(kept.name, kept.status, kept.code, kept.reason, row=kept)


# In the process that hands out the work


def task_of(job: Job, basis: Stamp | None) -> str:
    """SHA-256 of a job, the version, and the sizes and times of all its files; no file is read."""
    found: list[Stamp | None] = [basis]
    for specification in job.specifications:
        _, path = file_in(specification)
        found += [None] if path is None else stamps(path)
        own = layout_in(specification)
        found += [] if own is None else stamps(own)
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
    of = f"FROM rows WHERE key <> '' OR deaths >= {DEATHS}"
    ends, done = registry.ask(
        lambda con: (
            con.execute(f"SELECT DISTINCT status, code, camera {of} ORDER BY ALL").fetchall(),
            con.execute(
                f"SELECT ('0x' || task[:16])::UBIGINT AS task, key <> '' AS kept, {made_from}, "
                f"dense_rank() OVER (ORDER BY status, code, camera) - 1 AS ended {of} ORDER BY task"
            ).fetchnumpy(),
        ),
        Task,
    )
    tasks = np.asarray(done["task"], dtype=np.uint64)
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
            summary.count(*ends[int(done["ended"][at])])
        else:
            yield job
