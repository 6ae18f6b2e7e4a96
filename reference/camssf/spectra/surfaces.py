"""Real surfaces and standard observers on the grid, from data/colour.json, which `tools.surfaces` writes."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra.bundled import linear
from camssf.spectra.sampled import frozen

FORMAT = "camssf-surfaces/1"
OBSERVERS = ("1931", "1964")


@cache
def surfaces() -> Floats:
    """190 reflectances of real surfaces, (190, 681): rawtoaces' training data, linear between 5-nm nodes."""
    return _rows(_table()["surfaces"])


@cache
def observer(name: str) -> Floats:
    """Colour-matching functions x̄ ȳ z̄, (681, 3): CIE 1931 (2°) or CIE 1964 (10°), linear between 1-nm nodes.

    Raises:
        InvalidArgument: unknown name.
    """
    if name not in OBSERVERS:
        raise InvalidArgument(f"No observer is called {name!r}.", f"Take {' or '.join(OBSERVERS)}.")
    table = _table()["observers"]
    return frozen(_rows(table | {"values": table["values"][name]}).T)


@cache
def _table() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((files("camssf") / "data" / "colour.json").read_text("utf-8"))
    return found


def _rows(table: dict[str, Any]) -> Floats:
    return frozen(np.stack([linear(table | {"values": row}) for row in table["values"]]))
