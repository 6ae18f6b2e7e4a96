"""Runs the jobs of a batch in local processes or on the workers of a Dask cluster, and repeats interrupted jobs.

A job during which DEATHS processes died is put aside. Local processes: after a crash each job that was running is
repeated alone, to find the one that crashes. Cluster: a job appends a byte to a file in the archive when it begins
and deletes the file at its end; a worker that finds DEATHS bytes does not begin the job.
"""

from __future__ import annotations

import os
import secrets
import shutil
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from camssf.errors import InvalidArgument
from camssf.fleet.inputs import basis_path
from camssf.fleet.manifest import Item, file_in
from camssf.fleet.rows import Row
from camssf.fleet.run import begin, single_threads
from camssf.libraries import library
from camssf.version import __version__

FLUSH = 2.0
"""Seconds between writes to the registry."""
AHEAD = 4
"""Jobs queued for each worker."""
DEATHS = 2
"""Processes that may die during a job; then it is put aside until its files or rows change."""
ANSWER = 30.0
"""Seconds to wait for the scheduler's answer, and for its first worker."""
WORKERLESS = 60.0
"""Seconds without any worker after which the batch fails; a Dask nanny restarts a worker in less."""
AGAIN = 8
"""Number of times that a job is resubmitted because workers died while it waited, or the cluster lost it."""
PUT_ASIDE = "The process that worked on it died, twice (memory, or a damaged file). It is put aside."

One: TypeAlias = Callable[[Item], "Done"]


@dataclass(frozen=True)
class Done:
    """A worker's report about one job.

    Attributes:
        status, code, reason, made_from: as in `Task`.
        row: row of the result; None without one.
        found: the result was already in the archive.
    """

    status: str
    code: str = ""
    reason: str = ""
    made_from: str = ""
    row: Row | None = None
    found: bool = False


class ResultWriter(Protocol):
    """Receives finished jobs and writes them."""

    def take(self, item: Item, done: Done, *, deaths: int = 0) -> None:
        """Add one finished job."""

    def flush(self, *, if_due: bool = False) -> None:
        """Write the buffered jobs; with `if_due` only when it is time to."""


# Processes here


def here(todo: Iterator[Item], one: One, count: int, writer: ResultWriter, tell: Callable[[], None]) -> None:
    """Run the jobs in local processes; if one dies, repeat each job that was running alone."""
    with single_threads():
        while suspects := _pool(todo, one, count, writer, tell):
            for item in suspects:
                if _pool(iter([item]), one, 1, writer, tell):
                    writer.take(item, Done("failed", "", PUT_ASIDE), deaths=DEATHS)


def _pool(todo: Iterator[Item], one: One, count: int, writer: ResultWriter, tell: Callable[[], None]) -> list[Item]:
    """Run jobs until none is left or a process dies; returns the unfinished ones. Starts no process without a job."""
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
                    writer.take(running[future], future.result())
                    del running[future]
                writer.flush(if_due=True)
                tell()
        except BrokenProcessPool:
            return [*running.values(), *([] if item is None else [item])]
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return []


# A Dask cluster


def on_dask(
    todo: Iterator[Item], one: One, where: tuple[str, Path], writer: ResultWriter, tell: Callable[[], None]
) -> None:
    """Run the jobs on the workers of an existing cluster, which keeps running afterwards.

    Args:
        todo: the jobs.
        one: function that does one job.
        where: the scheduler's address, and the archive, which also holds the files that mark begun jobs.
        writer: receives the finished jobs.
        tell: called regularly.

    Raises:
        InvalidArgument: the library is missing, the scheduler does not answer, a worker has no camssf or another
            version, or the scheduler or all workers were lost; finished jobs are kept.
    """
    distributed = library("distributed", "The option --dask needs", "dask")
    first = next(todo, None)
    if first is None:
        return
    marks = where[1] / f".camssf-begun-{os.getpid()}-{secrets.token_hex(8)}"
    with _client(distributed, where[0]) as client:
        try:
            marks.mkdir(parents=True)
            _hand_out(client, (first, todo), one, marks, writer, tell)
        except OSError as error:
            raise InvalidArgument(
                f"{where[1]}: the archive cannot be used ({error.strerror or error}).", "Check the folder."
            ) from error
        finally:
            shutil.rmtree(marks, ignore_errors=True)


@contextmanager
def _client(distributed: Any, address: str) -> Iterator[Any]:
    try:
        client = distributed.Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InvalidArgument(
            f"No Dask scheduler answers at {address!r}.",
            "Start one with `dask scheduler` and workers with `dask worker ADDRESS`, and give its address, tcp://...",
        ) from error
    try:
        try:
            client.wait_for_workers(1, timeout=ANSWER)
        except TimeoutError as error:
            raise InvalidArgument(
                f"The Dask cluster at {address} has no worker.", "Start some with `dask worker ADDRESS --nthreads 1`."
            ) from error
        yield client
    finally:
        with suppress(Exception):  # the scheduler may be gone
            client.close(timeout=2)


