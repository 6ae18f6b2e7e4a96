"""Resolves common lamp names (data/lamp-names.json) to known lamps, or refuses them with advice."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from camssf.errors import InvalidArgument
from camssf.spectra.text import plain

FORMAT = "camssf-lamp-names/1"


@dataclass(frozen=True)
class LampAlias:
    """Common names with the same meaning.

    Attributes:
        names: as people write them.
        what: their meaning.
        lamp: the known lamp; "" if the names are refused.
        advice: what to give instead, if the names are refused.
    """

    names: tuple[str, ...]
    what: str
    lamp: str
    advice: str


@cache
def lamp_aliases() -> tuple[LampAlias, ...]:
    """All entries of the file, in its order."""
    table: dict[str, Any] = json.loads((files("camssf") / "data" / "lamp-names.json").read_text("utf-8"))
    return tuple(
        LampAlias(tuple(each["names"]), each["what"], each.get("lamp", ""), each.get("advice", ""))
        for each in table["names"]
    )


def resolve_lamp_alias(text: str) -> str | None:
    """The known lamp's name for a common name; None if the file does not have it.

    Raises:
        InvalidArgument: the name is ambiguous.
    """
    found = _by_name().get(plain(text))
    if found is None:
        return None
    if not found.lamp:
        raise InvalidArgument(f"{text!r} does not say which lamp it is. {found.what}", found.advice)
    return found.lamp


@cache
def _by_name() -> dict[str, LampAlias]:
    return {plain(name): each for each in lamp_aliases() for name in each.names}
