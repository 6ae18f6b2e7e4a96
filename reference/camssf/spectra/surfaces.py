"""Real surfaces and standard observers on the grid, from data/colour.json, which `tools.surfaces` writes."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
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
SURFACE_NODES: Floats = np.arange(380.0, 721.0, 10.0)
"""Wavelengths of the library's reflectances, (35,), nm; linear between them."""
SURFACE_NODES.setflags(write=False)


@dataclass(frozen=True)
class SurfaceSet:
    """Measured reflectances of one origin.

    Attributes:
        name: of the set.
        kind: "general" or "skin".
        origin: who measured them, and where they come from.
        values: (n, 35) reflectances at SURFACE_NODES.
    """

    name: str
    kind: str
    origin: str
    values: Floats = field(repr=False)


@cache
def surfaces() -> Floats:
    """190 reflectances of real surfaces, (190, 681): rawtoaces' training data, linear between 5-nm nodes."""
    return _rows(_table()["surfaces"])


@cache
def surface_sets() -> tuple[SurfaceSet, ...]:
    """The library: 760 general surfaces and 97 skins, each set with its origin."""
    table = _table()
    library, training = table["library"], table["surfaces"]
    thinned = np.array(training["values"])[:, :: round(library["step"] / training["step"])]
    sets = [SurfaceSet("rawtoaces", "general", training["name"], frozen(thinned))]
    for each in library["sets"]:
        values = frozen(np.array(each["values"]) * library["unit"])
        sets.append(SurfaceSet(each["name"], each["kind"], each["origin"], values))
    return tuple(sets)


@cache
def absorbers() -> dict[str, Floats]:
    """Absorption (35,) of oxyhaemoglobin, deoxyhaemoglobin and bilirubin at SURFACE_NODES; 1 at its largest."""
    return {name: frozen(np.array(row)) for name, row in _table()["absorbers"]["values"].items()}


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


def correlated_temperature(xyz: Floats) -> Floats:
    """Correlated colour temperature of XYZ (..., 3), CIE 1931, K: McCamy (Color Res. Appl. 1992, 17, 142).

    T = -449 n³ + 3525 n² - 6823.3 n + 5520.33, n = (x - 0.3320) / (y - 0.1858).
    """
    x, y = np.moveaxis(xyz[..., :2] / xyz.sum(axis=-1, keepdims=True), -1, 0)
    n = (x - 0.3320) / (y - 0.1858)
    return np.asarray(((-449.0 * n + 3525.0) * n - 6823.3) * n + 5520.33)


@cache
def _table() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((files("camssf") / "data" / "colour.json").read_text("utf-8"))
    return found


def _rows(table: dict[str, Any]) -> Floats:
    return frozen(np.stack([linear(table | {"values": row}) for row in table["values"]]))
