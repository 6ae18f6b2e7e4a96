"""Runs the jobs of a batch on a pool of processes, and repeats those that were interrupted.

`run_jobs` is the one loop over local processes (`processes`) and a Dask cluster (`cluster`), `do_job` is what their
processes do. One rule for both: a job writes a mark when it begins and removes its marks when it ends, so each mark
that is left is a process that died during the job. A job with DEATHS marks has failed. A job that only waited has no
mark.
"""

from __future__ import annotations

import secrets
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from camssf.errors import InvalidArgument
from camssf.places import Place, files_below, remove, touch
from camssf.version import __version__
from camssf_fleet.manifest import Job, rows_hash
from camssf_fleet.memory import keep_memory
from camssf_fleet.outcome import Outcome

FLUSH = 10.0
"""Seconds after which the recorder writes the outcomes that it has; a killed run loses none, the archive has them."""
POLL = 2.0
"""Longest wait for a job's end, before the recorder is called again, seconds."""
QUEUED_PER_WORKER = 4
"""Jobs queued for each worker."""
DEATHS = 2
"""Processes that may die during a job; then it has failed."""
RESUBMISSIONS = 8
"""Number of times that an interrupted job is submitted again."""
DIED = "The process that worked on it died, twice (memory, or a damaged file)."

Work: TypeAlias = Callable[[Job], Outcome]


class Recorder(Protocol):
    """Receives the outcomes."""

    def add(self, job: Job, outcome: Outcome) -> None:
        """Add one finished job."""

    def update(self) -> None:
        """Called at least every POLL seconds: write what is due, report progress."""


class Lost(Exception):
    """A cluster has lost a job or its outcome, and no process died."""


@dataclass(frozen=True)
class Pool:
    """Processes that do jobs.

    Attributes:
        submit: queues a call of a function; its future may end with `Lost`.
        workers: number of jobs done at a time.
        died: exception of a future whose process died.
    """

    submit: Callable[..., Future[Outcome]]
    workers: Callable[[], int]
    died: type[Exception]


def run_jobs(
    jobs: Iterator[Job], work: Work, start: AbstractContextManager[Pool], marks: Place, recorder: Recorder
) -> None:
    """Run jobs until none is left, QUEUED_PER_WORKER for each worker at a time; without a job nothing is started."""
    job = next(jobs, None)
    if job is None:
        return
    running: dict[Future[Outcome], Job] = {}
    interruptions: Counter[Job] = Counter()
    with start as pool:

        def submit(job: Job) -> None:
            running[pool.submit(do_job, job, work, marks / rows_hash(job), __version__)] = job

        try:
            while job is not None or running:
                limit = QUEUED_PER_WORKER * max(1, pool.workers())
                while job is not None and len(running) < limit:
                    submit(job)
                    job = next(jobs, None)
                for future in wait(running, POLL, FIRST_COMPLETED).done:
                    ended = running.pop(future)
                    try:
                        outcome = future.result()
                    except (pool.died, Lost) as error:
                        interruptions[ended] += 1
                        if isinstance(error, Lost):
                            remove(marks / rows_hash(ended))
                        if interruptions[ended] <= RESUBMISSIONS:
                            submit(ended)
                            continue
                        words = f"It was interrupted {interruptions[ended]} times. Run the same command again for it."
                        outcome = Outcome(ended.name, "failed", "", words)
                    recorder.add(ended, outcome)
                recorder.update()
        finally:
            for future in running:
                future.cancel()


# In a worker

_job_lock = threading.Lock()
"""One job at a time in a process, however many threads its worker has."""


def do_job(job: Job, work: Work, marks: Place, version: str) -> Outcome:
    """Do the job, unless DEATHS processes died during it."""
    if version != __version__:
        raise InvalidArgument(
            f"A worker of the Dask cluster has camssf {__version__}.", f"Install {version} there, as it is here."
        )
    with _job_lock:
        if sum(1 for _ in files_below(marks)) >= DEATHS:
            return Outcome(job.name, "failed", "", DIED, job.folder, deaths=DEATHS)
        touch(marks / secrets.token_hex(8))
        keep_memory()
        outcome = work(job)
        remove(marks)
        return outcome
