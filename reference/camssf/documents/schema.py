"""Checks a document against its JSON Schema and reports the first fault: its place and what would be correct.

The library jsonschema-rs finds the faults; this module words them. The library accepts Python values that JSON does
not have (infinite or NumPy numbers, keys that are not strings), so these are rejected first.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from typing import Any, TypeAlias

from camssf.files import readable

Json: TypeAlias = dict[str, Any]


class BrokenError(Exception):
    """Place and description of a fault. Used inside `documents` only."""


@cache
def schema(name: str) -> Json:
    """One of data/*.schema.json: "result", "passport"."""
    return dict(json.loads(files("camssf").joinpath("data", f"{name}.schema.json").read_text("utf-8")))


def check(document: Any, name: str, member: str | None = None) -> None:
    """Raise BrokenError if a document, or only one member of it, does not follow the schema of that name."""
    try:
        _check_values(document, "")
    except RecursionError:
        raise BrokenError("", "is nested too deep") from None
    try:
        faults = list(_validator(name, member).iter_errors(document))
    except UnicodeEncodeError:  # a lone surrogate in a file's name, written as U+FFFD
        document = json.loads(readable(json.dumps(document, ensure_ascii=False)))
        faults = list(_validator(name, member).iter_errors(document))
    if faults:
        raise BrokenError(*_words(faults, document))


@cache
def _validator(name: str, member: str | None) -> Any:
    import jsonschema_rs

    forms = [schema(each) for each in dict.fromkeys((name, "result"))]  # other schemas refer to the result's
    own = forms[0]["$id"] if member is None else f"{forms[0]['$id']}#/properties/{member}"
    registry = jsonschema_rs.Registry([(form["$id"], form) for form in forms])
    return jsonschema_rs.Draft202012Validator({"$ref": own}, registry=registry)


LARGEST_BITS = 1000
"""Longest integer: a float ends at 2^1024, and the library does not check longer integers."""
_PLAIN = (dict, list, str, bool, int, float, type(None))


def _check_values(value: Any, where: str) -> None:
    """Raise unless all values are of JSON's types."""
    if isinstance(value, dict):
        for key, entry in value.items():
            if not isinstance(key, str):
                raise BrokenError(where, f"has a key that is no text, {short(key)}")
            _check_values(entry, f"{where}.{key}")
    elif isinstance(value, list):
        if all(type(entry) is float and math.isfinite(entry) for entry in value):  # fast path for most of a document
            return
        for i, entry in enumerate(value):
            _check_values(entry, f"{where}[{i}]")
    elif isinstance(value, float):
        if not math.isfinite(value):
            raise BrokenError(where, "must be a finite number")
    elif isinstance(value, int) and value.bit_length() > LARGEST_BITS:
        raise BrokenError(where, f"must be a number that a float can hold, is {short(value)}")
    elif not isinstance(value, _PLAIN):
        raise BrokenError(where, f"must be of type number or another of JSON, is {short(value)}")


def _words(faults: Iterable[Any], document: Any) -> tuple[str, str]:
    """Place and description of the outermost fault, with all keys that are missing there."""

    def before(fault: Any) -> tuple[int, bool]:
        return len(fault.instance_path), type(fault.kind).__name__ != "FalseSchema"

    first, *_ = ordered = sorted(faults, key=before)
    path, kind = first.instance_path, type(first.kind).__name__
    if kind == "AnyOf":  # the schemas use `this, or null`: report the faults of `this`
        inside = [fault for branch in first.kind.context for fault in branch]
        return _words([fault for fault in inside if fault.instance_path[: len(path)] == path], document)
    if kind == "Required":
        lacking = [f.kind.property for f in ordered if f.instance_path == path and hasattr(f.kind, "property")]
        return _place(path), f"lacks {', '.join(dict.fromkeys(lacking))}"
    return _place(path), _fault(kind, first.kind, _value(document, path))


def _fault(kind: str, of: Any, value: Any) -> str:
    sizes = {"Items": " entries", "Length": " characters", "Properties": " keys", "imum": ""}
    for ending, unit in sizes.items():
        if kind.endswith(ending) and kind[:3] in ("Min", "Max") and hasattr(of, "limit"):
            size = value if ending == "imum" else len(value)
            side = "least" if kind.startswith("Min") else "most"
            return f"must be at {side} {of.limit}{unit}, is {short(size)}"
    if kind == "Type":
        return f"must be of type {' or '.join(of.types)}, is {short(value)}"
    if kind == "Constant":
        return f"must be {json.dumps(of.expected_value)}, is {short(value)}"
    if kind == "Enum":
        return f"must be {' or '.join(map(json.dumps, of.options))}, is {short(value)}"
    if kind == "Pattern":
        return f"must match {of.pattern}, is {short(value)}"
    if kind == "AdditionalProperties":
        return f"has an unknown key, {short(of.unexpected[0])}"
    if kind == "FalseSchema":
        return "must be missing here"
    return f"breaks the schema ({kind})"


def _place(path: Iterable[str | int]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)


def _value(document: Any, path: Iterable[str | int]) -> Any:
    for step in path:
        document = document[step]
    return document


def short(value: Any) -> str:
    """A value as short text."""
    if isinstance(value, int) and value.bit_length() > 200:
        return "a huge integer"
    text = repr(value) if isinstance(value, (str, int, float, type(None))) else type(value).__name__
    return text if len(text) <= 60 else text[:57] + "..."
