"""A manifest over a Dask cluster: as over processes here, whoever dies, and whatever the cluster lacks."""

import json
import os
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
    assert (summary.total, len(desk.rows())) == (5, 1)
    assert not list(Path("out").glob(".camssf-begun*"))
    again = desk.run(workers=1)
    assert (again.resumed, again.by_status) == (2, summary.by_status)


def test_after_a_lost_scheduler_the_same_command_does_the_rest(
    desk: Desk, cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is killed in the middle; another one, with another address, goes on."""
    monkeypatch.setattr(cluster_module, "SCHEDULER_TIMEOUT", 15.0)  # so long a client looks for a lost one
    names, file, processes = desk.fill(12), tmp_path / "scheduler.json", list[subprocess.Popen[bytes]]()
    how: Any = dict.fromkeys(("stdout", "stderr"), subprocess.DEVNULL) | {"env": os.environ | {"PYTHONPATH": SEARCH}}

    def kill() -> None:
        until(lambda: desk.visits().total() >= 4)
        processes[0].kill()

    killer = threading.Thread(target=kill)
    try:
        for words in ("scheduler --port 0 --host 127.0.0.1", "worker --nthreads 1 --no-nanny"):
            call = [sys.executable, "-m", "dask", *words.split(), "--scheduler-file", str(file), "--no-dashboard"]
            processes.append(subprocess.Popen(call, **how))
        until(file.exists)
        killer.start()
        with pytest.raises(InvalidArgument, match=r"Dask cluster (was lost|has had no worker)") as caught:
            desk.run(dask=json.loads(file.read_text())["address"], work=slow)
        killer.join()
    finally:
        for process in processes:
            process.kill()
            process.wait()
    assert "the same command" in caught.value.advice
    assert 4 <= desk.visits().total() < 12
    assert desk.run(dask=cluster.scheduler_address).by_status == {"doubtful": 12}
    assert [row["name"] for row in desk.rows()] == sorted(names)
    assert desk.visits().total() <= 12 + 1, "what was under way alone is done again"


@pytest.mark.parametrize(("name", "other", "words", "advice"), [
    ("__version__", "9.9.9", "A worker of the Dask cluster has camssf", "9.9.9"),
    ("do_job", raising(ModuleNotFoundError("No module", name="camssf")), "lacks camssf", "wheel"),
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


def test_the_poisonous_is_put_aside_after_two_deaths_and_the_rest_is_done(desk: Desk, cluster: Any) -> None:
    others = "abcdef"
    desk.write([f"{name},{name},D55,,,,," for name in "abcxdef"], {n: f"Phone {n}" for n in others} | {"x": "dies"})
    summary = desk.run(dask=cluster.scheduler_address)
    assert summary.by_status == {"doubtful": 6, "failed": 1}
    assert (desk.tasks()["x"], desk.visits()["x"]) == ("failed", pools.DEATHS)
    assert [row["name"] for row in desk.rows()] == sorted(others)  # nothing lost, nothing twice
    assert sum(desk.visits()[name] for name in others) <= len(others) + pools.DEATHS
    again = desk.run(dask=cluster.scheduler_address)
    assert (again.resumed, desk.visits()["x"]) == (7, pools.DEATHS)
