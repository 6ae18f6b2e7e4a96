"""Runs the jobs of a batch in local processes or on the workers of a Dask cluster, and repeats interrupted jobs.

A job during which DEATHS processes died has failed. Local processes: after a crash each job that was running is
repeated alone, to find the one that crashes. Cluster: a job writes a file into the archive when it begins and deletes
its files at its end; a worker that finds DEATHS of them does not begin the job.
"""

from __future__ import annotations

import os
import secrets
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import current_process, get_context, parent_process
from typing import Any, Protocol, TypeAlias

from camssf.errors import InvalidArgument
from camssf.libraries import library
from camssf.places import Place, files_below, remove, write_place
from camssf.version import __version__
from camssf_fleet.manifest import Job
from camssf_fleet.outcome import Outcome

FLUSH = 2.0
"""Longest wait for a job's end, before the recorder is called again, seconds."""
QUEUED_PER_WORKER = 4
"""Jobs queued for each worker."""
DEATHS = 2
"""Processes that may die during a job; then it has failed."""
SCHEDULER_TIMEOUT = 30.0
"""Seconds to wait for the scheduler's answer, and for its first worker."""
WORKERLESS_TIMEOUT = 60.0
"""Seconds without any worker after which the batch fails; a Dask nanny restarts a worker in less."""
RESUBMISSIONS = 8
"""Number of times that a job is resubmitted because workers died while it waited, or the cluster lost it."""
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


# Local processes


def run_processes(jobs: Iterator[Job], work: Work, count: int, recorder: Recorder) -> None:
    """Run the jobs in local processes; if one dies, repeat each job that was running alone.

    Raises:
        InvalidArgument: the user's script starts a batch in every new process, because nothing guards the call.
    """
    if getattr(current_process(), "_inheriting", False):  # a new process, which imports the script
        sys.exit(UNGUARDED)
    with _single_threads():
        while suspects := _pool(jobs, work, count, recorder):
            _check_script()
            for job in suspects:
                if _pool(iter([job]), work, 1, recorder):
                    recorder.add(job, Outcome(job.name, "failed", "", DIED, job.folder, deaths=DEATHS))
                    recorder.update()


def _check_script() -> None:
    probe = get_context("spawn").Process(target=cores)
    probe.start()
    probe.join()
    if probe.exitcode == UNGUARDED:
        raise InvalidArgument(
            "A batch starts processes; each of them runs this script again, which would start another batch.",
            'Put what the script does below a line `if __name__ == "__main__":`.',
        )


def _pool(jobs: Iterator[Job], work: Work, count: int, recorder: Recorder) -> list[Job]:
    """Run jobs until none is left or a process dies; returns the unfinished ones. Starts no process without a job."""
    job = next(jobs, None)
    if job is None:
        return []
    running: dict[Future[Outcome], Job] = {}
    with ProcessPoolExecutor(count, get_context("spawn"), _begin) as pool:
        try:
            while job is not None or running:
                while job is not None and len(running) < QUEUED_PER_WORKER * count:
                    running[pool.submit(work, job)] = job
                    job = next(jobs, None)
                finished, _ = wait(running, timeout=FLUSH, return_when=FIRST_COMPLETED)
                for future in sorted(finished, key=lambda each: each.exception() is not None):
                    recorder.add(running[future], future.result())
                    del running[future]
                recorder.update()
        except BrokenProcessPool:
            return [*running.values(), *([] if job is None else [job])]
        except BaseException:
            pool.shutdown(cancel_futures=True)  # waits for running jobs; leaving `with` would not cancel the rest
            raise
    return []


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


