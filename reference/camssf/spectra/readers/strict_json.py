"""Parses strict JSON for the readers of camera files."""

from __future__ import annotations

import json
from typing import Any

UNSOUND = (ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError, RecursionError)
"""Exceptions that can occur when a document has another form."""


def load(text: str) -> Any:
    """Parse a document without duplicate keys, NaN or Infinity.

    Raises:
        ValueError, RecursionError: it is not such JSON.
    """
    return json.loads(text, object_pairs_hook=_distinct, parse_constant=_never)


def number(value: Any) -> float:
    """Convert a JSON number.

    Raises:
        TypeError: it is something else.
        OverflowError: it is too large.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(value)
    return float(value)


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key occurs twice")
    return found


def _never(word: str) -> Any:
    raise ValueError(word)