def _hand_out(
    client: Any,
    jobs: tuple[Item, Iterator[Item]],
    one: One,
    marks: Path,
    writer: ResultWriter,
    tell: Callable[[], None],
) -> None:
    """Submit jobs until none is left, at most AHEAD at a time for each worker thread."""
    from distributed import KilledWorker
    from distributed import wait as wait_for
    from distributed.client import ClosedClientError

    task = partial(_marked, one=one, marks=marks, version=__version__)
    item: Item | None
    item, todo = jobs
    running: dict[Any, Item] = {}
    lost: dict[str, int] = {}
    seen = time.monotonic()
    try:
        while item is not None or running:
            threads = sum(client.nthreads().values())
            seen = time.monotonic() if threads else seen
            if time.monotonic() - seen > WORKERLESS:
                raise InvalidArgument(
                    f"The Dask cluster has had no worker for {WORKERLESS:.0f} s.",
                    "Start some with `dask worker ADDRESS --nthreads 1`, and the same command: what was done is not "
                    "done again.",
                )
            room = AHEAD * max(1, threads)
            while item is not None and len(running) < room:
                running[_submit(client, task, item)] = item
                item = next(todo, None)
            with suppress(TimeoutError, CancelledError), client.as_current():  # cancelled ones are handled below
                wait_for(list(running), timeout=FLUSH, return_when="FIRST_COMPLETED")
            for future in [each for each in running if each.status != "pending"]:
                job = running.pop(future)
                try:
                    done = _answer(future)
                except (KilledWorker, CancelledError, TimeoutError) as error:
                    killed = isinstance(error, KilledWorker)  # `_marked` decides whether this job was the cause
                    count = lost[job.task] = lost.get(job.task, 0) + 1
                    if not killed:  # the cluster dropped the job and no worker died: delete its mark
                        (marks / job.task).unlink(missing_ok=True)
                        with suppress(Exception):
                            client.cancel([future], force=True)
                    if count <= AGAIN:
                        running[_submit(client, task, job)] = job
                    elif killed:
                        words = f"Workers died {count} times while they had it. It is put aside."
                        writer.take(job, Done("failed", "", words), deaths=DEATHS)
                    else:
                        words = f"The Dask cluster lost it {count} times. Run the same command again to do it."
                        writer.take(job, Done("failed", "", words))
                except ModuleNotFoundError as error:
                    raise InvalidArgument(
                        f"A worker of the Dask cluster lacks {error.name}.",
                        f"Install camssf {__version__} there: the wheel is all that a worker needs.",
                    ) from error
                else:
                    writer.take(job, done, deaths=DEATHS if done.reason == PUT_ASIDE else 0)
            writer.flush(if_due=True)
            tell()
    except (OSError, RuntimeError, ClosedClientError) as error:  # a lost connection, from Dask or from Tornado
        raise InvalidArgument(
            f"The Dask cluster was lost ({' '.join(str(error).split()) or type(error).__name__}).",
            "Start it again, and the same command: what was done is not done again.",
        ) from error
    finally:
        with suppress(Exception):
            client.cancel(list(running), force=True)


def _answer(future: Any) -> Done:
    """The report of a finished job.

    Raises:
        KilledWorker: workers died while they had it.
        CancelledError, TimeoutError: the cluster dropped it, or lost the answer.
    """
    if future.status == "lost":
        raise CancelledError  # `result` would wait for it
    done: Done = future.result(timeout=ANSWER)
    return done


def _submit(client: Any, task: One, item: Item) -> Any:
    return client.submit(task, _anywhere(item), key=f"camssf-{item.task[:24]}-{secrets.token_hex(4)}", pure=False)


def _anywhere(item: Item) -> Item:
    """The same job with absolute paths, for a process with another working folder."""

    def absolute(words: Sequence[str | None]) -> tuple[str | None, ...]:
        return tuple(_absolute(each) for each in words)

    job = item.job
    basis = basis_path(job.basis)
    found: dict[str, Any] = {name: absolute(getattr(job, name)) for name in ("photos", "lamps", "white", "dark")}
    found["basis"] = job.basis if basis is None else str(basis.absolute())
    return replace(item, job=replace(job, **found, chart=_absolute(job.chart) or job.chart))


def _absolute(words: str | None) -> str | None:
    layout, path = file_in(words)
    if path is None:
        return words
    return f"{layout}:{path.absolute()}" if layout else str(path.absolute())


# In a cluster's worker

_turn = threading.Lock()
"""One job at a time in a process, however many threads its worker has."""


def _marked(item: Item, *, one: One, marks: Path, version: str) -> Done:
    """Do the job, unless it was begun DEATHS times and never ended."""
    if version != __version__:
        raise InvalidArgument(
            f"A worker of the Dask cluster has camssf {__version__}.", f"Install {version} there, as it is here."
        )
    mark = marks / item.task
    with _turn:
        with open(mark, "ab") as stream:
            begun = stream.tell()
            if begun >= DEATHS:
                return Done("failed", "", PUT_ASIDE)
            stream.write(b".")
            stream.flush()
            os.fsync(stream.fileno())
        done = one(item)
        mark.unlink(missing_ok=True)
        return done
