"""Merges what is said of one result at different times: empty fields are filled in, and none is emptied.

Values are as the registry returns them (`record_queries.dicts`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, TypeAlias

from camssf.photo.read.unit import ALIKE
from camssf_fleet.records import EXCERPT, FACT, RESULT, is_empty

Json: TypeAlias = dict[str, Any]

FACTS = {
    "make": "make", "model": "model", "camera_id": "camera id", "serial": "serial", "lens": "lens",
    "focal_length": "focal length", "aperture": "aperture", "captured": "time",
}  # fmt: skip
"""Columns that are said of a result from outside and can contradict each other, with their names in messages."""
LAST = ("name", "made_from", "note")
"""Columns whose last value counts: a batch may find one result under two names."""
APART = ("key", "kind", "added", "extra", "passport", "passport_ends")
"""Columns with rules of their own."""
NOTHING: Json = {"whole": False, "held": False, "revision": 0}
"""What is said of a result that the registry does not know."""
CORRECT = "Leave out what is wrong, or replace what the registry has by --correct."


@dataclass(frozen=True)
class Added:
    """What became of a row that was added.

    Attributes:
        key: identifies the row.
        new: the registry did not have it.
        changes: what the registry has of it now, in words; empty if it was known already.
        contradiction: what it says otherwise than the registry, in words; if not "", it was not written.
        renamed: the registry had it under another name.
    """

    key: str
    new: bool = False
    changes: tuple[str, ...] = ()
    contradiction: str = ""
    renamed: bool = False


@dataclass(frozen=True)
class Statement:
    """What a row says that the registry has not.

    Attributes:
        added: what became of the row.
        whole: kind of the record that holds the whole row, RESULT or EXCERPT; "" if the registry has one.
        new: columns that were empty.
        changed: columns whose value changes.
    """

    added: Added
    whole: str = ""
    new: Json = field(default_factory=dict)
    changed: Json = field(default_factory=dict)

    def records(self, old: Mapping[str, Any] | None) -> list[Json]:
        """The records that say it; `old` as in `merge`, with the largest `revision` of the result's records."""
        key, records = {"key": self.added.key}, []
        if self.new:
            records.append({"kind": self.whole or FACT, "revision": 0} | self.new | key)
        if self.changed:
            records.append({"kind": FACT, "revision": 1 if old is None else old["revision"] + 1} | self.changed | key)
        return records

    def after(self, old: Mapping[str, Any] | None) -> Json:
        """What the registry says of the result once the records are there; `old` as in `records`."""
        before = NOTHING if old is None else old
        return {
            **before,
            **{name: value for name, value in self.new.items() if not is_empty(value)},
            **self.changed,
            "whole": before["whole"] or self.whole == RESULT,
            "held": before["held"] or bool(self.whole),
            "revision": before["revision"] + bool(self.changed),
        }


def merge(old: Mapping[str, Any] | None, row: Mapping[str, Any], correct: bool) -> Statement:
    """What a row says that the registry has not.

    A passport holds an excerpt: without a covariance, with rounded curves. It replaces nothing of the whole result.
    Of two passports the one that ends later counts.

    Args:
        old: what the registry says of the result, with `whole` and `held`: whether it has a whole result, or any;
            and `disputed`: columns of which two writers said different things at once. None for nothing.
        row: what is said now, with its `kind`.
        correct: of two values that contradict each other, the new one counts; else nothing is said.
    """
    kind, old = row["kind"], old or NOTHING
    values = {name: value for name, value in row.items() if not is_empty(value)}
    whole = kind if not old["held"] or (kind == RESULT and not old["whole"]) else ""
    new, changed, changes, against = dict(row) if whole else {}, {}, [], []
    for name, value in values.items():
        before = old.get(name)
        if name in APART or (old["held"] and kind == EXCERPT and name not in (*FACTS, *LAST)):
            continue
        if is_empty(before):
            new[name] = value
            if name in FACTS or name == "note":
                changes.append(f"{FACTS.get(name, name)} set to {in_words(value)}")
        elif name in FACTS and _differ(before, value):
            against.append((FACTS[name], before, value))
            changed[name] = value
        elif correct and name in old.get("disputed", ()):
            changes.append(f"{FACTS[name]} settled as {in_words(value)}")
            changed[name] = value
        elif not whole and _differ(before, value):
            changed[name] = value
            if name == "note":
                changes.append(f"note changed to {value}")
    before, said = (json.loads(row.get("extra") or "{}") for row in (old, values))
    changes += [f"{name} set to {value}" for name, value in said.items() if value and not before.get(name)]
    against += [(name, before[name], v) for name, v in said.items() if v and before.get(name, "") not in ("", v)]
    merged = before | {name: value for name, value in said.items() if value or name not in before}
    if merged != before:
        into = changed if before else new
        into["extra"] = json.dumps(merged, ensure_ascii=False, sort_keys=True)
    if "passport" in values and (not old.get("passport") or _ends(values) > _ends(old)):
        into = changed if old.get("passport") else new
        into |= {name: values[name] for name in ("passport", "passport_ends") if name in values}
        changes.append(f"passport set to {values['passport']}")
    key = str(row["key"])
    if against and not correct:
        words = "; ".join(f"{n} {in_words(was)} in the registry, {in_words(now)} given" for n, was, now in against)
        message = f"What is given of the result {key[:12]} contradicts the registry: {words}."
        return Statement(Added(key, contradiction=message))
    changes += [f"{n} changed from {in_words(was)} to {in_words(now)}" for n, was, now in against]
    changes += ["covariance added"] if whole and old["held"] else []
    if not old["held"]:
        return Statement(Added(key, new=True), whole, new, changed)
    return Statement(Added(key, changes=tuple(changes), renamed="name" in changed), whole, new, changed)


class Sayings:
    """What records say of FACTS, to find those of which two writers said different things at once."""

    def __init__(self) -> None:
        self._said: dict[tuple[str, str], tuple[int, set[Any]]] = {}

    def add(self, record: Mapping[str, Any]) -> None:
        """Note a record."""
        for name in FACTS:
            revision, values = self._said.get((record["key"], name), (-1, set()))
            if not is_empty(record[name]) and record["revision"] >= revision:
                same = values if record["revision"] == revision else set()
                self._said[record["key"], name] = record["revision"], same | {record[name]}

    def disputed(self) -> dict[str, dict[str, set[Any]]]:
        """The values at the largest revision, where there are several, by key and column."""
        disputes: dict[str, dict[str, set[Any]]] = {}
        for (key, name), (_, values) in self._said.items():
            if len(values) > 1:
                disputes.setdefault(key, {})[name] = values
        return disputes


def _differ(old: Any, new: Any) -> bool:
    """Whether two values contradict each other; files round focal lengths and f-numbers."""
    return not math.isclose(old, new, rel_tol=ALIKE) if isinstance(old, float) else bool(old != new)


def _ends(row: Mapping[str, Any]) -> float:
    return row["passport_ends"].timestamp() if row.get("passport_ends") else -math.inf


def in_words(value: Any) -> str:
    """A value for a message; a time as ISO 8601."""
    return value.isoformat().replace("+00:00", "Z") if isinstance(value, datetime) else str(value)
