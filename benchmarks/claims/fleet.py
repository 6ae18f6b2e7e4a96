"""Does the fleet hold its bars? `python -m benchmarks.claims.fleet [--captures 60] [--pairs 3] [--only NAME]`

- manifest: a million rows. From the process's start to its first job, and the memory after the last, without work.
- resume: a thousand done captures, `camssf batch` once more: from the command's start to its end.
- waits: jobs that take half a second of nobody's processor, with one process and with two: what handing out costs.
- workers: so many real captures (simulated DNG files, 900 × 675, chart alone) with one process and with two, in
  pairs, the order changing. The machine may be shared: beside the times stands how much processor time a capture
  took, which others' work changes less, and how much of the processors each run got.
- dask: the same captures over a LocalCluster of two workers and by `--workers 2`, in pairs; then once with a worker
  killed in the middle: nothing lost, nothing twice.
- stubs: so many jobs whose work is to write a result, with two processes; the run is killed five times at random
  times and taken up again. Nothing may be missing or doubled.
- overhead: processor time of the same captures by `camssf batch --registry` and over a LocalCluster of two workers,
  against that of one process that solves them.
- cost: processor seconds of a capture of 12 megapixels, from which that of a million follows.

Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.claims.registry import made
from benchmarks.shared import command_parser, console, save, table, versions
from camssf.files import write_file
from camssf_fleet.archive import task_of
from camssf_fleet.batch import calibrate_into, run_batch
from camssf_fleet.manifest import Job, Manifest
from camssf_fleet.outcome import Outcome
from camssf_fleet.records import JobEnd
from camssf_fleet.registry import Registry
from camssf_fleet.verification import verify

START, MEMORY, RESUME, TWO, DASK = 2.0, 300e6, 5.0, 1.8, 1.15
OVERHEAD, DASK_OVERHEAD = 1.15, 1.3
WAIT = 0.5
"""Seconds that a job of `handed_out` takes: a capture's."""
HEADER = "name,photo,lamp\n"
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Run:
    """One batch: wall seconds, processor seconds of it and its workers, captures with curves."""

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
    manifest.write_text(HEADER + "".join(f"c{n},{n}.dng,D55\n" for n in range(count)), "utf-8")
    return manifest


