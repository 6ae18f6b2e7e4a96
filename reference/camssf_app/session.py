"""A tab's session: a temporary folder, the photos in it, and the process that works on them."""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import tempfile
from collections.abc import AsyncIterator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from anyio import to_thread

from camssf_app.orders import RESULT, Order
from camssf_app.tasks import Json, perform

PULSE = 0.25
"""Seconds between two lines of an answer, so that a closed or cancelled request is noticed."""
DIED = (
    "The process that worked on this photo died; the file may be damaged, or memory too small. "
    "Check the file, close other programs and try again."
)
ENDED = "camssf app was ended. Start it again and open its new address."
BUSY = "This tab is busy. Wait, or cancel the task."


def work(link: Connection, folder: Path) -> None:
    """Perform one order after another until the server closes the link."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the server's, which ends this process
    os.chdir(folder)  # so that no message and no report holds its path
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            name, order = link.recv()
            link.send(perform(name, order, lambda stage, part: link.send({"stage": stage, "part": part})))


class Session:
    """One tab.

    Attributes:
        name: a random name, which only the tab knows.
        folder: its files; only the owner has access.
        uploads: number of files that were sent.
        busy: whether a task is running.
        missed: number of beats since the page's last request. A clock would count the time that a computer sleeps.
        closed: whether the session has ended.
    """

    def __init__(self, root: Path) -> None:
        self.name = secrets.token_urlsafe(16)
        self.folder = Path(tempfile.mkdtemp(dir=root))
        self.uploads = 0
        self.busy = self.closed = False
        self.missed = 0
        self._link: Connection | None = None
        self._process: Any = None

    async def run(self, task: str, order: Order) -> AsyncIterator[Json]:
        """Perform a task: its progress, then {"value": ...} or {"error": ...}; an empty line each PULSE between them.

        If the caller stops before the end, the process is killed.
        """
        if self.busy:
            yield {"error": {"code": "busy", "words": BUSY}}
            return
        self.busy, finished = True, False
        try:
            link = self._linked()
            link.send((task, order))
            while not finished:
                line = link.recv() if await to_thread.run_sync(link.poll, PULSE) else {}
                finished = not line.keys().isdisjoint(("value", "error"))
                yield line
        except (EOFError, OSError):
            words = ENDED if self.closed else DIED
            yield {"error": {"code": "process_died", "words": words}}
        finally:
            if not finished:
                self._stop()
            self.busy = False
            self.missed = 0

    def silent(self, beats: int) -> bool:
        """Whether no task is running and the page has asked nothing for so many beats."""
        return not self.busy and self.missed >= beats

    def file(self, name: str) -> Path | None:
        """A file that a task wrote, by its name; None if there is none, or it is none of the session's own."""
        return next(
            (
                path
                for folder in (self.folder, self.folder / RESULT)
                if folder.is_dir()
                for path in folder.iterdir()
                if path.name == name and path.is_file() and not name.startswith(".")
            ),
            None,
        )

    def close(self) -> None:
        """End the process and remove the folder."""
        self.closed = True
        self._stop()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _linked(self) -> Connection:
        """The link to the process, which is started if there is none."""
        if self._link is None or not self._process.is_alive():
            spawn = get_context("spawn")
            self._link, theirs = spawn.Pipe()
            self._process = spawn.Process(target=work, args=(theirs, self.folder), daemon=True)
            self._process.start()
            theirs.close()
        return self._link

    def _stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
        self._link = self._process = None
