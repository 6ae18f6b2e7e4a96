"""Does the registry hold what it is given, and how fast is it? `python -m benchmarks.claims.registry`

Writers of so many results each, in tasks of ten, one after the other killed at a random time, in a folder and on an
S3 server (moto over HTTP on the loopback; needs the extra `s3` and moto): every row that was acknowledged must be
there once, and everything must verify. Then so many rows of 200 models with curves, without and with covariances
(`--covariances`): each question in a new process, with its libraries' loading, and its memory. A quarter of an hour
with a million; `--only` does one part; exit status 1 where a bar is missed.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.shared import command_parser, console, progress, save, table, versions
from camssf.photo.read.unit import Unit
from camssf_fleet import compare
from camssf_fleet.drift import drift_of
from camssf_fleet.records import Row
from camssf_fleet.registry import Registry, Wanted
from camssf_fleet.verification import verify
from tests.support.registries import START, bells, made

ROOT = Path(__file__).parents[2]

MODELS, UNITS = 200, 10
COVARIANCE = 72 * 73 // 2
"""Numbers of a row that only learning reads."""
BLOCK = MODELS * UNITS
BARS = {"list, one model": (2.0, 250.0), "spread of a model": (2.0, 250.0), "drift of a unit": (2.0, 250.0)}
"""Seconds of the first answer, loading included, and the largest resident size of its process, MB."""


def questions(registry: Registry, out: Path) -> dict[str, Callable[[], object]]:
    return {
        "list, one model": lambda: registry.listing(Wanted(Unit(model="Model 7"))),
        "spread of a model": lambda: compare.spread(registry, Unit(model="Model 7")),
        "drift of a unit": lambda: drift_of(registry, Unit(serial="7-3")),
        "export, csv": lambda: registry.export(out / "all.csv"),
        "export, parquet": lambda: registry.export(out / "all.parquet"),
    }


def killed_on_s3(kills: int, rows: int) -> tuple[int, int, int, int]:
    """As `killed`, on an S3 server of our own."""
    from boto3 import client

    from tests.support.stores import environment, served

    with served() as (address, _):
        os.environ.update(environment(address))
        client("s3").create_bucket(Bucket="fleet")
        return killed("s3://fleet/many", kills, rows, 10)


def killed(folder: Path | str, kills: int, rows: int, task: int) -> tuple[int, int, int, int]:
    """(acknowledged, of these missing, doubled, never acknowledged and there) with so many writers killed."""
    code = [sys.executable, "-m", "tests.support.registries", str(folder)]
    dice, added = random.Random(0), set()
    begun = 0

    def writer() -> subprocess.Popen[bytes]:
        nonlocal begun
        begun += 1
        return subprocess.Popen([*code, str(begun), str(rows), str(task)], stdout=subprocess.PIPE)

    running = [writer() for _ in range(4)]
    for _ in range(kills):
        time.sleep(dice.uniform(1, 4))
        victim = running.pop(dice.randrange(len(running)))
        victim.kill()
        added |= set(victim.communicate()[0].decode().split())
        running.append(writer())
    for process in running:
        added |= set(process.communicate()[0].decode().split())
    registry = Registry(folder)
    found = [each["key"] for each in registry.query("SELECT key FROM rows")]
    registry.list_records()  # those of the killed
    if faults := verify(registry).faults:
        raise SystemExit(f"verify: {faults}")
    return len(added), len(added - set(found)), len(found) - len(set(found)), len(set(found) - added)


def fill(folder: Path, rows: int, covariances: bool) -> int:
    """Results of MODELS models, UNITS units each, in blocks, compacted; all but the first block are made from it.

    Their hashes are not what they say; no question reads them. Returns the bytes of the files.
    """
    registry, dice = Registry(folder, new=True), np.random.default_rng(0)
    fresh: list[Row] = []
    for number in range(BLOCK):
        model, unit = number % MODELS, number // MODELS
        curves = bells(np.array([model / 8, 0.0, -model / 9]) + 0.3 * dice.standard_normal(3))
        known = tuple(dice.standard_normal(COVARIANCE).tolist()) if covariances else ()
        unit_ = {"model": f"Model {model}", "serial": f"{model}-{unit}", "captured": START + timedelta(hours=number)}
        fresh.append(made(number, curves, code_covariance=known, **unit_))
    registry.append(fresh)

    def multiply(con: Any) -> None:
        con.execute("CREATE TABLE first AS SELECT * EXCLUDE filename FROM stored")
        at_once = 2 if covariances else 5
        for block in range(1, rows // BLOCK, at_once):
            blocks = range(block, min(block + at_once, rows // BLOCK))
            registry.files._write(
                con,
                "SELECT first.* REPLACE (md5(key || b) || md5(b || key) AS key, "
                "md5(b || key) || md5(key || b) AS record, captured + INTERVAL (b) DAY AS captured, "
                "list_transform(red, lambda v: v + 1e-4 * sin(b))::FLOAT[] AS red, "
                "list_transform(code_covariance, lambda v: v * (1 + 1e-3 * b))::FLOAT[] AS code_covariance) "
                f"FROM first, range({blocks.start}, {blocks.stop}) t(b)",
            )

    registry.files.ask(multiply)
    registry.list_records()
    registry.files.compact()
    return sum(registry.files.sizes().values())


def answer(folder: Path, question: str) -> None:
    """In a process of its own: the seconds of a question, the clock's and a processor's, and the largest size, MB."""
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=folder.parent) as out:
        questions(Registry(folder), Path(out))[question]()
    status = Path("/proc/self/status").read_text()  # the largest size of getrusage is that of the parent, if larger
    size = int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])
    print(json.dumps([time.perf_counter() - begun, time.process_time(), size / 1e3]))


def measured(folder: Path, question: str) -> tuple[float, float, float]:
    begun = time.perf_counter()
    words = [sys.executable, "-m", "benchmarks.claims.registry", "--folder", str(folder), "--question", question]
    done = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True)
    _, processor, size = json.loads(done.stdout)
    return time.perf_counter() - begun, processor, size


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--rows", type=int, default=100_000, help="how many rows to ask")
    parser.add_argument("--results", type=int, default=300, help="of each writer")
    parser.add_argument("--kills", type=int, default=50, help="how many writers to kill")
    parser.add_argument("--covariances", action="store_true", help="ask rows with covariances as well")
    parser.add_argument(
        "--only", choices=("folder", "s3", "rows"), help="do one part: kills in a folder or on S3; rows"
    )
    parser.add_argument("--folder", type=Path, help="where --question asks")
    parser.add_argument("--question", help="answer one question, in this process")
    options = parser.parse_args(arguments)
    if options.question:
        answer(options.folder, options.question)
        return 0
    out, results, counted = console(), {}, {}
    with tempfile.TemporaryDirectory() as place, progress() as bar:
        step = bar.add_task("writers", total=2 + options.covariances)
        if options.only in (None, "folder"):
            counted["a folder"] = killed(Path(place) / "many", options.kills, options.results, 10)
        if options.only in (None, "s3"):
            counted["an S3 server"] = killed_on_s3(options.kills, options.results)
        for covariances in (False, True)[: 1 + options.covariances] if options.only in (None, "rows") else ():
            bar.update(step, advance=1, description="rows")
            folder = Path(place) / "large"
            size = fill(folder, options.rows, covariances)
            bar.update(step, description="questions")
            results[f"{covariances}"] = {"bytes": size} | {
                name: measured(folder, name) for name in questions(Registry(folder), folder)
            }
            subprocess.run(["rm", "-r", str(folder)], check=True)
    title = f"writers of {options.results} results, {options.kills} killed"
    rows = [(name, *found) for name, found in counted.items()]
    out.print(table(title, ("in", "acknowledged", "missing", "doubled", "there without"), rows))
    holds = all(found[1:3] == (0, 0) for found in counted.values())
    for covariances, found in results.items():
        size = found.pop("bytes")
        words = "with covariances" if covariances == "True" else "without covariances"
        lines = [(name, f"{s:.2f}", f"{p:.2f}", f"{mb:.0f}") for name, (s, p, mb) in found.items()]
        title = f"{options.rows} rows {words}, {size / 1e6:.0f} MB: first answers"
        out.print(table(title, ("question", "s", "of processors", "MB"), lines))
        holds &= all(found[name][0] <= s and found[name][2] <= mb for name, (s, mb) in BARS.items())
    save("registry", {"versions": versions(), "killed": counted, "rows": options.rows, "questions": results})
    out.print("every bar held" if holds else "a bar was MISSED")
    return 0 if holds else 1


if __name__ == "__main__":
    raise SystemExit(main())