def timed(command: Sequence[str]) -> tuple[float, float, bytes]:
    """Wall and processor seconds of a process and its children with one BLAS thread each, and what it printed."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    single = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False, env=single)
    wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def batch(manifest: Path, to: Path, *words: str) -> Run:
    """`camssf batch` in a process of its own."""
    command = [sys.executable, "-m", "camssf", "batch", str(manifest), "-o", str(to / "archive"), "--registry"]
    wall, processor, printed = timed([*command, str(to / "registry"), *words])
    counts = json.loads(printed)
    statuses = counts["by_status"]
    return Run(wall, processor, counts["total"] - statuses.get("failed", 0) - statuses.get("refused", 0))


def plain(manifest: Path, to: Path) -> Run:
    """The same captures in one process, each into a folder of its own."""
    code = (
        "import sys\nfrom pathlib import Path\nfrom camssf_fleet.batch import calibrate_into\n"
        "from camssf_fleet.manifest import Manifest\n"
        "jobs = list(Manifest(sys.argv[1]))\n"
        "print(sum(calibrate_into(job, Path(sys.argv[2]) / job.name, pages=False).ok for job in jobs))"
    )
    wall, processor, printed = timed([sys.executable, "-c", code, str(manifest), str(to)])
    return Run(wall, processor, int(printed))


def clustered(manifest: Path, to: Path, cluster: Any) -> Run:
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


def million(home: Path, rows: int) -> dict[str, float]:
    """Seconds to the first job, seconds and bytes to the last, of a process that does nothing with them."""
    manifest = home / "million.csv"
    with open(manifest, "w", encoding="utf-8") as file:
        file.write(HEADER)
        file.writelines(f"phone {i},photos/{i}.dng,D55\n" for i in range(rows))
    code = (
        "import json, resource, sys, time\nfrom pathlib import Path\nbegun = float(sys.argv[2])\n"
        "from camssf_fleet.manifest import Manifest\nfrom camssf_fleet.registry import Registry\n"
        "from camssf_fleet.archive import Archive, unfinished\nfrom camssf_fleet.outcome import Summary\n"
        "rows, registry = Manifest(sys.argv[1]), Registry(sys.argv[1] + '.registry', new=True)\n"
        "jobs = unfinished(rows, registry, Summary(), Archive(Path('archive'), registry.folder))\n"
        "next(jobs); first, work = time.time() - begun, time.process_time()\ncount = 1 + sum(1 for _ in jobs)\n"
        "held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "held *= 1 if sys.platform == 'darwin' else 1024\n"
        "print(json.dumps([first, work, time.time() - begun, time.process_time(), count, held]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(manifest), str(time.time())], capture_output=True, text=True, check=True
    )
    *found, count, held = json.loads(done.stdout)
    assert count == rows
    return dict(zip(("first", "first_processor", "last", "last_processor"), found, strict=True)) | {"bytes": held}


def resumed(home: Path, count: int) -> dict[str, float]:
    """Seconds of a run whose captures are all done: its photos are there, and the registry knows its tasks."""
    folder = home / "resume"
    folder.mkdir()
    for number in range(count):
        (folder / f"{number}.dng").write_text(str(number))
    manifest = folder / "manifest.csv"
    manifest.write_text(HEADER + "".join(f"c{n},{n}.dng,D55\n" for n in range(count)), "utf-8")
    now = datetime(2026, 1, 1)
    done = [
        JobEnd(task_of(job, None), "", f"{n:064x}", now, job.name, "accepted", "", "", f"{n:064x}")
        for n, job in enumerate(Manifest(manifest))
    ]
    registry = Registry(folder / "registry", new=True)
    registry.append([made(n) for n in range(count)], done)
    registry.list_records()
    for task in done:
        place = folder / "archive" / task.made_from[:2] / task.made_from
        place.mkdir(parents=True)
        (place / "result.json").touch()
    runs = [batch(manifest, folder) for _ in range(3)]
    assert all(run.done == count for run in runs)
    return {"seconds": min(run.wall for run in runs), "processor": min(run.processor for run in runs)}


def pairs(home: Path, count: int, ways: Sequence[tuple[str, Callable[[Path], Run]]]) -> dict[str, list[Run]]:
    """Each way so often, the order changing; every run into folders of its own."""
    found: dict[str, list[Run]] = {name: [] for name, _ in ways}
    for number in range(count):
        for name, run in ways if number % 2 == 0 else ways[::-1]:
            to = home / f"{name}-{number}"
            to.mkdir()
            found[name].append(run(to))
            shutil.rmtree(to)
    return found


def wait(job: Job, folder: Path) -> Outcome:
    """In place of the calibration: as long as one, on nobody's processor."""
    time.sleep(WAIT)
    return Outcome(job.name, "refused")


def handed_out(home: Path, count: int, workers: int) -> float:
    """Jobs a second from the first one's end to the last's, where a job is a wait: what handing them out costs."""
    folder = home / f"waits-{workers}"
    folder.mkdir()
    manifest = folder / "manifest.csv"
    manifest.write_text(HEADER + "".join(f"c{n},{n}.dng,D55\n" for n in range(count)), "utf-8")
    for number in range(count):
        (folder / f"{number}.dng").write_text(str(number))
    found: list[tuple[int, float]] = []

    def tell(words: str, part: float) -> None:
        found.append((int(words.split()[0]), time.perf_counter()))

    registry = Registry(folder / "registry", new=True)
    run_batch(Manifest(manifest), folder / "out", registry, workers=workers, work=wait, progress=tell)
    (first, begun), (last, ended) = next(each for each in found if each[0]), found[-1]
    return (last - first) / (ended - begun)


