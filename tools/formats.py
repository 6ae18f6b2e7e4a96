"""JSON Schemas of the documents, and the table of their types for Kotlin: `python -m tools.formats [--check]`.

For Kotlin: each part's fields, bounds and defaults.
"""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from camssf.documents.document import Document
from camssf.documents.forms import fields_of, mark_of, to_plain
from camssf.documents.schema import schema
from camssf.shapes import MOST, Argument, Bounds, Pattern, Shape, Words
from camssf_app.orders import Orders
from camssf_colour.document import ColourDocument
from camssf_colour.picture_document import PictureDocument
from camssf_colour.spectrum_document import SpectrumDocument
from camssf_fleet.documents import DeletionDocument, DriftDocument, SpreadDocument, VerificationDocument
from camssf_fleet.passport.claims import Claims
from tools.pages import DATA, made_files, markdown_table

FOLDER = Path(__file__).parents[1] / "docs" / "schemas"
DOCUMENTS: dict[str, type] = {
    "document": Document,
    "passport": Claims,
    "colour": ColourDocument,
    "picture": PictureDocument,
    "spectrum": SpectrumDocument,
    "spread": SpreadDocument,
    "drift": DriftDocument,
    "verification": VerificationDocument,
    "deletion": DeletionDocument,
    "order": Orders,
}
"""The types of the documents by the names of their schemas."""
FORMS = DATA / "forms.json"
LONGEST = 4096
"""Characters of a text without bounds."""


def tables(form: dict[str, Any]) -> str:
    """A table for each part of a document: its fields, whether they must be there, what they hold."""
    parts = []
    for name, part in {"The document": form, **form["$defs"]}.items():
        rows = [
            (f"`{field}`" + ("" if field in part["required"] else " ?"), _words(held), held.get("description", ""))
            for field, held in part.get("properties", {}).items()
        ]
        if rows:
            parts.append(
                f"### {name}\n\n{part['description']}\n\n{markdown_table(('field', 'holds', 'meaning'), rows)}"
            )
    return "\n\n".join(parts)


def _words(form: dict[str, Any]) -> str:
    """What a field holds, in short."""
    if "$ref" in form:
        name = form["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.casefold()})"
    if "const" in form:
        return json.dumps(form["const"])
    if "enum" in form:
        return " or ".join(json.dumps(word) for word in form["enum"])
    if "anyOf" in form:
        return " or ".join(_words(inner) for inner in form["anyOf"])
    if form.get("type") == "array":
        size = form.get("maxItems") if form.get("minItems") == form.get("maxItems") else None
        inner = _words(form["items"]) if isinstance(form.get("items"), dict) else _words(form["prefixItems"][0])
        count = size or len(form.get("prefixItems", ())) or ""
        return f"list of {count} × {inner}" if count else f"list of {inner}"
    if form.get("type") == "object" and isinstance(form.get("additionalProperties"), dict):
        return f"object of {_words(form['additionalProperties'])}"
    kind = form.get("type", "anything")
    kind = kind if isinstance(kind, str) else " or ".join(kind)
    return {"string": "text", "integer": "whole number"}.get(kind, kind)


def kotlin_table() -> str:
    """The content of data/forms.json, the types of the document for Kotlin: one field a line."""
    parts: dict[str, Any] = {}
    _form_of(Document, parts)
    rows, one_line = [], partial(json.dumps, ensure_ascii=False, separators=(",", ":"))
    for name, part in parts.items():
        fields = ",\n".join(f"  {one_line(key)}: {one_line(form)}" for key, form in part.items())
        rows.append(f" {one_line(name)}: {{\n{fields}\n }}")
    return "{\n" + ",\n".join(rows) + "\n}\n"


def _form_of(kind: Any, parts: dict[str, Any]) -> None:
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
    _form_of(hint, parts)
    return {"is": "part", "name": hint.__name__}


def _limits(bounds: Bounds | Shape) -> dict[str, Any]:
    """The bounds that differ from those of any number."""
    least = {} if bounds.least == -MOST else {"least": bounds.least}
    return least | ({} if bounds.most == MOST else {"most": bounds.most})


def made() -> dict[Path, str]:
    """The schemas and Kotlin's table."""
    texts = {name: json.dumps(schema(kind), ensure_ascii=False, indent=1) + "\n" for name, kind in DOCUMENTS.items()}
    return {FOLDER / f"{name}.schema.json": text for name, text in texts.items()} | {FORMS: kotlin_table()}


main = partial(made_files, __spec__, __doc__, made)

if __name__ == "__main__":
    sys.exit(main())
