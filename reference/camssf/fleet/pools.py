"""Who does a batch's jobs: processes here, or the workers of a Dask cluster. Both do again what a lost one left.

A job that costs DEATHS processes their lives is put aside. Here each suspect then goes alone, so that only the
culprit pays. A cluster's workers are not ours to count: there a job leaves a mark in the archive when it is begun and
takes it away at its end, and who finds DEATHS marks does not begin it again.
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

from camssf import __version__
from camssf.errors import InvalidArgument
from camssf.fleet.inputs import basis_path
from camssf.fleet.manifest import Item, file_in
from camssf.fleet.rows import Row
from camssf.fleet.run import begin, single_threads
from camssf.libraries import library

FLUSH = 2.0
"""Seconds after which what was done is written down."""
AHEAD = 4
"""Jobs a worker that wait for it."""
DEATHS = 2
"""Of processes that worked on a job, after which it is put aside until its files or its rows change."""
ANSWER = 30.0
"""Seconds in which a scheduler answers, and has a worker."""
WORKERLESS = 60.0
"""Seconds without any worker, after which a cluster is given up; a nanny begins a new one in less."""
AGAIN = 8
"""Times that a job is handed out again because workers died while it waited, or the cluster gave no answer."""
PUT_ASIDE = "The process that worked on it died, twice (memory, or a damaged file). It is put aside."

One: TypeAlias = Callable[[Item], "Done"]


@dataclass(frozen=True)
class Done:
    """What a worker tells of a job.

    Attributes:
        status, code, reason, made_from: as in `Task`.
        row: of its result; None without one.
        found: the result was in the archive already.
    """

    status: str
    code: str = ""
    reason: str = ""
    made_from: str = ""
    row: Row | None = None
    found: bool = False


class Desk(Protocol):
    """Where what was done is taken."""

    def take(self, item: Item, done: Done, *, deaths: int = 0) -> None:
        """One job's end."""

    def flush(self, *, if_due: bool = False) -> None:
        """Write it down."""


# Processes here


def here(todo: Iterator[Item], one: One, count: int, desk: Desk, tell: Callable[[], None]) -> None:
    """Over processes. Where one dies, what may have killed it goes alone, so that only the culprit pays."""
    with single_threads():
        while suspects := _pool(todo, one, count, desk, tell):
            for item in suspects:
                if _pool(iter([item]), one, 1, desk, tell):
                    desk.take(item, Done("failed", "", PUT_ASIDE), deaths=DEATHS)


def _pool(todo: Iterator[Item], one: One, count: int, desk: Desk, tell: Callable[[], None]) -> list[Item]:
    """Work until there is no more, or a process died: then what was under way. No process is begun for nothing."""
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
                    desk.take(running[future], future.result())
                    del running[future]
                desk.flush(if_due=True)
                tell()
        except BrokenProcessPool:
            return [*running.values(), *([] if item is None else [item])]
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return []


# A Dask cluster


def on_dask(todo: Iterator[Item], one: One, where: tuple[str, Path], desk: Desk, tell: Callable[[], None]) -> None:
    """Over the workers of a cluster that is there already, and stays.

    Args:
        todo: the jobs.
        one: what to do with one.
        where: the scheduler's address, and the archive, beside whose results the marks lie.
        desk: where what was done goes.
        tell: called now and then.

    Raises:
        InvalidArgument: the library is missing, nobody answers, a worker has no camssf or another version, or the
            scheduler or all workers went away; what was done until then is kept.
    """
    distributed = library("distributed", "The option --dask needs", "dask")
    first = next(todo, None)
    if first is None:
        return
    marks = where[1] / f".camssf-begun-{os.getpid()}-{secrets.token_hex(8)}"
    with _client(distributed, where[0]) as client:
        try:
            marks.mkdir(parents=True)
            _hand_out(client, (first, todo), one, marks, desk, tell)
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
        with suppress(Exception):  # it may be gone
            client.close(timeout=2)


def _hand_out(
    client: Any, jobs: tuple[Item, Iterator[Item]], one: One, marks: Path, desk: Desk, tell: Callable[[], None]
) -> None:
    """Until there is no more; never more at a time than the workers have in hand and wait for."""
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
            with suppress(TimeoutError, CancelledError), client.as_current():  # one cancelled: see each below
                wait_for(list(running), timeout=FLUSH, return_when="FIRST_COMPLETED")
            for future in [each for each in running if each.status != "pending"]:
                job = running.pop(future)
                try:
                    done = _answer(future)
                except (KilledWorker, CancelledError, TimeoutError) as error:
                    killed = isinstance(error, KilledWorker)  # whether the job was to blame, its marks say
                    count = lost[job.task] = lost.get(job.task, 0) + 1
                    if not killed:  # nobody died of it: what it began, the cluster dropped
                        (marks / job.task).unlink(missing_ok=True)
                        with suppress(Exception):
                            client.cancel([future], force=True)
                    if count <= AGAIN:
                        running[_submit(client, task, job)] = job
                    elif killed:
                        words = f"Workers died {count} times while they had it. It is put aside."
                        desk.take(job, Done("failed", "", words), deaths=DEATHS)
                    else:
                        words = f"The Dask cluster lost it {count} times. Run the same command again to do it."
                        desk.take(job, Done("failed", "", words))
                except ModuleNotFoundError as error:
                    raise InvalidArgument(
                        f"A worker of the Dask cluster lacks {error.name}.",
                        f"Install camssf {__version__} there: the wheel is all that a worker needs.",
                    ) from error
                else:
                    desk.take(job, done, deaths=DEATHS if done.reason == PUT_ASIDE else 0)
            desk.flush(if_due=True)
            tell()
    except (OSError, RuntimeError, ClosedClientError) as error:  # a lost connection, in Dask's and in Tornado's words
        raise InvalidArgument(
            f"The Dask cluster was lost ({' '.join(str(error).split()) or type(error).__name__}).",
            "Start it again, and the same command: what was done is not done again.",
        ) from error
    finally:
        with suppress(Exception):
            client.cancel(list(running), force=True)


def _answer(future: Any) -> Done:
    """What became of a job.

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
    """The same job, wherever the process that does it stands."""

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
    """Do it, unless DEATHS have begun it and nobody has ended it."""
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
