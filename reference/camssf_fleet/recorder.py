"""Counts the outcomes of a batch, and writes them as rows into the registry, if there is one."""

from __future__ import annotations

import csv
import io
import re
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

from camssf.errors import InvalidArgument
from camssf.files import readable
from camssf.progress import Progress
from camssf_fleet.manifest import Job, Manifest, rows_hash
from camssf_fleet.outcome import Outcome, Summary
from camssf_fleet.pools import FLUSH
from camssf_fleet.registry import Registry
from camssf_fleet.rows import Task, utc
from camssf_fleet.upkeep import MANY_FILES, optimize

CORRECT_MANIFEST = "Correct the manifest, or replace what the registry has by --correct."
LARGEST_BUFFER = 256
"""The registry is written after this many jobs, or after FLUSH seconds."""
_FORMULA = re.compile(r"(?:^|(?<=[;\t]))(?=[=+\-@\t\r\n\uff1d\uff0b\uff0d\uff20])")
"""Positions where a spreadsheet may take text for a formula, at the possible start of a cell; a `'` prevents it."""


class OutcomeRecorder:
    """Counts the outcomes, and writes their rows if there is a registry.

    An outcome whose row contradicts the registry is refused.
    """

    def __init__(
        self, manifest: Manifest, registry: Registry | None, summary: Summary, progress: Progress | None
    ) -> None:
        self._manifest, self._registry, self._summary, self._progress = manifest, registry, summary, progress
        self.outcomes: list[tuple[Job, Outcome]] = []
        """Those that are not written yet."""
        self._started = self._last = time.monotonic()

    def add(self, job: Job, outcome: Outcome) -> None:
        """Add one finished job; without a registry it is counted at once."""
        if self._registry is None:
            self._summary.add(outcome)
        self.outcomes.append((job, outcome))

    def update(self) -> None:
        """Write the outcomes if it is time; report rate and time left, from the part of the manifest that is done."""
        if time.monotonic() - self._last >= FLUSH or len(self.outcomes) >= LARGEST_BUFFER:
            self.flush()
        if self._progress is not None:
            total, elapsed = self._summary.total, time.monotonic() - self._started
            total += 0 if self._registry is None else len(self.outcomes)
            done = self._manifest.done * total / max(1, self._manifest.jobs)
            left = elapsed * (1 - done) / done if done else 0.0
            rate = (total - self._summary.resumed) / elapsed
            self._progress(f"{total} done, {rate:.1f}/s, {left / 60:.0f} min left", done)

    def flush(self) -> None:
        """Write the outcomes to the registry, rows before tasks, so that each task there has its row."""
        if self._registry is None or not self.outcomes:
            return
        written = [number for number, (_, outcome) in enumerate(self.outcomes) if outcome.row is not None]
        rows = [row for _, outcome in self.outcomes if (row := outcome.row) is not None]
        sql = "SELECT key, name FROM rows WHERE list_contains(?, key)"
        names = {each["key"]: each["name"] for each in self._registry.query(sql, [[each.key for each in rows]])}
        for each in rows:
            name = readable(each.name)
            self._summary.duplicates += names.setdefault(each.key, name) != name
        for number, said in zip(written, self._registry.add(rows, partly=True), strict=True):
            self._summary.added += said.new
            if said.contradiction:
                job, outcome = self.outcomes[number]
                words = f"{said.contradiction} {CORRECT_MANIFEST}"
                refused = replace(outcome, status="refused", code=InvalidArgument.code, reason=words, row=None)
                self.outcomes[number] = job, refused
        for _, outcome in self.outcomes:
            self._summary.add(outcome)
        self._registry.note([_task(job, outcome) for job, outcome in self.outcomes])
        optimize(self._registry, least=MANY_FILES)
        self.outcomes, self._last = [], time.monotonic()


def _task(job: Job, outcome: Outcome) -> Task:
    row, reason = outcome.row, f"{outcome.reason} It is put aside." if outcome.deaths else outcome.reason
    return Task(
        job.task,
        outcome.made_from,
        utc(datetime.now(UTC)),
        job.name,
        outcome.status,
        outcome.code,
        reason,
        key="" if row is None else row.key,
        camera=outcome.camera,
        deaths=outcome.deaths,
        job=rows_hash(job),
    )


def summary_csv(outcomes: Sequence[Outcome]) -> str:
    """One row for each outcome."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("name", "folder", "status", "code", "reason", "resumed"))
    for outcome in outcomes:
        values = (
            outcome.name,
            outcome.folder,
            outcome.status,
            outcome.code,
            outcome.reason,
            "yes" if outcome.resumed else "no",
        )
        writer.writerow([cell(value) for value in values])
    return text.getvalue()


def cell(text: str) -> str:
    """Text that no spreadsheet takes for a formula, without carriage returns, which `csv` does not quote."""
    return _FORMULA.sub("'", text).replace("\r", " ")
