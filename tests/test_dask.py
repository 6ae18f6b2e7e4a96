"""A manifest over a Dask cluster: as over processes here, whoever dies, and whatever the cluster lacks."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from test_stream import Desk, slow, templates

from camssf import cli
from camssf.errors import InvalidArgument
from camssf.places import write_place
from camssf_fleet import pools
from camssf_fleet.manifest import Job, Manifest
from camssf_fleet.outcome import Outcome

pytest.importorskip("duckdb", reason="duckdb is not here")
distributed = pytest.importorskip("distributed", reason="distributed is not here")

__all__ = ["templates"]
pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(sys.platform == "win32", reason="signals differ there"),
    pytest.mark.filterwarnings("default"),  # of Dask and Tornado at their ends: not ours to mend
]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two workers; nannies begin a new one where one dies."""
    search = os.pathsep.join([*(str(Path(path).absolute()) for path in sys.path if path), str(Path(__file__).parent)])
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = search
    try:
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as found:
            yield found
    finally:
        os.environ.pop("PYTHONPATH") if before is None else os.environ.update(PYTHONPATH=before)


class Returned:
    """A future as a busy cluster gives it back: cancelled, lost, or with an answer that never arrives."""

    def __init__(self, status: str, answer: Any) -> None:
        self.status, self._answer = status, answer

    def result(self, timeout: float) -> Any:
        assert self.status != "lost", "result() would wait"
        if isinstance(self._answer, BaseException):
            raise self._answer
        return self._answer


class Client:
    """A cluster that drops each job so many times before it does it."""

    def __init__(self, drops: int, returned: tuple[str, Any], marks: Path) -> None:
        self.drops, self.returned, self.marks = drops, returned, marks
        self.handed_out: Counter[str] = Counter()
        self.cancelled: list[Any] = []

    def nthreads(self) -> dict[str, int]:
        return {"w": 1}

    def as_current(self) -> Any:
        return nullcontext()

    def cancel(self, futures: list[Any], force: bool) -> None:
        self.cancelled += futures

    def submit(self, work: Any, job: Job, key: str, pure: bool) -> Returned:
        self.handed_out[job.name] += 1
        if self.handed_out[job.name] <= self.drops:
            write_place(self.marks / job.task / "begun", b"")  # by a worker
            return Returned(*self.returned)
        return Returned("finished", work(job))


def done_at_once(job: Job) -> Outcome:
    return Outcome(job.name, "accepted", reason=job.name)


DROPS = {
    "cancelled": ("cancelled", CancelledError("key")),
    "lost": ("lost", None),
    "no answer": ("finished", TimeoutError()),
    "cancelled while asked": ("finished", CancelledError("key")),
}


def hand_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drops: int, returned: tuple[str, Any]) -> Any:
    def wait(futures: list[Any], **_: Any) -> None:
        if any(future.status == "cancelled" for future in futures):
            raise CancelledError("as distributed.wait does")

    class Ends:
        def add(self, job: Job, outcome: Outcome) -> None:
            ends.append((job.name, outcome.status, outcome.reason, outcome.deaths))

        def update(self) -> None:
            pass

    monkeypatch.setattr(distributed, "wait", wait)
    (tmp_path / "m.csv").write_text("name,photo,lamp\na,x,D55\nb,y,D55\n")
    first, *rest = (replace(job, task=job.name) for job in Manifest(tmp_path / "m.csv"))
    client = Client(drops, returned, tmp_path)
    ends: list[Any] = []
    pools._hand_out(client, (first, iter(rest)), done_at_once, tmp_path, Ends())
    return client, sorted(ends)


