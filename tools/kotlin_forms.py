"""The documents' types for Kotlin: each part's fields, bounds and defaults; `tools.formats` writes them."""

from __future__ import annotations

import json
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from camssf.documents.document import Document
from camssf.documents.forms import fields_of, mark_of, to_plain
from camssf.shapes import MOST, Argument, Bounds, Pattern, Shape, Words

FILE = Path(__file__).parents[1] / "reference/camssf/data/forms.json"
LONGEST = 4096
"""Characters of a text without bounds."""


def table() -> str:
    """The content of the file: one field a line."""
    parts: dict[str, Any] = {}
    _part(Document, parts)
    rows = []
    for name, part in parts.items():
        fields = ",\n".join(f"  {_json(key)}: {_json(form)}" for key, form in part.items())
        rows.append(f" {_json(name)}: {{\n{fields}\n }}")
    return "{\n" + ",\n".join(rows) + "\n}\n"


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def _part(kind: Any, parts: dict[str, Any]) -> None:
    """Add the form of a dataclass, and of those in its fields, to `parts`."""
    if kind.__name__ in parts:
        return
    part = parts[kind.__name__] = {}
    for row in fields_of(kind).values():
        default = {} if row.required else {"default": to_plain(row.default)}
        part[row.name] = _form(row.hint, parts) | default


def _form(hint: Any, parts: dict[str, Any]) -> dict[str, Any]:
    """The form of a field's type."""
    bounds, pattern = mark_of(hint, Bounds), mark_of(hint, Pattern)
    shape, options = mark_of(hint, Shape), mark_of(hint, Words)
    if shape is not None:
        flags: dict[str, Any] = {name: True for name in ("whole", "gaps") if getattr(shape, name)}
        empty = {"fewest": shape.fewest} if shape.fewest != 1 else {}
        return {"is": "array", "sides": shape.sides} | _limits(shape) | flags | empty
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    origin, inner = get_origin(hint), get_args(hint)
    if hint == Argument:
        return {"is": "argument"}
    if origin in (Union, UnionType):
        kinds = [kind for kind in inner if kind is not NoneType]
        null = {"null": True} if len(kinds) < len(inner) else {}
        if len(kinds) == 1:
            marks = [mark for mark in (bounds, pattern, options) if mark is not None]
            return _form(Annotated[kinds[0], *marks] if marks else kinds[0], parts) | null
        return {"is": "either", "of": {kind.KIND: _form(kind, parts) for kind in kinds}} | null
    if origin is Literal or options is not None:
        return {"is": "words", "words": inner if options is None else options.options}
    if origin is tuple and inner[-1] is Ellipsis:
        return {"is": "list", "of": _form(inner[0], parts)} | _limits(bounds or Bounds())
    if origin is tuple:
        return {"is": "tuple", "of": [_form(entry, parts) for entry in inner]}
    if origin is dict:
        return {"is": "map", "key": _form(inner[0], parts), "of": _form(inner[1], parts)}
    if hint in (int, float):
        return {"is": "whole" if hint is int else "number"} | _limits(bounds or Bounds())
    if hint is str:
        words: dict[str, Any] = {} if pattern is None else {"pattern": pattern.expression, "words": pattern.words}
        most = int((bounds or Bounds(0, LONGEST)).most)
        return {"is": "text"} | ({} if most == LONGEST else {"most": most}) | words
    if hint is bool:
        return {"is": "flag"}
    if hasattr(hint, "from_plain"):
        return {"is": "own", "name": hint.__name__}
    _part(hint, parts)
    return {"is": "part", "name": hint.__name__}


def _limits(bounds: Bounds | Shape) -> dict[str, Any]:
    """The bounds that differ from those of any number."""
    least = {} if bounds.least == -MOST else {"least": bounds.least}
    return least | ({} if bounds.most == MOST else {"most": bounds.most})
