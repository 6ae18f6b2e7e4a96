"""What people call lamps (data/lamp-names.json): read as one that is known, or answered with what to say instead."""

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
class Spoken:
    """Names with one answer.

    Attributes:
        names: as people write them.
        what: they mean.
        lamp: that they are read as; "" where they are refused.
        advice: what to say instead, where they are refused.
    """

    names: tuple[str, ...]
    what: str
    lamp: str
    advice: str


@cache
def spoken() -> tuple[Spoken, ...]:
    """The whole file, in its order."""
    table: dict[str, Any] = json.loads((files("camssf") / "data" / "lamp-names.json").read_text("utf-8"))
    return tuple(
        Spoken(tuple(each["names"]), each["what"], each.get("lamp", ""), each.get("advice", ""))
        for each in table["names"]
    )


def understood(text: str) -> str | None:
    """The name of a known lamp that this one means; None where nobody is known to say so.

    Raises:
        InvalidArgument: the name leaves open which lamp it is.
    """
    found = _by_name().get(plain(text))
    if found is None:
        return None
    if not found.lamp:
        raise InvalidArgument(f"{text!r} does not say which lamp it is. {found.what}", found.advice)
    return found.lamp


@cache
def _by_name() -> dict[str, Spoken]:
    return {plain(name): each for each in spoken() for name in each.names}
