"""Checks a document against its JSON Schema and reports the first fault: its place and what would be correct.

The library jsonschema finds the faults; this module words them. The library accepts Python values that JSON does not
have (infinite or NumPy numbers, keys that are not strings), so these are rejected first.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator
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
    faults = list(_validator(name, member).iter_errors(document))
    if faults:
        raise BrokenError(*map(readable, _words(faults)))  # a name may hold a lone surrogate


@cache
def _validator(name: str, member: str | None) -> Any:
    import jsonschema
    from referencing import Registry
    from referencing.jsonschema import DRAFT202012

    every, inner = (jsonschema.Draft202012Validator.VALIDATORS[name] for name in ("items", "properties"))

    def items(validator: Any, form: Any, values: Any, within: Any) -> Iterator[Any]:
        """As the library's, but floats that only need to lie in a range are checked at once: a tenth of the time."""
        if not _numbers_within(values, validator, form):
            yield from every(validator, form, values, within)

    def properties(validator: Any, forms: Any, value: Any, within: Any) -> Iterator[Any]:
        """As the library's, which does not tell the place of a key that must be missing."""
        barred = {name for name, form in forms.items() if form is False}
        yield from inner(validator, {name: forms[name] for name in forms.keys() - barred}, value, within)
        for name in barred & (value.keys() if isinstance(value, dict) else set()):
            yield jsonschema.ValidationError("", validator=None, path=[name], instance=value[name])

    def pattern(validator: Any, form: str, text: Any, within: Any) -> Iterator[Any]:
        """As JSON Schema has it: `$` is the end, not a line's."""
        if isinstance(text, str) and not re.search(form.replace("$", r"\Z"), text):
            yield jsonschema.ValidationError("")

    # Other schemas refer to the result's. With `$schema` the library would take its own class again.
    forms = [schema(each) | {"$schema": ""} for each in dict.fromkeys((name, "result"))]
    own = forms[0]["$id"] if member is None else f"{forms[0]['$id']}#/properties/{member}"
    registry = Registry().with_resources((form["$id"], DRAFT202012.create_resource(form)) for form in forms)
    made = jsonschema.validators.extend(
        jsonschema.Draft202012Validator, {"items": items, "properties": properties, "pattern": pattern}
    )
    return made({"$ref": own}, registry=registry)


def _numbers_within(values: Any, validator: Any, form: Any) -> bool:
    """Whether a list holds nothing but floats within the bounds of `form`, which asks for nothing else."""
    resolver = validator._resolver
    while isinstance(form, dict) and form.keys() - {"description"} == {"$ref"}:
        found = resolver.lookup(form["$ref"])
        form, resolver = found.contents, found.resolver
    if not (isinstance(values, list) and values and all(type(value) is float for value in values)):
        return False
    if form.get("type") != "number" or not form.keys() <= {"type", "description", "minimum", "maximum"}:
        return False
    return bool(form.get("minimum", -math.inf) <= min(values) and max(values) <= form.get("maximum", math.inf))


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


def _words(faults: Iterable[Any]) -> tuple[str, str]:
    """Place and description of the outermost fault, with all keys that are missing there."""
    first = min(faults, key=lambda fault: (len(fault.absolute_path), fault.validator is not None))
    if first.validator == "anyOf":  # the schemas use `this, or null`: report the faults of `this`
        return _words(first.context)
    return _place(first.absolute_path), _fault(first)


SIZES = {"Items": " entries", "Length": " characters", "Properties": " keys"}
"""Endings of the keywords that bound a size, and the unit."""


BOUNDS = {"minimum": "at least", "maximum": "at most", "exclusiveMinimum": "above"}


def _fault(fault: Any) -> str:
    keyword, limit, value = fault.validator, fault.validator_value, fault.instance
    if keyword is None:  # the schema is False
        return "must be missing here"
    if keyword[3:] in SIZES:
        side = "least" if keyword.startswith("min") else "most"
        return f"must be at {side} {limit}{SIZES[keyword[3:]]}, is {len(value)}"
    if keyword == "required":
        return f"lacks {', '.join(name for name in limit if name not in value)}"
    if keyword in BOUNDS:
        return f"must be {BOUNDS[keyword]} {limit}, is {short(value)}"
    if keyword == "type":
        return f"must be of type {limit if isinstance(limit, str) else ' or '.join(limit)}, is {short(value)}"
    if keyword in ("const", "enum"):
        options = [limit] if keyword == "const" else limit
        return f"must be {' or '.join(map(json.dumps, options))}, is {short(value)}"
    if keyword == "pattern":
        return f"must match {limit}, is {short(value)}"
    if keyword == "additionalProperties":
        unknown = next(name for name in value if name not in fault.schema["properties"])
        return f"has an unknown key, {short(unknown)}"
    return f"breaks the schema ({keyword})"


def _place(path: Iterable[str | int]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)


def short(value: Any) -> str:
    """A value as short text."""
    if isinstance(value, int) and value.bit_length() > 200:
        return "a huge integer"
    text = repr(value) if isinstance(value, (str, int, float, type(None))) else type(value).__name__
    return text if len(text) <= 60 else text[:57] + "..."
