"""Seals the commits of a registry's table: a file with the SHA-256 of each commit's log entry and of its data files.

Delta Lake stores no checksum of a file, so a flipped bit may go unseen. The writer of a commit writes its seal after
it; a commit without one was left by a writer that was stopped in between.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from urllib.parse import unquote

from camssf.fleet.inputs import file_hash
from camssf.places import Place, write_place

LOG, SEALS = "_delta_log", "_seals"
LAST_CHECKPOINT = f"{LOG}/_last_checkpoint"


def seal(table: Place, version: int) -> None:
    """Write the seal of one commit of a table.

    Raises:
        InvalidArgument: it cannot be written.
    """
    entry = f"{LOG}/{version:020}.json"
    names = [entry, *added_files((table / entry).read_bytes())]
    checkpoint = f"{LOG}/{version:020}.checkpoint.parquet"
    if (table / checkpoint).is_file():
        names += [checkpoint, LAST_CHECKPOINT]
    write_place(table / SEALS / f"{version:020}.json", as_seal({name: file_hash(table / name) for name in names}))


def as_seal(hashes: dict[str, str]) -> bytes:
    """The bytes of a seal: a line of JSON, and a line with its SHA-256."""
    text = json.dumps(hashes, sort_keys=True, ensure_ascii=False).encode()
    return text + f"\n{hashlib.sha256(text).hexdigest()}\n".encode()


def read_seal(data: bytes) -> dict[str, str] | None:
    """The SHA-256 by file of a seal; None if it is damaged."""
    text = data.partition(b"\n")[0]
    if data != text + f"\n{hashlib.sha256(text).hexdigest()}\n".encode():
        return None
    hashes: dict[str, str] = json.loads(text)
    return hashes


def added_files(log: bytes) -> Iterator[str]:
    """The data files that a log entry adds, relative to the table."""
    for line in log.splitlines():
        action = json.loads(line)
        if "add" in action:
            yield unquote(action["add"]["path"])
