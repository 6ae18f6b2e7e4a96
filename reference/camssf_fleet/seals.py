"""Seals the commits of a registry's table: the SHA-256 of each commit's log entry and data files, and its rows.

Delta Lake stores no checksum of a file, so a flipped bit may go unseen; and who deletes rows leaves no trace but a
commit. The writer of a commit writes its seal after it. Without one its writer was stopped in between, the seal was
removed, or another program wrote the commit.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import unquote

from camssf.places import Place, files_below, write_place
from camssf_fleet.inputs import file_hash

LOG, SEALS = "_delta_log", "_seals"
LAST_CHECKPOINT = f"{LOG}/_last_checkpoint"


@dataclass(frozen=True)
class Changed:
    """What a commit changed, besides the files that it added.

    Attributes:
        added, deleted: keys of results that it wrote or deleted; none of the table of tasks.
        gone: data files, relative to the table, that need not be there from now on.
    """

    added: tuple[str, ...] = ()
    deleted: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()


@dataclass(frozen=True)
class Seal:
    """What a commit did: the SHA-256 of its files, relative to the table, and the results it changed."""

    hashes: dict[str, str]
    changed: Changed = Changed()


def seal(table: Place, version: int, changed: Changed) -> None:
    """Write the seal of one commit of a table.

    If there is one already, its results stay: the version was written twice, as its log entry had been removed.

    Raises:
        InvalidArgument: it cannot be written.
    """
    entry, path = f"{LOG}/{version:020}.json", table / SEALS / f"{version:020}.json"
    names = [entry, *added_files((table / entry).read_bytes())]
    checkpoint = f"{LOG}/{version:020}.checkpoint.parquet"
    if (table / checkpoint).is_file():
        names += [checkpoint, LAST_CHECKPOINT]
    earlier = read_seal(path.read_bytes()) if path.is_file() else None
    if earlier is not None:
        pairs = zip(vars(earlier.changed).values(), vars(changed).values(), strict=True)
        changed = Changed(*(tuple(dict.fromkeys(before + now)) for before, now in pairs))
    hashes = {}
    for name in names:
        with suppress(FileNotFoundError):  # a file of an old commit, vacuumed since
            hashes[name] = file_hash(table / name)
    write_place(path, as_seal(Seal(hashes, changed)))


def as_seal(seal: Seal) -> bytes:
    """The bytes of a seal: a line of JSON, and a line with its SHA-256."""
    text = json.dumps({"files": seal.hashes} | vars(seal.changed), sort_keys=True, ensure_ascii=False).encode()
    return text + f"\n{hashlib.sha256(text).hexdigest()}\n".encode()


def read_seal(data: bytes) -> Seal | None:
    """A seal; None if it is damaged."""
    text = data.partition(b"\n")[0]
    if data != text + f"\n{hashlib.sha256(text).hexdigest()}\n".encode():
        return None
    found = json.loads(text)
    if "files" not in found:  # of a release that listed no rows
        return Seal(found)
    return Seal(found.pop("files"), Changed(**{name: tuple(values) for name, values in found.items()}))


def read_seals(table: Place) -> dict[int, Seal | None]:
    """The seals of a table by version, in order; None for one that is damaged. A killed writer's is hidden."""
    files = sorted(each for each in files_below(table / SEALS) if re.fullmatch(r"\d{20}\.json", each.name))
    return {int(file.stem): read_seal(file.read_bytes()) for file in files}


def listed(seals: Iterable[Seal | None]) -> tuple[set[str], set[str]]:
    """Keys of the results that ought to be there by these seals, and of those that were deleted."""
    there, deleted = set[str](), set[str]()
    for each in seals:
        if each is not None:
            deleted.update(each.changed.deleted)
            there.difference_update(each.changed.deleted)
            deleted.difference_update(each.changed.added)
            there.update(each.changed.added)
    return there, deleted


def added_files(log: bytes) -> Iterator[str]:
    """The data files that a log entry adds, relative to the table."""
    for line in log.splitlines():
        action = json.loads(line)
        if "add" in action:
            yield unquote(action["add"]["path"])
