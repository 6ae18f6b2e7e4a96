"""A manifest over a Dask cluster: as over processes here, whoever dies, and whatever the cluster lacks."""

import asyncio
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from camssf import cli
from camssf.errors import InvalidArgument
from camssf.places import write_place
from camssf_fleet import cluster as cluster_module
from camssf_fleet import pools
from camssf_fleet.manifest import Job, Manifest
from camssf_fleet.outcome import Outcome
from tests.support.desk import Desk, slow, until
from tests.support.processes import SEARCH

pytest.importorskip("duckdb", reason="duckdb is not here")
distributed = pytest.importorskip("distributed", reason="distributed is not here")

pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(sys.platform == "win32", reason="signals differ there"),
    pytest.mark.filterwarnings("default"),  # of Dask and Tornado at their ends: not ours to mend
]


QUIET = {"dashboard_address": None, "silence_logs": 50}


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two workers; nannies begin a new one where one dies."""
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = SEARCH
    try:
        with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **QUIET) as started:
            yield started
    finally:
        os.environ.pop("PYTHONPATH") if before is None else os.environ.update(PYTHONPATH=before)


class Ends:
    """A recorder of what became of the jobs."""

    def __init__(self) -> None:
        self.outcomes: list[tuple[str, str, str, int]] = []

    def add(self, job: Job, outcome: Outcome) -> None:
        self.outcomes.append((job.name, outcome.status, outcome.reason, outcome.deaths))

    def update(self) -> None:
        pass


class Interrupting:
    """A pool that interrupts each job so many times, after it has begun, before it does it."""

    def __init__(self, interruptions: int, error: Exception) -> None:
        self.interruptions, self.error = interruptions, error
        self.submitted: Counter[str] = Counter()

    def submit(self, do: Any, job: Job, work: Any, marks: Path, version: str) -> Future[Outcome]:
        future: Future[Outcome] = Future()
        self.submitted[job.name] += 1
        if self.submitted[job.name] > self.interruptions:
            future.set_result(do(job, work, marks, version))
        else:
            write_place(marks / str(self.submitted[job.name]), b"")  # by a worker
            future.set_exception(self.error)
        return future


def done_at_once(job: Job) -> Outcome:
    return Outcome(job.name, "accepted", reason=job.name)


def run_interrupted(tmp_path: Path, interruptions: int, error: Exception, workers: int = 1) -> Any:
    (tmp_path / "m.csv").write_text("name,photo,lamp\na,x,D55\nb,y,D55\n")
    pool, ends = Interrupting(interruptions, error), Ends()
    start = nullcontext(pools.Pool(pool.submit, lambda: workers, distributed.KilledWorker))
    pools.run_jobs(iter(Manifest(tmp_path / "m.csv")), done_at_once, start, tmp_path / "marks", ends)
    shutil.rmtree(tmp_path / "marks", ignore_errors=True)
    return pool, sorted(ends.outcomes)


DIED = distributed.KilledWorker("key", "worker", 3)


AGAIN = f"It was interrupted {pools.RESUBMISSIONS + 1} times. Run the same command again for it."


@pytest.mark.parametrize(("interruptions", "error", "submitted", "end"), [
    (1, pools.Lost(), 2, ("accepted", None, 0)),
    (pools.RESUBMISSIONS, pools.Lost(), pools.RESUBMISSIONS + 1, ("accepted", None, 0)),
    (10**6, pools.Lost(), pools.RESUBMISSIONS + 1, ("failed", AGAIN, 0)),  # no job's fault: the next run tries again
    (pools.DEATHS - 1, DIED, None, ("accepted", None, 0)),
    (pools.DEATHS, DIED, None, ("failed", pools.DIED, pools.DEATHS)),
])  # fmt: skip
def test_what_is_interrupted_is_submitted_again_not_for_ever(
    interruptions: int, error: Exception, submitted: int | None, end: Any, tmp_path: Path
) -> None:
    pool, ends = run_interrupted(tmp_path, interruptions, error)
    status, reason, deaths = end
    assert ends == [(name, status, reason or name, deaths) for name in "ab"]
    assert submitted is None or pool.submitted == dict.fromkeys("ab", submitted)


class Client:
    """A client whose futures are awaitables of the test, in an event loop of their own."""

    def __init__(self, answer: Any) -> None:
        self.answer, self.loop = answer, self
        self.asyncio_loop = asyncio.new_event_loop()

    def as_current(self) -> Any:
        return nullcontext()

    def submit(self, *call: Any, key: str, pure: bool) -> Any:
        return self.answer()


async def lost() -> None:
    await asyncio.sleep(60)


async def cancelled() -> None:
    raise CancelledError("key")


@pytest.mark.parametrize("answer", [lost, cancelled])
def test_the_future_of_a_lost_job_ends(answer: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    async def wait(futures: list[Any]) -> None:
        pass

    monkeypatch.setattr(distributed, "wait", wait)
    monkeypatch.setattr(cluster_module, "SCHEDULER_TIMEOUT", 0.1)
    client = Client(answer)
    thread = threading.Thread(target=client.asyncio_loop.run_forever)
    thread.start()
    try:
        with pytest.raises(pools.Lost):
            cluster_module._submit(client, print).result(timeout=10)
    finally:
        client.asyncio_loop.call_soon_threadsafe(client.asyncio_loop.stop)
        thread.join()
        client.asyncio_loop.close()


def test_a_cluster_that_lost_all_workers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "WORKERLESS_TIMEOUT", 0.0)
    monkeypatch.setattr(Client, "nthreads", lambda self: {}, raising=False)
    with pytest.raises(InvalidArgument, match="has had no worker for 0 s"):
        cluster_module._workers(Client(None), [time.monotonic() - 1.0])


def test_a_client_that_closed_is_said(desk: Desk, cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def closed(*_: Any, **__: Any) -> None:
        raise distributed.client.ClosedClientError("Can't perform action on a closed client")

    monkeypatch.setattr(distributed.Client, "submit", closed)
    desk.fill(1)
    with pytest.raises(InvalidArgument, match="The Dask cluster was lost") as caught:
        desk.run(dask=cluster.scheduler_address)
    assert "the same command" in caught.value.advice


def test_it_does_what_processes_here_do(desk: Desk, cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative paths, too: the workers stand elsewhere. The other way of working then resumes it."""
    monkeypatch.chdir(desk.home)
    desk.home = Path()
    desk.write(
        ["good,a,D55,,,,S1,lab", "bug,b,D55,,,,,", "wrong,w,D55,,,,,", "again,a2,D55,,,,S1,lab", "fault,,D55,,,,,"],
        {"a": "Phone", "b": "bug", "w": "wrong", "a2": "Phone"},
    )
    summary = desk.run(dask=cluster.scheduler_address)
    assert desk.tasks() == {
        "good": "doubtful", "bug": "failed", "wrong": "refused", "again": "doubtful", "fault": "refused",
    }  # fmt: skip
    assert summary.total == 5
    assert len(desk.rows()) == 1
    assert not list(Path("out").glob(".camssf-begun*"))
    again = desk.run(workers=1)
    assert (again.resumed, again.by_status) == (2, summary.by_status)


