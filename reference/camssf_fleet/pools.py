"""Runs the jobs of a batch on local processes or on a Dask cluster, and repeats those that were interrupted.

`run_jobs` is the one loop over both, and `do_job` is what their processes do. One rule for both: a job writes a mark
when it begins and removes its marks when it ends, so each mark that is left is a process that died during the job. A
job with DEATHS marks has failed. A job that only waited has no mark.
"""

from __future__ import annotations

import os
import secrets
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import current_process, get_context, parent_process
from queue import LifoQueue
from typing import Any, Protocol, TypeAlias

from camssf.errors import InvalidArgument
from camssf.files import temporary_folder
from camssf.places import Place, files_below, remove, write_place
from camssf.version import __version__
from camssf_fleet.manifest import Job, rows_hash
from camssf_fleet.outcome import Outcome

FLUSH = 2.0
"""Longest wait for a job's end, before the recorder is called again, seconds."""
QUEUED_PER_WORKER = 4
"""Jobs queued for each worker."""
DEATHS = 2
"""Processes that may die during a job; then it has failed."""
RESUBMISSIONS = 8
"""Number of times that an interrupted job is submitted again."""
DIED = "The process that worked on it died, twice (memory, or a damaged file)."
UNGUARDED = 78
"""Exit status of a process that ends because the user's script would start a batch in it."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Work: TypeAlias = Callable[[Job], Outcome]


class Recorder(Protocol):
    """Receives the outcomes."""

    def add(self, job: Job, outcome: Outcome) -> None:
        """Add one finished job."""

    def update(self) -> None:
        """Called at least every FLUSH seconds: write what is due, report progress."""


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


def run_processes(jobs: Iterator[Job], work: Work, count: int, recorder: Recorder) -> None:
    """Run the jobs in local processes.

    Raises:
        InvalidArgument: the user's script starts a batch in every new process, because nothing guards the call.
    """
    if getattr(current_process(), "_inheriting", False):  # a new process, which imports the script
        sys.exit(UNGUARDED)
    with temporary_folder() as marks:
        run_jobs(jobs, work, _processes(count), marks, recorder)


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
                for future in wait(running, FLUSH, FIRST_COMPLETED).done:
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
            remove(marks)


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
        write_place(marks / secrets.token_hex(8), b"")
        outcome = work(job)
        remove(marks)
        return outcome


# Local processes


@contextmanager
def _processes(count: int) -> Iterator[Pool]:
    """Local processes with one BLAS thread each, which they read from the environment at their start.

    A thread for each process hands it one job at a time, so that a death interrupts no other job.
    """
    unset = [name for name in _THREADS if name not in os.environ]
    new_process = partial(ProcessPoolExecutor, 1, get_context("spawn"), _begin)
    idle: LifoQueue[ProcessPoolExecutor] = LifoQueue()
    for _ in range(count):
        idle.put(new_process())  # started by its first job

    def in_process(*call: Any) -> Outcome:
        process = idle.get()
        try:
            outcome: Outcome = process.submit(*call).result()
            return outcome
        except BrokenProcessPool:
            process = new_process()
            _check_script()
            raise
        finally:
            idle.put(process)

    os.environ.update(dict.fromkeys(unset, "1"))
    threads = ThreadPoolExecutor(count)
    try:
        yield Pool(partial(threads.submit, in_process), lambda: count, BrokenProcessPool)
    finally:
        threads.shutdown()  # waits for the jobs that run
        while not idle.empty():
            idle.get().shutdown()
        for name in unset:
            del os.environ[name]


def _check_script() -> None:
    probe = get_context("spawn").Process(target=cores)
    probe.start()
    probe.join()
    if probe.exitcode == UNGUARDED:
        raise InvalidArgument(
            "A batch starts processes; each of them runs this script again, which would start another batch.",
            'Put what the script does below a line `if __name__ == "__main__":`.',
        ) from None


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _begin() -> None:
    """Initialise a worker process: ignore Ctrl-C, which the parent handles, and exit when the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Exit when the parent process ends; otherwise this process would wait for work for ever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)  # immediate exit is safe: files are written atomically
