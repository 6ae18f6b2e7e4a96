"""Does the registry hold what it is given?

Writers of so many results each, in tasks of ten, one after the other killed at a random time, in a folder and on an
S3 server (moto over HTTP on the loopback; needs the extra `s3` and moto): every row that was acknowledged must be
there once, and everything must verify. Parts: folder, s3.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.claim import Run
from camssf_fleet.registry import Registry
from camssf_fleet.verification import verify

OPTIONS = {"results": (300, "of each writer"), "kills": (50, "how many writers to kill")}


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


def claim(run: Run) -> None:
    """A row a store."""
    options, counted = run.options, []
    with tempfile.TemporaryDirectory() as place:
        if run.wants("folder"):
            counted.append(("a folder", *killed(Path(place) / "many", options.kills, options.results, 10)))
        if run.wants("s3"):
            counted.append(("an S3 server", *killed_on_s3(options.kills, options.results)))
    columns = {"in": ""} | dict.fromkeys(("acknowledged", "missing", "doubled", "there without"), "d")
    run.table(f"writers of {options.results} results, {options.kills} killed", columns, counted)
    for where, _, missing, doubled, _ in counted:
        run.bar(f"{where}: rows missing or doubled", missing + doubled, most=0)