def test_a_worker_s_death_loses_nothing(desk: Desk, cluster: Any) -> None:
    names = desk.fill(16)
    victims: list[int] = []

    def kill() -> None:
        until(lambda: desk.visits().total() >= 4, 60)
        with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
            victims.extend(list(client.run(os.getpid).values())[:1])
        os.kill(victims[0], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    summary = desk.run(dask=cluster.scheduler_address, work=slow)
    killer.join()
    assert victims
    assert summary.by_status == {"doubtful": 16}
    assert [row["name"] for row in desk.rows()] == sorted(names)  # nothing lost, nothing twice
    visits = desk.visits()
    assert max(visits.values()) <= 2
    assert sum(visits.values()) <= 17  # what was under way alone is done again


def test_a_scheduler_that_is_lost_is_told_and_the_next_goes_on(
    desk: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scheduler is killed in the middle; another one, with another address, does the rest."""
    monkeypatch.setattr(cluster_module, "WORKERLESS_TIMEOUT", 10.0)
    names = desk.fill(12)

    def begin(number: int) -> tuple[str, subprocess.Popen[bytes], list[subprocess.Popen[bytes]]]:
        file = tmp_path / f"scheduler-{number}.json"
        quiet: dict[str, Any] = dict.fromkeys(("stdout", "stderr"), subprocess.DEVNULL)
        quiet["env"] = os.environ | {"PYTHONPATH": SEARCH}
        run = [sys.executable, "-m", "dask"]
        place = ["--scheduler-file", str(file), "--no-dashboard"]
        scheduler = subprocess.Popen([*run, "scheduler", "--port", "0", "--host", "127.0.0.1", *place], **quiet)
        worker = subprocess.Popen([*run, "worker", *place, "--nthreads", "1", "--no-nanny"], **quiet)
        until(lambda: file.exists(), 60)
        return json.loads(file.read_text())["address"], scheduler, [scheduler, worker]

    address, scheduler, processes = begin(0)

    def kill() -> None:
        until(lambda: desk.visits().total() >= 4, 60)
        scheduler.kill()

    killer = threading.Thread(target=kill)
    try:
        killer.start()
        with pytest.raises(InvalidArgument, match=r"Dask cluster (was lost|has had no worker)") as caught:
            desk.run(dask=address, work=slow)
        assert "the same command" in caught.value.advice
        killer.join()
        before = desk.visits().total()
        assert 4 <= before < 12
        address, _, more = begin(1)
        processes += more
        summary = desk.run(dask=address)
    finally:
        for process in processes:
            process.kill()
            process.wait()
    assert summary.by_status == {"doubtful": 12}
    assert [row["name"] for row in desk.rows()] == sorted(names)
    assert desk.visits().total() <= 12 + 1, "what was under way alone is done again"


def under_way(dask_scheduler: Any) -> list[str]:
    return [key for key, task in dask_scheduler.tasks.items() if task.state != "memory"]


def test_cancelled_by_somebody_else_nothing_is_lost(desk: Desk, cluster: Any) -> None:
    names = desk.fill(8)
    cancelled: list[str] = []

    def meddle() -> None:
        until(lambda: desk.visits().total() >= 2, 60)
        with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
            cancelled.extend(key for key in client.run_on_scheduler(under_way) if key.startswith("camssf-"))
            client.cancel([distributed.Future(key, client) for key in cancelled], force=True)

    other = threading.Thread(target=meddle)
    other.start()
    summary = desk.run(dask=cluster.scheduler_address, work=slow)
    other.join()
    assert cancelled
    assert summary.by_status == {"doubtful": 8}
    assert [row["name"] for row in desk.rows()] == sorted(names)


def test_the_poisonous_is_put_aside_after_two_deaths(desk: Desk, cluster: Any) -> None:
    desk.write([f"{name},{name},D55,,,,," for name in "abcxdef"], {n: f"Phone {n}" for n in "abcdef"} | {"x": "dies"})
    summary = desk.run(dask=cluster.scheduler_address)
    assert (summary.by_status["failed"], summary.total) == (1, 7)
    assert desk.tasks()["x"] == "failed"
    assert desk.visits()["x"] == pools.DEATHS
    assert len(desk.rows()) == 6
    again = desk.run(dask=cluster.scheduler_address)
    assert (again.resumed, desk.visits()["x"]) == (7, pools.DEATHS)


def lacks(*_: Any) -> None:
    raise ModuleNotFoundError("No module named 'camssf'", name="camssf")


@pytest.mark.parametrize(("name", "other", "words", "advice"), [
    ("__version__", "9.9.9", "A worker of the Dask cluster has camssf", "9.9.9"),
    ("do_job", lacks, "lacks camssf", "wheel"),
])  # fmt: skip
def test_a_worker_with_another_camssf_or_none_is_named(
    desk: Desk, cluster: Any, name: str, other: Any, words: str, advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.fill(1)
    monkeypatch.setattr(pools, name, other)
    with pytest.raises(InvalidArgument, match=words) as caught:
        desk.run(dask=cluster.scheduler_address)
    assert advice in caught.value.advice
    assert desk.visits() == {}


def test_nobody_answers(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "SCHEDULER_TIMEOUT", 1.0)
    desk.fill(1)
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        with pytest.raises(InvalidArgument, match="No Dask scheduler answers"):
            desk.run(dask=address)
    with (
        distributed.LocalCluster(n_workers=0, **QUIET) as empty,
        pytest.raises(InvalidArgument, match="has no worker"),
    ):
        desk.run(dask=empty.scheduler_address)


def test_without_the_library_it_says_what_to_install(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    desk.fill(1)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InvalidArgument, match="distributed") as caught:
        desk.run(dask="tcp://127.0.0.1:9")
    assert '".[dask]"' in caught.value.advice


@pytest.mark.parametrize("words", [["--workers", "tcp://127.0.0.1:9"], ["--workers", "0", "--registry", "r"]])
def test_calls_that_are_wrong(words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.csv").write_text("name,photo,lamp\na,x,D55\n")
    assert cli.main(["batch", "m.csv", *words]) == InvalidArgument.exit_status
    assert [path.name for path in tmp_path.iterdir()] == ["m.csv"]
