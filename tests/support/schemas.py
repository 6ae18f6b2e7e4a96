"""What every schema of a document must hold."""

from __future__ import annotations

from typing import Any

import pytest


def check_schema(schema: dict[str, Any]) -> None:
    """It is a sound schema, and each of its fields says what it is."""
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(schema)

    def walk(node: Any, where: str) -> None:
        for name, each in node.get("properties", {}).items():
            if isinstance(each, dict) and each:
                assert each.get("description") or set(each) == {"const"}, f"{where}.{name}"
                walk(each, f"{where}.{name}")

    for name, part in {"": schema, **schema["$defs"]}.items():
        walk(part, name)