@pytest.mark.parametrize("drop", DROPS)
@pytest.mark.parametrize("drops", [1, pools.RESUBMISSIONS])
def test_what_a_busy_cluster_drops_is_handed_out_again(
    drop: str, drops: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    client, ends = hand_out(tmp_path, monkeypatch, drops, DROPS[drop])
    assert ends == [("a", "accepted", "a", 0), ("b", "accepted", "b", 0)]
    assert client.handed_out == {"a": drops + 1, "b": drops + 1}
    assert len(client.cancelled) == 2 * drops


@pytest.mark.parametrize("drop", DROPS)
def test_not_for_ever(drop: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is no job's fault: the next run tries it again."""
    client, ends = hand_out(tmp_path, monkeypatch, 10**6, DROPS[drop])
    assert client.handed_out == {"a": pools.RESUBMISSIONS + 1, "b": pools.RESUBMISSIONS + 1}
    words = f"The Dask cluster lost it {pools.RESUBMISSIONS + 1} times. Run the same command again to do it."
    assert ends == [("a", "failed", words, 0), ("b", "failed", words, 0)]


def test_a_cluster_that_lost_all_workers_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pools, "WORKERLESS_TIMEOUT", 0.0)
    monkeypatch.setattr(Client, "nthreads", lambda self: {})
    with pytest.raises(InvalidArgument, match="has had no worker for 0 s"):
        hand_out(tmp_path, monkeypatch, 1, DROPS["lost"])


def test_a_client_that_closed_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def closed(*_: Any, **__: Any) -> None:
        raise distributed.client.ClosedClientError("Can't perform action on a closed client")

    monkeypatch.setattr(Client, "submit", closed)
    with pytest.raises(InvalidArgument, match="The Dask cluster was lost") as caught:
        hand_out(tmp_path, monkeypatch, 0, DROPS["lost"])
    assert "the same command" in caught.value.advice


@pytest.fixture
def desk(tmp_path: Path, templates: dict[str, str]) -> Desk:
    return Desk(tmp_path, templates)


def test_it_does_what_processes_here_do(desk: Desk, cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative paths, too: the workers stand elsewhere. The other way of working then resumes it."""
    monkeypatch.chdir(desk.home)
    desk.home = Path()
    desk.write(
        ["good,a,D55,,,,S1,lab", "bug,b,D55,,,,,", "wrong,w,D55,,,,,", "again,a2,D55,,,,S1,lab", "fault,,D55,,,,,"],
        {"a": "Phone", "b": "bug", "w": "wrong", "a2": "Phone"},
    )
    found = desk.run(dask=cluster.scheduler_address)
    assert desk.tasks() == {
        "good": "doubtful", "bug": "failed", "wrong": "refused", "again": "doubtful", "fault": "refused",
    }  # fmt: skip
    assert found.total == 5
    assert len(desk.rows()) == 1
    assert not list(Path("out").glob(".camssf-begun*"))
    again = desk.run(workers=1)
    assert (again.resumed, again.by_status) == (2, found.by_status)


def test_a_worker_s_death_loses_nothing(desk: Desk, cluster: Any) -> None:
    names = [f"c{i}" for i in range(16)]
    desk.write([f"{n},{n},D55,,,,," for n in names], {n: f"Phone {n}" for n in names})
    victims: list[int] = []

    def kill() -> None:
        deadline = time.monotonic() + 60
        while sum(desk.visits().values()) < 4 and time.monotonic() < deadline:
            time.sleep(0.05)
        with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
            victims.extend(list(client.run(os.getpid).values())[:1])
        os.kill(victims[0], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    found = desk.run(dask=cluster.scheduler_address, work=slow)
    killer.join()
    assert victims
    assert found.by_status == {"doubtful": 16}
    assert [each["name"] for each in desk.rows()] == sorted(names)  # nothing lost, nothing twice
    visits = desk.visits()
    assert max(visits.values()) <= 2
    assert sum(visits.values()) <= 17  # what was under way alone is done again


def test_a_scheduler_that_is_lost_is_told_and_the_next_goes_on(
    desk: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scheduler is killed in the middle; another one, with another address, does the rest."""
    monkeypatch.setattr(pools, "WORKERLESS_TIMEOUT", 10.0)
    names = [f"c{i}" for i in range(12)]
    desk.write([f"{n},{n},D55,,,,," for n in names], {n: f"Phone {n}" for n in names})
    search = os.pathsep.join([*(str(Path(path).absolute()) for path in sys.path if path), str(Path(__file__).parent)])

    def begin(number: int) -> tuple[str, subprocess.Popen[bytes], list[subprocess.Popen[bytes]]]:
        file = tmp_path / f"scheduler-{number}.json"
        quiet: dict[str, Any] = dict.fromkeys(("stdout", "stderr"), subprocess.DEVNULL)
        quiet["env"] = os.environ | {"PYTHONPATH": search}
        run = [sys.executable, "-m", "dask"]
        place = ["--scheduler-file", str(file), "--no-dashboard"]
        scheduler = subprocess.Popen([*run, "scheduler", "--port", "0", "--host", "127.0.0.1", *place], **quiet)
        worker = subprocess.Popen([*run, "worker", *place, "--nthreads", "1", "--no-nanny"], **quiet)
        deadline = time.monotonic() + 60
        while not file.exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        return json.loads(file.read_text())["address"], scheduler, [scheduler, worker]

    address, scheduler, processes = begin(0)

    def kill() -> None:
        deadline = time.monotonic() + 60
        while sum(desk.visits().values()) < 4 and time.monotonic() < deadline:
            time.sleep(0.05)
        scheduler.kill()

    killer = threading.Thread(target=kill)
    try:
        killer.start()
        with pytest.raises(InvalidArgument, match=r"Dask cluster (was lost|has had no worker)") as caught:
            desk.run(dask=address, work=slow)
        assert "the same command" in caught.value.advice
        killer.join()
        before = sum(desk.visits().values())
        assert 4 <= before < 12
        address, _, more = begin(1)
        processes += more
        found = desk.run(dask=address)
    finally:
        for process in processes:
            process.kill()
            process.wait()
    assert found.by_status == {"doubtful": 12}
    assert [each["name"] for each in desk.rows()] == sorted(names)
    assert sum(desk.visits().values()) <= 12 + 1, "what was under way alone is done again"


def under_way(dask_scheduler: Any) -> list[str]:
    return [key for key, task in dask_scheduler.tasks.items() if task.state != "memory"]


def test_cancelled_by_somebody_else_nothing_is_lost(desk: Desk, cluster: Any) -> None:
    names = [f"c{i}" for i in range(8)]
    desk.write([f"{n},{n},D55,,,,," for n in names], {n: f"Phone {n}" for n in names})
    cancelled: list[str] = []

    def meddle() -> None:
        deadline = time.monotonic() + 60
        while sum(desk.visits().values()) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
        with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
            cancelled.extend(key for key in client.run_on_scheduler(under_way) if key.startswith("camssf-"))
            client.cancel([distributed.Future(key, client) for key in cancelled], force=True)

    other = threading.Thread(target=meddle)
    other.start()
    found = desk.run(dask=cluster.scheduler_address, work=slow)
    other.join()
    assert cancelled
    assert found.by_status == {"doubtful": 8}
    assert [each["name"] for each in desk.rows()] == sorted(names)


def test_the_poisonous_is_put_aside_after_two_deaths(desk: Desk, cluster: Any) -> None:
    desk.write([f"{name},{name},D55,,,,," for name in "abcxdef"], {n: f"Phone {n}" for n in "abcdef"} | {"x": "dies"})
    found = desk.run(dask=cluster.scheduler_address)
    assert (found.by_status["failed"], found.total) == (1, 7)
    assert desk.tasks()["x"] == "failed"
    assert desk.visits()["x"] == pools.DEATHS
    assert len(desk.rows()) == 6
    again = desk.run(dask=cluster.scheduler_address)
    assert (again.resumed, desk.visits()["x"]) == (7, pools.DEATHS)


def test_another_version_on_the_worker_is_refused(desk: Desk, cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    desk.write(["one,a,D55,,,,,"], {"a": "Phone"})
    monkeypatch.setattr(pools, "__version__", "9.9.9")
    with pytest.raises(InvalidArgument, match="A worker of the Dask cluster has camssf") as caught:
        desk.run(dask=cluster.scheduler_address)
    assert "9.9.9" in caught.value.advice
    assert desk.visits() == {}


def test_a_worker_without_camssf_is_named(desk: Desk, cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def lacks(job: Job, *, work: Any, marks: Path, version: str) -> None:
        raise ModuleNotFoundError("No module named 'camssf'", name="camssf")

    desk.write(["one,a,D55,,,,,"], {"a": "Phone"})
    monkeypatch.setattr(pools, "_marked", lacks)
    with pytest.raises(InvalidArgument, match="lacks camssf") as caught:
        desk.run(dask=cluster.scheduler_address)
    assert "wheel" in caught.value.advice


def test_nobody_answers(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pools, "SCHEDULER_TIMEOUT", 1.0)
    desk.write(["one,a,D55,,,,,"], {"a": "Phone"})
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        with pytest.raises(InvalidArgument, match="No Dask scheduler answers"):
            desk.run(dask=address)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=None, silence_logs=50) as empty,
        pytest.raises(InvalidArgument, match="has no worker"),
    ):
        desk.run(dask=empty.scheduler_address)


def test_without_the_library_it_says_what_to_install(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    desk.write(["one,a,D55,,,,,"], {"a": "Phone"})
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InvalidArgument, match="distributed") as caught:
        desk.run(dask="tcp://127.0.0.1:9")
    assert '".[dask]"' in caught.value.advice


@pytest.mark.parametrize(
    "words",
    [
        ["--workers", "tcp://127.0.0.1:9"],
        ["--workers", "0", "--registry", "r"],
    ],
)
def test_calls_that_are_wrong(words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.csv").write_text("name,photo,lamp\na,x,D55\n")
    assert cli.main(["batch", "m.csv", *words]) == InvalidArgument.exit_status
    assert [path.name for path in tmp_path.iterdir()] == ["m.csv"]
