"""Verifies a registry: files with their names, records with their hashes, with the lists and with the archive."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from camssf.errors import InvalidArgument
from camssf.places import Place, files_below, is_remote, join, place
from camssf.shapes import Count, Text
from camssf_fleet.archive import RESULT_FILE, folder_of
from camssf_fleet.compare import many
from camssf_fleet.inputs import file_hash
from camssf_fleet.merge import FACTS, Sayings, in_words
from camssf_fleet.record_queries import all_records
from camssf_fleet.records import DELETION, FACT, JOB, LIST, record_hash
from camssf_fleet.registry import Registry, heads

RESTORE = (
    "Move a damaged or strange file away. Put back what is missing from a backup (no file ever changes, so copy only "
    "what lacks), or run the same `camssf batch` again: it writes what its archive has and the registry lacks."
)
UNFINISHED = "The next `camssf registry add` or `camssf batch` lists what a stopped writer left."
FORGOTTEN = "Run `camssf registry compact` to take deleted records out of the files."
ALONE = "Add the result again; it may have been deleted while something was said of it."
CORRECT = "Add the result again with what is right, and --correct."


@dataclass(frozen=True)
class Verification:
    """What `verify` compared, and what is wrong.

    Attributes:
        files, rows, documents: numbers that were compared with their hashes.
        documents_missing: number of documents outside an archive that are not at hand.
        heads: the newest lists; keep one elsewhere, and give it to a later `verify`.
        faults: what is damaged, missing or of unknown origin, in words, with its place.
        advice: what to do, in words; "" without faults.
    """

    files: Count
    rows: Count
    documents: Count
    documents_missing: Count
    heads: tuple[Text, ...]
    faults: tuple[Text, ...]
    advice: Text


@dataclass
class _Contents:
    """What the files hold.

    Attributes:
        faults: each in words, with the advice that helps.
        records: hash of each record, with the key of its result; without lists.
        listed: the same of what the lists say.
        lists: the lists before each list.
        deleted: hash of each deleted record, with the key of its result.
        made_from: of each result, by key.
        facts: keys of the results of which facts are said.
        sayings: what the records of results say of FACTS.
        documents, documents_missing: as in Verification.
        archives: of each archive, by its place, the results' folders that records name.
    """

    faults: dict[str, str] = field(default_factory=dict)
    records: dict[str, str] = field(default_factory=dict)
    listed: dict[str, str] = field(default_factory=dict)
    lists: dict[str, list[str]] = field(default_factory=dict)
    deleted: dict[str, str] = field(default_factory=dict)
    made_from: dict[str, str] = field(default_factory=dict)
    facts: set[str] = field(default_factory=set)
    sayings: Sayings = field(default_factory=Sayings)
    documents: int = 0
    documents_missing: int = 0
    archives: dict[str, set[str]] = field(default_factory=dict)


def verify(registry: Registry, head: str = "") -> Verification:
    """Compare all of a registry with its hashes, its lists, and the archives that its records name.

    Nobody should write to it meanwhile: records that are not listed yet count as faults.

    A document outside an archive is compared if it is at hand. A passport is not read; `passport verify` does that.

    Args:
        registry: the registry.
        head: hashes of lists that must be there, from an earlier `verify`, with blanks between them; notices an old
            copy of the whole registry.

    Raises:
        InvalidArgument: `head` is something else.
    """
    contents, sizes = _Contents(), registry.files.sizes()
    for path in registry.files.others():
        contents.faults[f"{path} is no file of a registry"] = RESTORE
    faults = {path: registry.files.fault(path, sizes) for path in sizes}
    contents.faults |= {f"{path} {fault}": RESTORE for path, fault in faults.items() if fault is not None}
    sound = [path for path, fault in faults.items() if fault is None]
    registry.files.ask(lambda con: _read(con, registry, contents), files=sound)
    _compare_lists(contents, _checked(head))
    for key, disputes in contents.sayings.disputed().items():
        for name, values in disputes.items():
            words = " and ".join(sorted(map(in_words, values)))
            contents.faults[f"two writers gave the result {key[:12]} two values of {FACTS[name]}: {words}"] = CORRECT
    for archive, held in contents.archives.items():
        for fault in _archive_faults(_beside(registry.folder, archive), held, contents):
            contents.faults[fault] = RESTORE
    return Verification(
        files=len(sizes),
        rows=len(contents.made_from),
        documents=contents.documents,
        documents_missing=contents.documents_missing,
        heads=tuple(heads(contents.lists)),
        faults=tuple(contents.faults),
        advice=" ".join(dict.fromkeys(contents.faults.values())),
    )


def _checked(head: str) -> list[str]:
    """The hashes in a text."""
    names = head.lower().split()
    if wrong := [name for name in names if not re.fullmatch("[0-9a-f]{12,64}", name)]:
        raise InvalidArgument(f"{wrong[0]!r} is no head.", "Give what verify printed: 64 digits and letters a to f.")
    return names


def _read(con: Any, registry: Registry, contents: _Contents) -> None:
    """Note what the records say; `contents` gets the faults of the records and of their documents."""
    for record in all_records(con):
        hashed, kind, key = record["record"], record["kind"], record["key"] or ""
        if record_hash(record) != hashed:
            contents.faults[f"{record['filename']}: the record {str(hashed)[:12]} differs from its hash"] = RESTORE
            continue
        if kind == LIST:
            contents.lists[hashed] = record["previous"] or []
            contents.listed |= dict(zip(record["records"], record["keys"], strict=True))
            continue
        if kind == DELETION:
            contents.deleted |= dict(zip(record["records"], record["keys"], strict=True))
        new = hashed not in contents.records
        contents.records[hashed] = key
        if kind in (JOB, DELETION) or not new:
            continue
        contents.sayings.add(record)
        if kind == FACT:
            contents.facts.add(key)
        if record["status"]:
            contents.made_from[key] = record["made_from"] or contents.made_from.get(key, "")
            if record["place"]:
                for fault in _document_faults(registry, record, contents):
                    contents.faults[fault] = RESTORE


def _compare_lists(contents: _Contents, heads_given: Sequence[str]) -> None:
    """Note what the lists name and the files lack, and the other way round."""
    there, faults = contents.records, contents.faults
    lost = {
        record: contents.listed[record] for record in contents.listed.keys() - there.keys() - contents.deleted.keys()
    }
    for record, key in sorted(lost.items()):
        faults[f"the record {record[:12]}{f' of the result {key[:12]}' if key else ''} is missing"] = RESTORE
    for key in sorted(contents.facts - contents.made_from.keys() - set(lost.values())):
        faults[f"facts are said of the result {key[:12]}, which is not there"] = ALONE
    if unlisted := there.keys() - contents.listed.keys() - contents.deleted.keys():
        names = ", ".join(sorted(record[:12] for record in unlisted)[:5])
        words = "in no list: their writer was stopped or still writes, or the list is lost"
        faults[f"{many(len(unlisted), 'record')} {words} ({names})"] = UNFINISHED
    for name in sorted({name for names in contents.lists.values() for name in names} - contents.lists.keys()):
        faults[f"the list {name[:12]} is missing"] = RESTORE
    for name in heads_given:
        if not any(known.startswith(name) for known in contents.lists):
            faults[f"the list {name[:12]} given as head is missing: an older copy, or another registry"] = RESTORE
    if forgotten := there.keys() & contents.deleted.keys():
        faults[f"{many(len(forgotten), 'deleted record')} still in a file"] = FORGOTTEN
    for record in forgotten:
        contents.made_from.pop(there[record], None)


def _archive_faults(archive: Place, held: set[str], contents: _Contents) -> Iterator[str]:
    """Results of an archive without a record, and records without their result."""
    there = {path.parent.name: path for path in files_below(archive) if path.name == RESULT_FILE}
    if not there:
        yield f"the archive {archive} of {len(held)} results is missing or empty"
        return
    for made_from in sorted(held - there.keys()):
        yield f"{archive / folder_of(made_from) / RESULT_FILE} is missing"
    deleted = set(contents.deleted.values())
    for made_from in sorted(there.keys() - held):
        key = file_hash(there[made_from])
        if key not in contents.made_from and key not in deleted:
            yield f"{there[made_from]} has no record"


def _document_faults(registry: Registry, record: dict[str, Any], contents: _Contents) -> Iterator[str]:
    made_from, path = record["made_from"] or "", record["place"]
    document = _beside(registry.folder, path)
    in_archive = f"{folder_of(made_from)}/{RESULT_FILE}"
    archived = bool(made_from) and path.endswith(f"/{in_archive}")
    if archived:
        contents.archives.setdefault(path.removesuffix(in_archive), set()).add(made_from)
    if not document.is_file():
        contents.documents_missing += not archived
        return
    data = document.read_bytes()
    if record["passport"] and (data.count(b".") == 2 or b'"excerpt"' in data):
        return
    contents.documents += 1
    if hashlib.sha256(data).hexdigest() != record["key"]:
        yield f"{document} differs from its record"


def _beside(folder: Place, path: str) -> Place:
    """The place of a path relative to a folder, without `..` unless links give it another meaning."""
    joined = join(folder, path)
    plain = joined if is_remote(joined) else os.path.normpath(joined)
    return place(plain if os.path.realpath(plain) == os.path.realpath(joined) else joined)
