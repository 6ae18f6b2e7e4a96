"""Checks a document against its JSON Schema and reports the first fault: its place and what would be correct.

It knows the keywords that data/*.schema.json use; tests/test_report.py compares it with jsonschema. Python values
that JSON does not have (infinite or NumPy numbers, keys that are not strings) are rejected first.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple, TypeAlias

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
    root = schema(name)
    form = root if member is None else root["properties"][member]
    faults = list(_faults(document, form, root, ()))
    if faults:
        raise BrokenError(*map(readable, _words(faults)))  # a name may hold a lone surrogate


class _Fault(NamedTuple):
    """Where a value breaks its schema, and what would be correct; `alternatives` are the faults of each `anyOf`."""

    path: tuple[str | int, ...]
    words: str
    lacking: str | None = None
    alternatives: tuple[list[_Fault], ...] = ()


FORBIDDEN = "must be missing here"
TYPES: Mapping[str, type | tuple[type, ...]] = {
    "object": dict, "array": list, "string": str, "null": type(None), "boolean": bool, "number": (int, float),
}  # fmt: skip
SIZES = (("Items", list, " entries"), ("Length", str, " characters"), ("Properties", dict, " keys"))
"""Endings of the keywords that bound a size, what they are about, and the unit."""


def _is(value: Any, kind: str) -> bool:
    if isinstance(value, bool):
        return kind == "boolean"
    if kind == "integer":
        return isinstance(value, int) or (isinstance(value, float) and value.is_integer())
    return isinstance(value, TYPES[kind])


def _referred(reference: str, root: Json) -> tuple[Any, Json]:
    """What `$ref` names, and the schema that it is in: this one, or the result's."""
    base, _, pointer = reference.partition("#")
    form = root = root if base in ("", root["$id"]) else schema("result")
    for step in pointer.split("/")[1:]:
        form = form[step]
    return form, root


def _faults(value: Any, form: Any, root: Json, path: tuple[str | int, ...]) -> Iterator[_Fault]:
    """All faults of a value, in no order."""
    if form is False:
        yield _Fault(path, FORBIDDEN)
    if isinstance(form, bool):
        return
    if "$ref" in form:
        yield from _faults(value, *_referred(form["$ref"], root), path)
    for ending, kind, unit in SIZES:
        if isinstance(value, kind):
            least, most = form.get(f"min{ending}", 0), form.get(f"max{ending}", math.inf)
            if not least <= len(value) <= most:
                bound = f"least {least}" if len(value) < least else f"most {most}"
                yield _Fault(path, f"must be at {bound}{unit}, is {len(value)}")
    yield from (_Fault(path, f"{words}, is {short(value)}") for words in _own_faults(value, form))
    if isinstance(value, list) and "items" in form and not _numbers_within(value, form["items"], root):
        for i, entry in enumerate(value):
            yield from _faults(entry, form["items"], root, (*path, i))
    if isinstance(value, dict):
        yield from _faults_of_object(value, form, root, path)
    for word in {"anyOf", "oneOf"} & form.keys():
        branches = [list(_faults(value, branch, root, path)) for branch in form[word]]
        fit = branches.count([])
        if fit == 0 or (word == "oneOf" and fit > 1):
            yield _Fault(path, f"breaks the schema ({word})", alternatives=tuple(branches) if fit == 0 else ())
    if "if" in form:
        word = "else" if any(_faults(value, form["if"], root, path)) else "then"
        yield from _faults(value, form.get(word, True), root, path)


def _numbers_within(values: list[Any], form: Json, root: Json) -> bool:
    """Whether floats fit a form of bounds alone; False otherwise, or where it takes a look at each. For speed."""
    while form.keys() - {"description"} == {"$ref"}:
        form, root = _referred(form["$ref"], root)
    plain = form.keys() <= {"type", "description", "minimum", "maximum"} and form.get("type") == "number"
    least, most = form.get("minimum", -math.inf), form.get("maximum", math.inf)
    return plain and _all_floats(values) and bool(least <= min(values) and max(values) <= most)


def _own_faults(value: Any, form: Json) -> Iterator[str]:
    """What a value itself must be and is not, whatever is in it."""
    kinds = form.get("type", [])
    kinds = [kinds] if isinstance(kinds, str) else kinds
    if kinds and not any(_is(value, kind) for kind in kinds):
        yield f"must be of type {' or '.join(kinds)}"
    options = form.get("enum", [form["const"]] if "const" in form else None)
    if options is not None and not any(
        value == o and isinstance(value, bool) == isinstance(o, bool) for o in options
    ):
        yield f"must be {' or '.join(map(json.dumps, options))}"
    if _is(value, "number"):
        if value < form.get("minimum", -math.inf):
            yield f"must be at least {form['minimum']}"
        if value > form.get("maximum", math.inf):
            yield f"must be at most {form['maximum']}"
        if "exclusiveMinimum" in form and value <= form["exclusiveMinimum"]:
            yield f"must be above {form['exclusiveMinimum']}"
    if isinstance(value, str) and "pattern" in form and not re.search(form["pattern"].replace("$", r"\Z"), value):
        yield f"must match {form['pattern']}"


def _faults_of_object(value: Json, form: Json, root: Json, path: tuple[str | int, ...]) -> Iterator[_Fault]:
    for name in form.get("required", ()):
        if name not in value:
            yield _Fault(path, f"lacks {name}", lacking=name)
    known, more = form.get("properties", {}), form.get("additionalProperties", True)
    unknown = [name for name in value if name not in known]
    if more is False and unknown:
        yield _Fault(path, f"has an unknown key, {short(unknown[0])}")
    for name, entry in value.items():
        if name in known or more is not False:
            yield from _faults(entry, known.get(name, more), root, (*path, name))


def _words(faults: list[_Fault]) -> tuple[str, str]:
    """Place and description of the outermost fault, with all keys that are missing there."""
    first = min(faults, key=lambda fault: (len(fault.path), fault.words != FORBIDDEN))
    if first.alternatives:  # the schemas use `this, or null`: report the faults of `this`
        return _words([fault for branch in first.alternatives for fault in branch])
    lacking = [fault.lacking for fault in faults if fault.path == first.path and fault.lacking]
    words = f"lacks {', '.join(dict.fromkeys(lacking))}" if first.lacking else first.words
    return _place(first.path), words


LARGEST_BITS = 1000
"""Longest integer: a float ends at 2^1024, and arithmetic may need one."""
_PLAIN = (dict, list, str, bool, int, float, type(None))


def _check_values(value: Any, where: str) -> None:
    """Raise unless all values are of JSON's types."""
    if isinstance(value, dict):
        for key, entry in value.items():
            if not isinstance(key, str):
                raise BrokenError(where, f"has a key that is no text, {short(key)}")
            _check_values(entry, f"{where}.{key}")
    elif isinstance(value, list):
        if _all_floats(value) and all(map(math.isfinite, value)):  # fast path for most of a document
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


def _all_floats(values: list[Any]) -> bool:
    return set(map(type, values)) == {float}


def _place(path: tuple[str | int, ...]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)


def short(value: Any) -> str:
    """A value as short text."""
    if isinstance(value, int) and value.bit_length() > 200:
        return "a huge integer"
    text = repr(value) if isinstance(value, (str, int, float, type(None))) else type(value).__name__
    return text if len(text) <= 60 else text[:57] + "..."
