"""Does the registry hold what it is given, and how fast is it?

Writers of so many results each, in tasks of ten, one after the other killed at a random time, in a folder and on an
S3 server (moto over HTTP on the loopback; needs the extra `s3` and moto): every row that was acknowledged must be
there once, and everything must verify. Then so many rows of 200 models with curves, without and with covariances
(`--covariances`): each question in a new process, with its libraries' loading, and its memory. A quarter of an hour
with a million. Parts: folder, s3, rows.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.claim import Run
from camssf.photo.read.unit import Unit
from camssf_fleet import compare
from camssf_fleet.drift import drift_of
from camssf_fleet.records import Row
from camssf_fleet.registry import Registry, Wanted
from camssf_fleet.verification import verify
from tests.support.registries import START, bells, made

ROOT = Path(__file__).parents[2]

OPTIONS = {
    "rows": (100_000, "how many rows to ask"),
    "results": (300, "of each writer"),
    "kills": (50, "how many writers to kill"),
    "covariances": (False, "ask rows with covariances as well"),
}
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


def answer(folder: str, question: str) -> None:
    """In a process of its own: the processor's seconds of a question, and the largest size, MB."""
    place = Path(folder)
    with tempfile.TemporaryDirectory(dir=place.parent) as out:
        questions(Registry(place), Path(out))[question]()
    status = Path("/proc/self/status").read_text()  # the largest size of getrusage is that of the parent, if larger
    size = int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])
    print(json.dumps([time.process_time(), size / 1e3]))


def measured(folder: Path, question: str) -> tuple[str, float, float, float]:
    """A question, its seconds by the clock and of processors, and the largest size, MB."""
    begun = time.perf_counter()
    code = f"from {answer.__module__} import answer\nanswer({str(folder)!r}, {question!r})"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True)
    wall = time.perf_counter() - begun
    processor, size = json.loads(done.stdout)
    return question, wall, processor, size


def claim(run: Run) -> None:
    """Writers that are killed, then the first answers."""
    options, counted = run.options, []
    with tempfile.TemporaryDirectory() as place:
        if run.wants("folder"):
            counted.append(("a folder", *killed(Path(place) / "many", options.kills, options.results, 10)))
        if run.wants("s3"):
            counted.append(("an S3 server", *killed_on_s3(options.kills, options.results)))
        if counted:
            columns = {"in": ""} | dict.fromkeys(("acknowledged", "missing", "doubled", "there without"), "d")
            run.table(f"writers of {options.results} results, {options.kills} killed", columns, counted)
        for where, _, missing, doubled, _ in counted:
            run.bar(f"{where}: rows missing or doubled", missing + doubled, most=0)
        for covariances in (False, True)[: 1 + options.covariances] if run.wants("rows") else ():
            folder = Path(place) / "large"
            size = fill(folder, options.rows, covariances)
            rows = [measured(folder, name) for name in questions(Registry(folder), folder)]
            shutil.rmtree(folder)
            words = "with covariances" if covariances else "without covariances"
            columns = {"question": "", "s": ".2f", "of processors": ".2f", "MB": ".0f"}
            run.table(f"{options.rows} rows {words}, {size / 1e6:.0f} MB: first answers", columns, rows)
            for name, wall, _, held in rows:
                if name in BARS:
                    run.bar(f"{name}, {words}: s", wall, most=BARS[name][0])
                    run.bar(f"{name}, {words}: MB", held, most=BARS[name][1])
