"""Reads `data/finder.json`: the limits of the chart search and the colours of the charts, as Kotlin does."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from camssf.grid import Floats
from camssf.rules import rules

FORMAT = "camssf-finder/1"
PLACE = files("camssf") / "data" / "finder.json"
CHROMA = rules().number("pose.chroma")


@dataclass(frozen=True)
class ChartColours:
    """A kind of chart that the finder can distinguish: a grid and its colours.

    Classic, Nano, Mini and the Passport's classic page are one kind: they have the same 24 colours in one grid. A
    picture does not show their sizes, and the gap between their patches (0.12 to 0.17 of the pitch) is measured only
    when the pose is refined on the mosaic.

    Attributes:
        name: name of a layout of this kind, or of the user's own layout.
        columns, rows: number of patches.
        side: edge of a patch in pitches, along x and y.
        colours: (n, 3) signals of the camera of `plain_signals`, any unit.
    """

    name: str
    columns: int
    rows: int
    side: tuple[float, float]
    colours: Floats


@cache
def _stored() -> dict[str, Any]:
    stored: dict[str, Any] = json.loads(PLACE.read_text("utf-8"))
    if stored["format"] != FORMAT:
        raise ValueError("finder.json is of another version")
    return stored


def limit(name: str) -> Any:
    """A limit of the chart search, a number or a list of numbers; the file says what it limits, and in what unit."""
    return _stored()["limits"][name]["value"]


@cache
def chart_colours() -> tuple[ChartColours, ...]:
    """All kinds of charts that the finder recognises."""
    return tuple(
        ChartColours(
            name,
            stored["columns"],
            stored["rows"],
            (stored["side"], stored["side"]),
            np.array(stored["colours"], np.float64),
        )
        for name, stored in _stored()["kinds"].items()
    )