@contextmanager
def _single_threads() -> Iterator[None]:
    """Set one BLAS thread for each new process, which reads it at its start; the processes are the parallelism."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update({name: value or "1" for name, value in before.items()})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)


# A Dask cluster


def run_dask(jobs: Iterator[Job], work: Work, address: str, archive: Place, recorder: Recorder) -> None:
    """Run the jobs on the workers of an existing cluster, which keeps running afterwards.

    Args:
        jobs: the jobs; each has a `task`.
        work: function that does one job.
        address: of the scheduler.
        archive: folder for the files that mark begun jobs.
        recorder: receives the finished jobs.

    Raises:
        InvalidArgument: the library is missing, the scheduler does not answer, a worker has no camssf or another
            version, or the scheduler or all workers were lost; finished jobs are kept.
    """
    distributed = library("distributed", "A Dask scheduler needs", "dask")
    first = next(jobs, None)
    if first is None:
        return
    marks = archive / f".camssf-begun-{os.getpid()}-{secrets.token_hex(8)}"
    with _client(distributed, address) as client:
        try:
            _hand_out(client, (first, jobs), work, marks, recorder)
        except OSError as error:
            raise InvalidArgument(
                f"{archive}: the archive cannot be used ({error.strerror or error}).", "Check the folder."
            ) from error
        finally:
            remove(marks)


@contextmanager
def _client(distributed: Any, address: str) -> Iterator[Any]:
    try:
        client = distributed.Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InvalidArgument(
            f"No Dask scheduler answers at {address!r}.",
            "Start one with `dask scheduler` and workers with `dask worker ADDRESS`, and give its address, tcp://...",
        ) from error
    try:
        try:
            client.wait_for_workers(1, timeout=SCHEDULER_TIMEOUT)
        except TimeoutError as error:
            raise InvalidArgument(
                f"The Dask cluster at {address} has no worker.", "Start some with `dask worker ADDRESS --nthreads 1`."
            ) from error
        yield client
    finally:
        with suppress(Exception):  # the scheduler may be gone
            client.close(timeout=2)


def _hand_out(client: Any, jobs: tuple[Job, Iterator[Job]], work: Work, marks: Place, recorder: Recorder) -> None:
    """Submit jobs until none is left, at most QUEUED_PER_WORKER at a time for each worker thread."""
    from distributed import KilledWorker
    from distributed import wait as wait_for
    from distributed.client import ClosedClientError

    marked = partial(_marked, work=work, marks=marks, version=__version__)
    job: Job | None
    job, rest = jobs
    running: dict[Any, Job] = {}
    lost: dict[str, int] = {}
    had_workers = time.monotonic()
    try:
        while job is not None or running:
            threads = sum(client.nthreads().values())
            had_workers = time.monotonic() if threads else had_workers
            if time.monotonic() - had_workers > WORKERLESS_TIMEOUT:
                raise InvalidArgument(
                    f"The Dask cluster has had no worker for {WORKERLESS_TIMEOUT:.0f} s.",
                    "Start some with `dask worker ADDRESS --nthreads 1`, and the same command: what was done is not "
                    "done again.",
                )
            while job is not None and len(running) < QUEUED_PER_WORKER * max(1, threads):
                running[_submit(client, marked, job)] = job
                job = next(rest, None)
            with suppress(TimeoutError, CancelledError), client.as_current():  # cancelled ones are handled below
                wait_for(list(running), timeout=FLUSH, return_when="FIRST_COMPLETED")
            for future in [each for each in running if each.status != "pending"]:
                done = running.pop(future)
                try:
                    outcome = _outcome_of(future)
                except (KilledWorker, CancelledError, TimeoutError) as error:
                    killed = isinstance(error, KilledWorker)  # `_marked` decides whether this job was the cause
                    count = lost[done.task] = lost.get(done.task, 0) + 1
                    if not killed:  # the cluster dropped the job and no worker died: delete its mark
                        remove(marks / done.task)
                        with suppress(Exception):
                            client.cancel([future], force=True)
                    if count <= RESUBMISSIONS:
                        running[_submit(client, marked, done)] = done
                        continue
                    words = f"The Dask cluster lost it {count} times. Run the same command again to do it."
                    if killed:
                        words = f"Workers died {count} times while they had it."
                    outcome = Outcome(done.name, "failed", "", words, deaths=DEATHS if killed else 0)
                except ModuleNotFoundError as error:
                    raise InvalidArgument(
                        f"A worker of the Dask cluster lacks {error.name}.",
                        f"Install camssf {__version__} there: the wheel is all that a worker needs.",
                    ) from error
                recorder.add(done, outcome)
            recorder.update()
    except (OSError, RuntimeError, ClosedClientError) as error:  # a lost connection, from Dask or from Tornado
        raise InvalidArgument(
            f"The Dask cluster was lost ({' '.join(str(error).split()) or type(error).__name__}).",
            "Start it again, and the same command: what was done is not done again.",
        ) from error
    finally:
        with suppress(Exception):
            client.cancel(list(running), force=True)


def _outcome_of(future: Any) -> Outcome:
    """What a worker answered.

    Raises:
        KilledWorker: workers died while they had it.
        CancelledError, TimeoutError: the cluster dropped it, or lost the answer.
    """
    if future.status == "lost":
        raise CancelledError  # `result` would wait for it
    outcome: Outcome = future.result(timeout=SCHEDULER_TIMEOUT)
    return outcome


def _submit(client: Any, work: Work, job: Job) -> Any:
    return client.submit(work, job, key=f"camssf-{job.task[:24]}-{secrets.token_hex(4)}", pure=False)


# In a cluster's worker

_job_lock = threading.Lock()
"""One job at a time in a process, however many threads its worker has."""


def _marked(job: Job, *, work: Work, marks: Place, version: str) -> Outcome:
    """Do the job, unless it was begun DEATHS times and never ended."""
    if version != __version__:
        raise InvalidArgument(
            f"A worker of the Dask cluster has camssf {__version__}.", f"Install {version} there, as it is here."
        )
    mark = marks / job.task
    with _job_lock:
        if sum(1 for _ in files_below(mark)) >= DEATHS:
            return Outcome(job.name, "failed", "", DIED, deaths=DEATHS)
        write_place(mark / secrets.token_hex(8), b"")
        outcome = work(job)
        remove(mark)
        return outcome
