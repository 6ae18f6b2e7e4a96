"""What does a batch cost beside the same solves in one process?

Processor time of so many real captures (simulated DNG files, 900 × 675, chart alone) by `camssf batch --registry` on
local processes, and over a LocalCluster of two workers, against that of one process that solves them; in turns, the
order changing. That nothing is lost or done twice where a process, a worker or a scheduler dies is tested in
tests/fleet.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.claim import Run

OPTIONS = {"captures": (64, "of each batch"), "turns": (3, "of all ways")}
BARS = {"batch": 1.15, "dask": 1.3}
PLAIN = """
import sys
from pathlib import Path
from camssf_fleet.batch import calibrate_into
from camssf_fleet.manifest import Manifest
jobs = list(Manifest(sys.argv[1]))
print(sum(calibrate_into(job, Path(sys.argv[2]) / job.name, pages=False).ok for job in jobs))
"""


@dataclass(frozen=True)
class Batch:
    """Wall seconds, processor seconds of it and its workers, captures with curves."""

    wall: float
    processor: float
    done: int


def shoot(home: Path, count: int) -> Path:
    """So many captures that differ: one DNG, each copy with some bytes of its own behind its end."""
    from camssf_lab.simulation.frames import simulate
    from camssf_lab.simulation.scene import Scene

    shot = simulate("Nikon 5100 (NPL)", ["D55"], home / "one", scene=Scene(size=(900, 675)), seed=1).shots[0]
    data = Path(shot.chart).read_bytes()
    for number in range(count):
        (home / f"{number}.dng").write_bytes(data + f"copy {number:08d}".encode())
    manifest = home / "manifest.csv"
    manifest.write_text("name,photo,lamp\n" + "".join(f"c{n},{n}.dng,D55\n" for n in range(count)), "utf-8")
    return manifest


def timed(command: Sequence[str]) -> tuple[float, float, bytes]:
    """Wall and processor seconds of a process and its children with one BLAS thread each, and what it printed."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    single = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False, env=single)
    wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def batch(manifest: Path, to: Path, *words: str) -> Batch:
    """`camssf batch` in a process of its own."""
    command = [sys.executable, "-m", "camssf", "batch", str(manifest), "-o", str(to / "archive"), "--registry"]
    wall, processor, printed = timed([*command, str(to / "registry"), *words])
    counts = json.loads(printed)
    statuses = counts["by_status"]
    return Batch(wall, processor, counts["total"] - statuses.get("failed", 0) - statuses.get("refused", 0))


def plain(manifest: Path, to: Path) -> Batch:
    """The same captures in one process, each into a folder of its own."""
    wall, processor, printed = timed([sys.executable, "-c", PLAIN, str(manifest), str(to)])
    return Batch(wall, processor, int(printed))


def clustered(manifest: Path, to: Path, cluster: Any) -> Batch:
    """`camssf batch` on a cluster whose scheduler runs in this process; the processor time is all of theirs."""
    import distributed
    import psutil

    with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
        workers = [psutil.Process(pid) for pid in client.run(os.getpid).values()]

    def used() -> float:
        times = [worker.cpu_times() for worker in workers]
        return time.process_time() + sum(one.user + one.system for one in times)

    before = used()
    run = batch(manifest, to, "--workers", cluster.scheduler_address)
    return replace(run, processor=run.processor + used() - before)


def claim(run: Run) -> None:
    """A row a way."""
    import distributed

    captures, turns = run.options.captures, run.options.turns
    done: dict[str, list[Batch]] = {"plain": [], "batch": [], "dask": []}
    with (
        tempfile.TemporaryDirectory() as place,
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as cluster,
    ):
        home = Path(place)
        manifest = shoot(home, captures)
        ways: dict[str, Callable[[Path], Batch]] = {
            "plain": lambda to: plain(manifest, to),
            "batch": lambda to: batch(manifest, to),
            "dask": lambda to: clustered(manifest, to, cluster),
        }
        for turn in run.track(range(turns), "turns"):
            for name in list(ways)[:: 1 if turn % 2 == 0 else -1]:
                to = home / f"{name}-{turn}"
                to.mkdir()
                done[name].append(ways[name](to))
                shutil.rmtree(to)
    assert all(one.done == captures for own in done.values() for one in own)
    ratios = {
        name: np.median([one.processor / alone.processor for one, alone in zip(own, done["plain"], strict=True)])
        for name, own in done.items()
    }
    columns = {"way": ""} | dict.fromkeys(
        ("s a capture", "processor s a capture", "processor time over plain"), ".2f"
    )
    rows = [
        (name, np.median([one.wall for one in own]) / captures, np.median([one.processor for one in own]) / captures,
         ratios[name])
        for name, own in done.items()
    ]  # fmt: skip
    run.table(f"{captures} captures, medians of {turns} turns", columns, rows)
    for name, most in BARS.items():
        run.bar(f"{name} over plain, processor time, median", ratios[name], most=most)
