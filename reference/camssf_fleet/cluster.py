"""Runs the jobs of a batch on the workers of a Dask cluster (`pools.run_jobs`).

`Client.get_executor` is not used: its futures never end if the answer of a finished job cannot be fetched.
"""

from __future__ import annotations

import asyncio
import os
import secrets
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

from camssf.errors import InvalidArgument
from camssf.libraries import library
from camssf.places import Place, remove
from camssf.version import __version__
from camssf_fleet.manifest import Job
from camssf_fleet.outcome import Outcome
from camssf_fleet.pools import Lost, Pool, Recorder, Work, run_jobs

SCHEDULER_TIMEOUT = 30.0
"""Seconds to wait for the scheduler's answer, and for its first worker."""
WORKERLESS_TIMEOUT = 60.0
"""Seconds without any worker after which the batch fails; a Dask nanny restarts a worker in less."""


def run_dask(jobs: Iterator[Job], work: Work, address: str, archive: Place, recorder: Recorder) -> None:
    """Run the jobs on the workers of an existing cluster, which keeps running afterwards.

    Args:
        jobs: the jobs.
        work: function that does one job.
        address: of the scheduler.
        archive: folder that all workers reach, for the marks of begun jobs.
        recorder: receives the finished jobs.

    Raises:
        InvalidArgument: the library is missing, the scheduler does not answer, a worker has no camssf or another
            version, or the scheduler or all workers were lost; finished jobs are kept.
    """
    library("distributed", "A Dask scheduler needs", "dask")
    marks = archive / f".camssf-begun-{os.getpid()}-{secrets.token_hex(8)}"
    try:
        run_jobs(jobs, work, _cluster(address), marks, recorder)
    finally:
        remove(marks)


@contextmanager
def _cluster(address: str) -> Iterator[Pool]:
    """The workers of a cluster; the jobs that are not finished in the end are dropped."""
    from distributed import Client, KilledWorker
    from distributed.client import ClosedClientError

    try:
        client = Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InvalidArgument(
            f"No Dask scheduler answers at {address!r}.",
            "Start one with `dask scheduler` and workers with `dask worker ADDRESS`, and give its address, tcp://...",
        ) from error
    try:
        client.wait_for_workers(1, timeout=SCHEDULER_TIMEOUT)
        yield Pool(partial(_submit, client), partial(_workers, client, [time.monotonic()]), KilledWorker)
    except TimeoutError as error:
        raise InvalidArgument(
            f"The Dask cluster at {address} has no worker.", "Start some with `dask worker ADDRESS --nthreads 1`."
        ) from error
    except ModuleNotFoundError as error:
        raise InvalidArgument(
            f"A worker of the Dask cluster lacks {error.name}.",
            f"Install camssf {__version__} there: the wheel is all that a worker needs.",
        ) from error
    except (OSError, RuntimeError, ClosedClientError) as error:  # a lost connection, from Dask or from Tornado
        raise InvalidArgument(
            f"The Dask cluster was lost ({' '.join(str(error).split()) or type(error).__name__}).",
            "Start it again, and the same command: what was done is not done again.",
        ) from error
    finally:
        with suppress(Exception):  # the scheduler may be gone
            client.close(timeout=2)


def _workers(client: Any, last_seen: list[float]) -> int:
    """Number of the workers' threads.

    Raises:
        InvalidArgument: there has been none for WORKERLESS_TIMEOUT.
    """
    threads: int = sum(client.nthreads().values())
    if threads:
        last_seen[:] = [time.monotonic()]
    elif time.monotonic() - last_seen[0] > WORKERLESS_TIMEOUT:
        raise InvalidArgument(
            f"The Dask cluster has had no worker for {WORKERLESS_TIMEOUT:.0f} s.",
            "Start some with `dask worker ADDRESS --nthreads 1`, then the same command: what was done stays done.",
        )
    return threads


def _submit(client: Any, *call: Any) -> Future[Outcome]:
    """A future that ends in any case; with `Lost` if the job was cancelled or its outcome cannot be fetched."""
    from distributed import wait

    async def outcome() -> Outcome:
        submitted = client.submit(*call, key=f"camssf-{secrets.token_hex(16)}", pure=False)
        try:
            with client.as_current():
                await wait([submitted])
            fetched: Outcome = await asyncio.wait_for(submitted, SCHEDULER_TIMEOUT)
        except (CancelledError, TimeoutError) as error:
            raise Lost from error
        return fetched

    return asyncio.run_coroutine_threadsafe(outcome(), client.loop.asyncio_loop)
