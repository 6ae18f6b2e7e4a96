"""Batches without a calibration: what a photo's text says is what happens to it, here or in other processes."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

from camssf.documents.document import document_bytes
from camssf.errors import InvalidArgument
from camssf.report.build import NAMES
from camssf_fleet import batch, pools
from camssf_fleet.batch import WorkInFolder
from camssf_fleet.manifest import Job, Manifest
from camssf_fleet.outcome import Outcome, Summary
from camssf_fleet.registry import Registry
from tests.support.documents import document, unplaced
from tests.support.processes import SEARCH

HEADER = "name,photo,lamp,white,dark,chart,serial,site"


@cache
def template(refusal: bool) -> dict[str, Any]:
    """A document of an answer or of a refusal, without the hash of its content."""
    whole: dict[str, Any] = json.loads(document_bytes(unplaced() if refusal else document()))
    del whole["sha256"]
    return whole


def stub(job: Job, folder: Path, names: tuple[str, ...] = ("result.json",), log: Path | None = None) -> Outcome:
    """In place of the calibration: one document, whose camera is the photo's text, or what the text says.

    names: the files that hold the document; log: where visits are kept, the photo's folder unless given.
    """
    photo = Path(job.photos[0])
    text = photo.read_text()
    with open((log or photo.parent) / "visits", "a") as file:
        file.write(f"{job.name} {os.getpid()}\n")
    if text == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if text == "bug":
        raise RuntimeError("two\nlines")
    if text == "wrong":
        raise InvalidArgument("The lamp is none.", "Name one.")
    whole = json.loads(json.dumps(template(text == "refused")))
    (whole["capture"].get("unfinished") or whole["capture"]["shots"][0])["photo"]["model"] = text
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_text(json.dumps(whole), "utf-8")
    if text == "dies late":
        os.kill(os.getpid(), signal.SIGKILL)
    return Outcome(job.name, whole["verdict"]["status"], whole["verdict"]["reasons"][0]["code"])


def slow(job: Job, folder: Path, **more: Any) -> Outcome:
    time.sleep(0.4)
    return stub(job, folder, **more)


def in_this_process(jobs: Iterator[Job], work: pools.Work, count: int, recorder: pools.Recorder) -> None:
    """In place of `run_processes` where processes are not what is tested."""
    for job in jobs:
        recorder.add(job, work(job))
        recorder.update()


class Desk:
    """A folder with photos, a manifest, an archive and a registry."""

    def __init__(self, home: Path, header: str = HEADER) -> None:
        self.home, self.header = home, header

    out = property(lambda self: self.home / "out")
    manifest = property(lambda self: self.home / "manifest.csv")

    def write(self, rows: list[str], photos: dict[str, str]) -> None:
        for name, text in photos.items():
            (self.home / name).write_text(text)
        self.manifest.write_text("\n".join([self.header, *rows]) + "\n", "utf-8")

    def fill(self, count: int) -> list[str]:
        """So many cameras c0, c1, ... with a photo each."""
        names = [f"c{number}" for number in range(count)]
        self.write([f"{name},{name},D55,,,,," for name in names], {name: f"Phone {name}" for name in names})
        return names

    def run(self, *, processes: bool = False, **more: Any) -> Summary:
        """Into the registry."""
        registry = Registry(self.home / "phones", new=True, correct=more.pop("correct", False))
        return self._run(registry, processes, {"work": stub, **more})

    def run_pages(self, *, processes: bool = False, **more: Any) -> tuple[Outcome, ...]:
        """Without a registry, where a result has several files."""
        work = partial(more.pop("work", stub), names=NAMES)
        return self._run(None, processes, {"work": work, **more}).outcomes

    def _run(self, registry: Registry | None, processes: bool, more: dict[str, Any]) -> Summary:
        manifest = Manifest(self.home / more.pop("manifest", "manifest.csv"), **more.pop("options", {}))
        with pytest.MonkeyPatch.context() as patched:
            if not processes:
                patched.setattr(batch, "run_processes", in_this_process)
            return batch.run_batch(manifest, self.home / more.pop("out", "out"), registry, **{"workers": 1, **more})

    def started(self, run: str, work: WorkInFolder, workers: int = 1, **how: Any) -> subprocess.Popen[bytes]:
        """A run in a process of its own, which may be killed."""
        code = (
            f"from pathlib import Path\nfrom tests.support.desk import *\nif __name__ == '__main__':\n"
            f" Desk(Path({str(self.home)!r})).{run}(work={work.__name__}, workers={workers}, processes=True)"
        )
        environment = os.environ | {"PYTHONPATH": SEARCH}
        return subprocess.Popen([sys.executable, "-c", code], env=environment, stderr=subprocess.PIPE, **how)

    def rows(self, columns: str = "name, model, status") -> list[dict[str, Any]]:
        return Registry(self.home / "phones").query(f"SELECT {columns} FROM rows ORDER BY name")

    def tasks(self) -> dict[str, str]:
        ends = Registry(self.home / "phones").query("SELECT name, status FROM jobs ORDER BY added")
        return {end["name"]: end["status"] for end in ends}

    def visits(self) -> Counter[str]:
        """How often each job was begun with `stub`."""
        return Counter(self._begun()[::2])

    def workers(self) -> set[int]:
        """The processes that began jobs."""
        return set(map(int, self._begun()[1::2]))

    def _begun(self) -> list[str]:
        file = self.home / "visits"
        return file.read_text().split() if file.exists() else []
