"""Parses strict JSON: no key twice in an object, no NaN, no infinity."""

from __future__ import annotations

import json
from typing import Any, NoReturn


def parse_strict(text: str) -> Any:
    """Parse the text.

    Raises:
        ValueError, RecursionError: it is not strict JSON, or nested too deep.
    """
    return json.loads(text, object_pairs_hook=_distinct, parse_constant=_no_constant)


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        raise ValueError("the same key twice in one object")
    return members


def _no_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")
