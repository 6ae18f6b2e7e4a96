"""Merges what is said of one result at different times: empty fields are filled in, and none is emptied.

Values are as the registry returns them (`tables.dicts`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, TypeAlias

from camssf.photo.read.unit import ALIKE
from camssf_fleet.rows import checksum

Json: TypeAlias = dict[str, Any]

UNKNOWN = "unknown"
"""Make or model of a camera that the photo does not name; Delta has no empty partition."""
FACTS = {
    "make": "make", "model": "model", "camera_id": "camera id", "serial": "serial", "lens": "lens",
    "focal_length": "focal length", "aperture": "aperture", "captured": "time",
}  # fmt: skip
"""Columns that are said of a result from outside and can contradict each other, with their names in messages."""
LAST = ("name", "made_from")
"""Columns whose last value counts: a batch may find one result under two names."""
CORRECT = "Leave out what is wrong, or replace what the registry has by --correct."
AGAIN = "a row that differed from its checksum written again"


@dataclass(frozen=True)
class Added:
    """What became of a row that was added.

    Attributes:
        key: identifies the row.
        new: the registry did not have it.
        changes: what the registry has of it now, in words; empty if it was known already.
        contradiction: what it says otherwise than the registry, in words; if not "", it was not written.
    """

    key: str
    new: bool = False
    changes: tuple[str, ...] = ()
    contradiction: str = ""


def fold(
    held: Mapping[str, Json], fresh: Iterable[Json], identity: str, stamp: str, correct: bool | None
) -> tuple[dict[str, Json], list[Added]]:
    """The rows that change, with their checksums, by identity; and what became of each row that was given.

    Args:
        held: the rows that the registry has, by identity; what is said now counts more than one that differs from its
            checksum.
        fresh: what is said now; several may be of one row.
        identity: column that identifies a row.
        stamp: column of the time of writing; a row that differs in it alone is the same.
        correct: as in `merge`; None for rows of which the last counts.
    """
    found, added = dict[str, Json](), list[Added]()
    for row in fresh:
        key = row[identity]
        old = found.get(key) or held.get(key)
        damaged = old is not None and checksum(old) != old["checksum"]
        if old is None:
            merged, said = row, Added(key, new=True)
        elif checksum(row | {stamp: old[stamp]}) == old["checksum"]:
            merged, said = row | {stamp: old[stamp]} if damaged else old, Added(key)
        elif correct is None:
            merged, said = row, Added(key)
        else:
            merged, said = merge(old, row, correct or damaged)
        added.append(replace(said, changes=(*said.changes, AGAIN)) if damaged else said)
        if merged is not old and not said.contradiction:
            found[key] = merged | {"checksum": checksum(merged)}
    return found, added


def merge(old: Mapping[str, Any], new: Mapping[str, Any], correct: bool) -> tuple[Json, Added]:
    """The row of a result of which more is said, and what changed.

    A passport holds an excerpt: without a covariance, with rounded curves. It replaces nothing of the whole result.
    Of two passports the one that ends later counts.

    Args:
        old: the row.
        new: what is said now, as a row with the same key.
        correct: of two values that contradict each other, take the new one; else the merged row is of no use.
    """
    row, changes, against = dict(old), [], []
    excerpt = bool(old["code_covariance"]) and not new["code_covariance"]
    for name, value in new.items():
        if name in ("added", "extra", "passport", "passport_ends") or _is_empty(name, value):
            continue
        if name in FACTS:
            if _is_empty(name, old[name]):
                changes.append(f"{FACTS[name]} set to {_in_words(value)}")
            elif _differ(old[name], value):
                against.append((FACTS[name], old[name], value))
            else:
                continue
        elif excerpt and name not in LAST:
            continue
        row[name] = value
    extra, more = (json.loads(each["extra"] or "{}") for each in (old, new))
    changes += [f"{name} set to {value}" for name, value in more.items() if value and not extra.get(name)]
    against += [(n, extra[n], v) for n, v in more.items() if v and extra.get(n, "") not in ("", v)]
    merged = extra | {name: value for name, value in more.items() if value or name not in extra}
    row["extra"] = json.dumps(merged, ensure_ascii=False, sort_keys=True) if merged else ""
    if new["passport"] and (not old["passport"] or _ends(new) > _ends(old)):
        row |= {name: new[name] for name in ("passport", "passport_ends")}
        changes.append(f"passport set to {new['passport']}")
    if new["code_covariance"] and not old["code_covariance"]:
        changes.append("covariance added")
    if against and not correct:
        words = "; ".join(f"{n} {_in_words(was)} in the registry, {_in_words(now)} given" for n, was, now in against)
        message = f"What is given of the result {new['key'][:12]} contradicts the registry: {words}."
        return row, Added(str(new["key"]), contradiction=message)
    changes += [f"{n} changed from {_in_words(was)} to {_in_words(now)}" for n, was, now in against]
    return row, Added(str(new["key"]), changes=tuple(changes))


def _is_empty(name: str, value: Any) -> bool:
    return value is None or value in ("", []) or (name in ("make", "model") and value == UNKNOWN)


def _differ(old: Any, new: Any) -> bool:
    """Whether two values contradict each other; files round focal lengths and f-numbers."""
    return not math.isclose(old, new, rel_tol=ALIKE) if isinstance(old, float) else bool(old != new)


def _ends(row: Mapping[str, Any]) -> float:
    return row["passport_ends"].timestamp() if row["passport_ends"] else -math.inf


def _in_words(value: Any) -> str:
    return value.isoformat().replace("+00:00", "Z") if isinstance(value, datetime) else str(value)
