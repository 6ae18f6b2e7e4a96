"""JSON Schemas of the documents, and Kotlin's table, from their types: `python -m tools.formats [--check]`."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from camssf.documents.document import Document
from camssf.documents.schema import schema
from camssf_app.orders import Orders
from camssf_colour.document import ColourDocument
from camssf_colour.picture_document import PictureDocument
from camssf_colour.spectrum_document import SpectrumDocument
from camssf_fleet.documents import (
    DeletionDocument,
    DriftDocument,
    SpreadDocument,
    VerificationDocument,
)
from camssf_fleet.passport.claims import Claims
from tools import kotlin_forms
from tools.pages import markdown_table, parser, write_or_check

COMMAND = "python -m tools.formats"
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


def tables(form: dict[str, Any]) -> str:
    """A table for each part of a document: its fields, whether they must be there, what they hold."""
    parts = {"The document": form, **form["$defs"]}
    return "\n\n".join(_part(name, part) for name, part in parts.items() if "properties" in part)


def _part(name: str, form: dict[str, Any]) -> str:
    rows = [
        (f"`{field}`" + ("" if field in form["required"] else " ?"), _words(held), held.get("description", ""))
        for field, held in form["properties"].items()
    ]
    return f"### {name}\n\n{form['description']}\n\n{markdown_table(('field', 'holds', 'meaning'), rows)}"


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


def main(argv: Sequence[str] | None = None) -> int:
    """Write or check the schemas."""
    options = parser(COMMAND, __doc__).parse_args(argv)
    written: dict[str, str | None] = {
        f"{name}.schema.json": json.dumps(schema(kind), ensure_ascii=False, indent=1) + "\n"
        for name, kind in DOCUMENTS.items()
    }
    table: dict[str, str | None] = {kotlin_forms.FILE.name: kotlin_forms.table()}
    return max(
        write_or_check(COMMAND, folder, contents, check=options.check)
        for folder, contents in ((FOLDER, written), (kotlin_forms.FILE.parent, table))
    )


if __name__ == "__main__":
    sys.exit(main())
