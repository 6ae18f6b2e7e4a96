"""JSON Schema of documents, from their types and docstrings."""

from __future__ import annotations

import re
from dataclasses import is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from camssf.documents.forms import Json, fields_of, mark_of
from camssf.shapes import Bounds, Pattern, Shape, Words


def schema(kind: type) -> Json:
    """JSON Schema (2020-12) of a document; descriptions are the docstrings'."""
    defs: Json = {}

    def of(hint: Any) -> Json:
        bounds, pattern, shape = mark_of(hint, Bounds), mark_of(hint, Pattern), mark_of(hint, Shape)
        if shape is not None:
            return _array_schema(shape)
        if (words := mark_of(hint, Words)) is not None:
            return {"enum": list(words.options)}
        if get_origin(hint) is Annotated:
            hint = get_args(hint)[0]
        origin, inner = get_origin(hint), get_args(hint)
        if origin in (Union, UnionType):
            return {"anyOf": [of(entry) for entry in inner]}
        if origin is Literal:
            return {"enum": list(inner)}
        if origin is tuple and inner[-1] is Ellipsis:
            limits = {} if bounds is None else {"minItems": int(max(bounds.least, 0)), "maxItems": int(bounds.most)}
            return {"type": "array", "items": of(inner[0])} | limits
        if origin is tuple:
            entries = [of(entry) for entry in inner]
            return {"type": "array", "prefixItems": entries, "minItems": len(entries), "items": False}
        if origin is dict:
            return {"type": "object", "additionalProperties": of(inner[1])}
        if isinstance(hint, type) and is_dataclass(hint):
            name = hint.__name__
            if name not in defs:
                defs[name] = {}
                defs[name] = part(hint)
            return {"$ref": f"#/$defs/{name}"}
        if hint is str:
            limits = {"maxLength": int((bounds or Bounds(0, 4096)).most)}
            return (
                {"type": "string"} | limits | ({} if pattern is None else {"pattern": f"^(?:{pattern.expression})$"})
            )
        if hint in (int, float):
            bounds = bounds or Bounds()
            return {"type": "integer" if hint is int else "number", "minimum": bounds.least, "maximum": bounds.most}
        plain: Json = {NoneType: {"type": "null"}, bool: {"type": "boolean"}, Any: {}}[hint]
        return plain

    def part(kind: Any) -> Json:
        if hasattr(kind, "PLAIN"):
            return dict(kind.PLAIN)
        summary, attributes = described(kind)
        rows = fields_of(kind)
        held: Json = {"kind": {"const": kind.KIND}} if hasattr(kind, "KIND") else {}
        for row in rows.values():
            held[row.name] = of(row.hint) | ({"description": attributes[row.name]} if row.name in attributes else {})
        required = [*(["kind"] if "kind" in held else []), *(row.name for row in rows.values() if row.required)]
        return {
            "description": summary, "type": "object", "additionalProperties": False, "required": required,
            "properties": held,
        }  # fmt: skip

    head = part(kind)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | head | {"$defs": dict(sorted(defs.items()))}


def _array_schema(shape: Shape) -> Json:
    form: Json = {"type": "integer" if shape.whole else "number", "minimum": shape.least, "maximum": shape.most}
    for axis, side in reversed(list(enumerate(shape.sides))):
        form = {"type": "array", "items": form, "minItems": side or (shape.fewest if axis == 0 else 1)} | (
            {} if side is None else {"maxItems": side}
        )
        if shape.gaps and axis == len(shape.sides) - 1:
            form = {"anyOf": [{"type": "null"}, form]}
    return form


def described(kind: type) -> tuple[str, dict[str, str]]:
    """A part's docstring: its first paragraph, and the words of each attribute, also of several in one line."""
    head, _, tail = (kind.__doc__ or "").partition("Attributes:")
    rows = re.findall(r"^ {8}([\w, ]+): (.*(?:\n {9,}.*)*)", tail, re.M)
    texts = {name.strip(): " ".join(words.split()) for names, words in rows for name in names.split(",")}
    return " ".join(head.split("\n\n")[0].split()), texts
