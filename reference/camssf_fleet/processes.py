"""Runs the jobs of a batch on local processes (`pools.run_jobs`)."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from multiprocessing import current_process, get_context, parent_process
from queue import LifoQueue
from typing import Any

from camssf.errors import InvalidArgument
from camssf.files import temporary_folder
from camssf_fleet.manifest import Job
from camssf_fleet.outcome import Outcome
from camssf_fleet.pools import Pool, Recorder, Work, run_jobs

UNGUARDED = 78
"""Exit status of a process that ends because the user's script would start a batch in it."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def run_processes(jobs: Iterator[Job], work: Work, count: int, recorder: Recorder) -> None:
    """Run the jobs in local processes.

    Raises:
        InvalidArgument: the user's script starts a batch in every new process, because nothing guards the call.
    """
    if getattr(current_process(), "_inheriting", False):  # a new process, which imports the script
        sys.exit(UNGUARDED)
    with temporary_folder() as marks:
        run_jobs(jobs, work, _processes(count), marks, recorder)


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
