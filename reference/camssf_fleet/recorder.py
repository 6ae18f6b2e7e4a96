"""Counts the outcomes of a batch, and writes them as rows into the registry, if there is one."""

from __future__ import annotations

import csv
import io
import re
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import PurePath

from camssf.errors import InvalidArgument
from camssf.progress import Progress
from camssf_fleet.manifest import Job, Manifest, rows_hash
from camssf_fleet.merge import Added
from camssf_fleet.outcome import Outcome, Summary
from camssf_fleet.pools import FLUSH
from camssf_fleet.record_files import MANY_FILES
from camssf_fleet.records import JobEnd
from camssf_fleet.registry import Registry

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
        """Write the outcomes to the registry: results, and ends of jobs."""
        if self._registry is None or not self.outcomes:
            return
        outcomes, self.outcomes, self._last = self.outcomes, [], time.monotonic()
        rows = {number: outcome.row for number, (_, outcome) in enumerate(outcomes) if outcome.row is not None}

        def ends(added: tuple[Added, ...]) -> list[JobEnd]:
            for number, statement in zip(rows, added, strict=True):
                self._summary.added += statement.new
                self._summary.duplicates += statement.renamed
                if statement.contradiction:
                    job, outcome = outcomes[number]
                    words = f"{statement.contradiction} {CORRECT_MANIFEST}"
                    refused = replace(outcome, status="refused", code=InvalidArgument.code, reason=words, row=None)
                    outcomes[number] = job, refused
            return [_end(job, outcome) for job, outcome in outcomes]

        self._registry.append(list(rows.values()), ends, partly=True)
        for _, outcome in outcomes:
            self._summary.add(outcome)
        self._registry.files.compact(MANY_FILES)

    def finish(self) -> None:
        """Write the last outcomes, and list what no list has: also what a batch wrote that was killed."""
        self.flush()
        if self._registry is not None:
            self._registry.list_records()
            self._registry.files.compact(MANY_FILES)


def _end(job: Job, outcome: Outcome) -> JobEnd:
    row, reason = outcome.row, f"{outcome.reason} It is put aside." if outcome.deaths else outcome.reason
    return JobEnd(
        task=job.task,
        job=rows_hash(job),
        made_from=outcome.made_from,
        added=datetime.now(UTC),
        name=job.name,
        status=outcome.status,
        code=outcome.code,
        reason=reason,
        key="" if row is None else row.key,
        make="" if row is None else row.make,
        model="" if row is None else row.model,
        serial=job.unit.serial if row is None else row.serial,
        photos=() if outcome.status == "accepted" else tuple(PurePath(photo).name for photo in job.photos),
        deaths=outcome.deaths,
    )


def summary_csv(outcomes: Sequence[Outcome]) -> str:
    """One row for each outcome."""
    head = ("name", "folder", "status", "code", "reason")
    rows = [[getattr(outcome, name) for name in head] + ["yes" if outcome.resumed else "no"] for outcome in outcomes]
    return csv_text((*head, "resumed"), rows)


def csv_text(head: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """A table as CSV that no spreadsheet takes for formulas; None is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(["" if value is None else cell(str(value)) for value in row] for row in rows)
    return text.getvalue()


def cell(text: str) -> str:
    """Text that no spreadsheet takes for a formula, without carriage returns, which `csv` does not quote."""
    return _FORMULA.sub("'", text).replace("\r", " ")