def cost(home: Path) -> dict[str, float]:
    """Of a 12-megapixel capture: processor seconds once all is loaded, bytes of its result and of its row."""
    from camssf_lab.simulation.frames import simulate
    from camssf_lab.simulation.scene import Scene

    shot = simulate("Nikon 5100 (NPL)", ["D55"], home / "large", scene=Scene(size=(4000, 3000)), seed=1).shots[0]
    manifest, found = home / "large.csv", []
    manifest.write_text(HEADER + f"large,{shot.chart},D55\n", "utf-8")
    (job,) = Manifest(manifest)
    for number in range(4):  # the first loads the libraries
        begun = time.process_time()
        one = calibrate_into(job, home / f"large-{number}", pages=False).row
        found.append(time.process_time() - begun)
    result = (home / "large-0" / "result.json").read_bytes()
    assert one is not None
    registry = Registry(home / "large-registry", new=True)
    registry.add([replace(one, key=f"{number:064x}") for number in range(1000)])
    held = sum(path.stat().st_size for path in registry.folder.rglob("*.parquet"))
    return {"processor": float(np.median(found[1:])), "result": len(result), "row": held / 1000}


def stub(job: Job, folder: Path) -> Outcome:
    """In place of the calibration: a result of its own for each photo."""
    photo = Path(job.photos[0])
    document = json.loads((photo.parent / "template.json").read_bytes())
    document["capture"]["shots"][0]["photo"]["model"] = f"Model {int(photo.stem) % 50}"
    document["answer"]["evidence"] = float(photo.stem)
    document.pop("sha256", None)
    folder.mkdir(parents=True, exist_ok=True)
    write_file(folder / "result.json", json.dumps(document))
    return Outcome(job.name, "accepted")


def stubbed(folder: Path) -> None:
    """Run the batch of stubs, in a process of its own."""
    found = run_batch(
        Manifest(folder / "manifest.csv"),
        folder / "out",
        Registry(folder / "registry", new=True),
        workers=2,
        work=stub,
    )
    print(json.dumps(found.document()))


def stubs(home: Path, count: int, kills: int) -> dict[str, float]:
    """Captures missing and doubled after a run of stubs that was killed so often, and the seconds of all runs."""
    from benchmarks.claims import fleet
    from camssf.calibration import calibrate
    from camssf.documents.document import document_bytes
    from camssf.options import Options
    from camssf.photo.shot import Shot

    folder = home / "stubs"
    (folder / "photos").mkdir(parents=True)
    shoot(folder, 1)
    found = calibrate(Shot(str(folder / "0.dng"), "D55"), options=Options(basis="cameras"))
    template = document_bytes(found)
    (folder / "photos" / "template.json").write_bytes(template)
    for number in range(count):
        (folder / "photos" / f"{number}.dng").write_text(str(number))
    rows = "".join(f"c{n},photos/{n}.dng,D55\n" for n in range(count))
    (folder / "manifest.csv").write_text(HEADER + rows, "utf-8")
    dice, begun, killed = random.Random(0), time.perf_counter(), 0
    code = f"from pathlib import Path\nfrom {fleet.__name__} import stubbed\n"
    code += f"if __name__ == '__main__': stubbed(Path({str(folder)!r}))"
    (folder / "run.py").write_text(code)
    command, quiet = [sys.executable, str(folder / "run.py")], dict.fromkeys(("stdout", "stderr"), subprocess.DEVNULL)
    search = os.environ | {"PYTHONPATH": str(ROOT)}
    for _ in range(kills):
        with subprocess.Popen(command, env=search, **quiet) as run:
            time.sleep(dice.uniform(10, 40))
            killed += run.poll() is None
            run.kill()
    done = subprocess.run(command, env=search, check=True, capture_output=True, text=True)
    seconds, report = time.perf_counter() - begun, json.loads(done.stdout)
    registry = Registry(folder / "registry")
    names = [each["name"] for each in registry.query("SELECT name FROM rows")]
    return {
        "seconds": seconds, "killed": killed, "resumed": report["resumed"], "missing": count - len(set(names)),
        "doubled": len(names) - len(set(names)), "faults": len(verify(registry).faults),
    }  # fmt: skip


