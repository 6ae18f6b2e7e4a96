"""A manifest over a Dask cluster: as over processes here, whoever dies, and whatever the cluster lacks."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from camssf.errors import InvalidArgument
from camssf_fleet import cluster as cluster_module
from camssf_fleet import pools
from tests.support.desk import Desk, slow
from tests.support.failures import raising
from tests.support.processes import SEARCH, until

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
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PYTHONPATH", SEARCH)
        with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **QUIET) as started:
            yield started


def test_a_cluster_that_lost_all_workers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "WORKERLESS_TIMEOUT", 0.0)
    client: Any = SimpleNamespace(nthreads=dict)
    with pytest.raises(InvalidArgument, match="has had no worker for 0 s"):
        cluster_module._workers(client, [time.monotonic() - 1.0])


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
    monkeypatch.setattr(cluster_module, "SCHEDULER_TIMEOUT", 15.0)  # so long a client looks for a lost one
    names = desk.fill(12)
    processes: list[subprocess.Popen[bytes]] = []
    environment = os.environ | {"PYTHONPATH": SEARCH}

    def begin(number: int) -> str:
        """The address of a new scheduler with a worker."""
        file = tmp_path / f"scheduler-{number}.json"
        how: Any = dict.fromkeys(("stdout", "stderr"), subprocess.DEVNULL) | {"env": environment}
        for words in ("scheduler --port 0 --host 127.0.0.1", "worker --nthreads 1 --no-nanny"):
            line = [sys.executable, "-m", "dask", *words.split(), "--scheduler-file", str(file), "--no-dashboard"]
            processes.append(subprocess.Popen(line, **how))
        until(file.exists)
        return str(json.loads(file.read_text())["address"])

    def kill() -> None:
        until(lambda: desk.visits().total() >= 4)
        processes[0].kill()

    killer = threading.Thread(target=kill)
    try:
        address = begin(0)
        killer.start()
        with pytest.raises(InvalidArgument, match=r"Dask cluster (was lost|has had no worker)") as caught:
            desk.run(dask=address, work=slow)
        assert "the same command" in caught.value.advice
        killer.join()
        before = desk.visits().total()
        assert 4 <= before < 12
        summary = desk.run(dask=begin(1))
    finally:
        for process in processes:
            process.kill()
            process.wait()
    assert summary.by_status == {"doubtful": 12}
    assert [row["name"] for row in desk.rows()] == sorted(names)
    assert desk.visits().total() <= 12 + 1, "what was under way alone is done again"


LACKS = ModuleNotFoundError("No module named 'camssf'", name="camssf")


@pytest.mark.parametrize(("name", "other", "words", "advice"), [
    ("__version__", "9.9.9", "A worker of the Dask cluster has camssf", "9.9.9"),
    ("do_job", raising(LACKS), "lacks camssf", "wheel"),
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
    with distributed.LocalCluster(n_workers=0, **QUIET) as empty:
        for address in ("tcp://127.0.0.1:9", "nonsense://x", empty.scheduler_address):
            words = "has no worker" if address == empty.scheduler_address else "No Dask scheduler answers"
            with pytest.raises(InvalidArgument, match=words):
                desk.run(dask=address)


def test_the_poisonous_is_put_aside_after_two_deaths(desk: Desk, cluster: Any) -> None:
    desk.write([f"{name},{name},D55,,,,," for name in "abcxdef"], {n: f"Phone {n}" for n in "abcdef"} | {"x": "dies"})
    summary = desk.run(dask=cluster.scheduler_address)
    assert (summary.by_status["failed"], summary.total) == (1, 7)
    assert desk.tasks()["x"] == "failed"
    assert desk.visits()["x"] == pools.DEATHS
    assert len(desk.rows()) == 6
    again = desk.run(dask=cluster.scheduler_address)
    assert (again.resumed, desk.visits()["x"]) == (7, pools.DEATHS)