def local(manifest: Path, workers: int) -> Callable[[Path], Run]:
    return lambda to: batch(manifest, to, "--workers", str(workers))


def killed(manifest: Path, to: Path, cluster: Any, captures: int) -> dict[str, int]:
    """A worker is killed when a third is done."""
    import distributed

    def kill() -> None:
        while len(list((to / "archive").glob("*/*/result.json"))) < captures // 3:
            time.sleep(0.1)
        with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
            victim = next(iter(client.run(os.getpid).values()))
        os.kill(victim, signal.SIGKILL)

    to.mkdir()
    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    batch(manifest, to, "--workers", cluster.scheduler_address)
    killer.join(timeout=10)
    names = [each["name"] for each in Registry(to / "registry").query("SELECT name FROM rows")]
    return {
        "killed": int(not killer.is_alive()),
        "missing": captures - len(set(names)),
        "doubled": len(names) - len(set(names)),
    }


def _words(runs: Sequence[Run], captures: int, processes: int) -> list[str]:
    walls = [run.wall for run in runs]
    share = np.mean([run.processor / run.wall for run in runs]) / processes
    cost = np.mean([run.processor for run in runs]) / captures
    return [f"{min(walls):.1f} to {max(walls):.1f}", f"{cost:.2f}", f"{share:.0%}"]


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--rows", type=int, default=1_000_000, help="of the manifest")
    parser.add_argument("--done", type=int, default=1000, help="captures of the resumed run")
    parser.add_argument("--captures", type=int, default=60, help="real ones of each run")
    parser.add_argument("--pairs", type=int, default=3)
    parser.add_argument("--stubs", type=int, default=10_000, help="jobs that only write a result")
    parser.add_argument(
        "--only", choices=("manifest", "resume", "cost", "waits", "stubs", "workers", "overhead", "dask")
    )
    options = parser.parse_args(arguments)
    out, document, missed = console(), {}, []

    def bar(name: str, value: float, limit: float, *, least: bool = False) -> None:
        held = value >= limit if least else value <= limit
        document.setdefault("bars", {})[name] = {"value": value, "limit": limit, "held": held}
        out.print(
            f"{'held' if held else 'MISSED'}: {name}: {value:.3g}, {'at least' if least else 'at most'} {limit:g}"
        )
        if not held:
            missed.append(name)

    with tempfile.TemporaryDirectory() as place:
        home = Path(place)
        if options.only in (None, "manifest"):
            document["manifest"] = found = million(home, options.rows)
            bar(f"{options.rows} rows: seconds to the first job", found["first"], START)
            bar(f"{options.rows} rows: MB after the last", found["bytes"] / 1e6, MEMORY / 1e6)
            words = "; ".join(
                f"{word}: {found[word]:.1f} s, {found[word + '_processor']:.1f} of a processor"
                for word in ("first", "last")
            )
            out.print(words)
        if options.only in (None, "resume"):
            document["resume"] = found = resumed(home, options.done)
            bar(f"{options.done} done captures: seconds of a resumed run", found["seconds"], RESUME)
            out.print(f"of them {found['processor']:.1f} s of a processor")
        if options.only in (None, "cost"):
            document["cost"] = found = cost(home)
            days = found["processor"] * 1e6 / 86400
            out.print(
                f"12 megapixels: {found['processor']:.2f} s of a processor, so a million are {days:.1f} days of one; "
                f"result.json {found['result'] / 1e3:.0f} kB"
            )
        if options.only in (None, "waits"):
            one, two = (handed_out(home, options.done // 8, workers) for workers in (1, 2))
            document["waits"] = {"one": one, "two": two, "ratio": two / one}
            out.print(f"waits of {WAIT} s: {one:.2f} a second with one worker, {two:.2f} with two")
            bar("waits: two workers over one", two / one, TWO, least=True)
        if options.only in (None, "stubs"):
            document["stubs"] = found = stubs(home, options.stubs, 5)
            out.print(
                f"{options.stubs} stubs: {found['seconds']:.0f} s, {found['resumed']:.0f} done before the last run"
            )
            for name in ("missing", "doubled", "faults"):
                bar(f"stubs, a run killed five times: {name}", found[name], 0)
        if options.only in (None, "workers", "overhead", "dask"):
            manifest = shoot(home / "shots", options.captures)
        if options.only in (None, "workers"):
            runs = pairs(home, options.pairs, [("one", local(manifest, 1)), ("two", local(manifest, 2))])
            document["workers"] = {name: [vars(run) for run in each] for name, each in runs.items()}
            lines = [[name, *_words(each, options.captures, n)] for n, (name, each) in enumerate(runs.items(), 1)]
            title = f"{options.captures} captures, {options.pairs} pairs"
            out.print(table(title, ("workers", "s", "processor s a capture", "of its processors"), lines))
            assert all(run.done == options.captures for each in runs.values() for run in each)
            ratios = [one.wall / two.wall for one, two in zip(runs["one"], runs["two"], strict=True)]
            work = [2 * a.processor / b.processor for a, b in zip(runs["one"], runs["two"], strict=True)]
            document["workers"] |= {"ratios": ratios, "by_processor_time": work}
            out.print(
                f"two over one: {', '.join(f'{r:.2f}' for r in ratios)}; by processor time {np.median(work):.2f}"
            )
            bar("two workers over one, median of pairs", float(np.median(ratios)), TWO, least=True)
            each = min(run.wall for run in runs["two"]) / options.captures
            out.print(f"{1 / each:.2f} captures/s with two: a million in {each * 1e6 / 86400:.1f} days")
        if options.only in (None, "overhead"):
            import distributed

            with distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
            ) as cluster:
                ways = [
                    ("plain", lambda to: plain(manifest, to)),
                    ("batch", lambda to: batch(manifest, to)),
                    ("dask", lambda to: clustered(manifest, to, cluster)),
                ]
                runs = pairs(home, options.pairs, ways)
            assert all(run.done == options.captures for each in runs.values() for run in each)
            document["overhead"] = {name: [vars(run) for run in each] for name, each in runs.items()}
            for name, limit in (("batch", OVERHEAD), ("dask", DASK_OVERHEAD)):
                ratios = [b.processor / a.processor for a, b in zip(runs["plain"], runs[name], strict=True)]
                out.print(f"{name} over plain, processor time: {', '.join(f'{r:.2f}' for r in ratios)}")
                bar(f"{name} over plain, processor time, median of pairs", float(np.median(ratios)), limit)
        if options.only in (None, "dask"):
            import distributed

            with distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
            ) as cluster:
                words = ("--workers", cluster.scheduler_address)
                ways = [("workers", local(manifest, 2)), ("dask", lambda to: batch(manifest, to, *words))]
                runs = pairs(home, options.pairs, ways)
                ratios = [b.wall / a.wall for a, b in zip(runs["workers"], runs["dask"], strict=True)]
                out.print(f"Dask over --workers 2: {', '.join(f'{r:.2f}' for r in ratios)}")
                assert all(run.done == options.captures for each in runs.values() for run in each)
                bar("Dask over --workers, median of pairs", float(np.median(ratios)), DASK)
                lost = killed(manifest, home / "killed", cluster, options.captures)
                document["dask"] = {"ratios": ratios, **lost}
                bar("a worker killed: captures missing", lost["missing"], 0)
                bar("a worker killed: rows doubled", lost["doubled"], 0)
                bar("a worker was killed", lost["killed"], 1, least=True)
    print(
        save(
            "fleet" if options.only is None else f"fleet-{options.only}",
            document | {"versions": versions("duckdb", "distributed")},
        )
    )
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
