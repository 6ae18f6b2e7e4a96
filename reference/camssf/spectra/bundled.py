"""The bundled tables of lamps, charts, real surfaces and standard observers, CIE's formulas, and both interpolations.

The same as in Kotlin. `python -m tools.tabulate` writes data/spectra.json from colour-science, `tools.surfaces`
data/colour.json. docs/tables.md gives every formula and the
order of its operations, so that another language reproduces the numbers to the last bit or two.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats, frozen

FORMAT = "camssf-spectra/1"
C2 = 1.4388e-2
"""Planck's second constant, m K (CIE 15, ITS-90)."""
_OUTER = ((884, -1960, 3033, -2648, 1080, -180), (508, -540, 488, -367, 144, -24))
"""Sprague: coefficients, times 209, of the two points beyond an end (outermost first) from the six at that end."""
_INNER = (
    (2, -16, 0, 16, -2, 0),
    (-1, 16, -30, 16, -1, 0),
    (-9, 39, -70, 66, -33, 7),
    (13, -64, 126, -124, 61, -12),
    (-5, 25, -50, 50, -25, 5),
)
"""Sprague: coefficients of X to X⁵, times 24, from the points i - 2 to i + 3."""


@cache
def bundled() -> dict[str, Any]:
    """The content of data/spectra.json."""
    table: dict[str, Any] = json.loads((files("camssf") / "data" / "spectra.json").read_text("utf-8"))
    return table


@cache
def illuminant(name: str) -> Floats:
    """A tabulated CIE illuminant on the grid, (681,); linear between its nodes."""
    return frozen(linear(bundled()["lamps"][name]))


@cache
def reflectances(table: str) -> Floats:
    """A bundled chart table on the grid, (n, 681); smooth between its nodes."""
    entry = bundled()["tables"][table]
    return frozen(np.stack([sprague(entry["start"], entry["step"], np.array(row)) for row in entry["values"]]))


def planck(kelvin: float) -> Floats:
    """Planck's law on the grid, (681,), any scale: λ⁻⁵ / (exp(c₂ / λT) - 1)."""
    metres = WAVELENGTHS * 1e-9
    return np.asarray((WAVELENGTHS / 560.0) ** -5.0 / np.expm1(C2 / (metres * kelvin)))


def daylight(kelvin: float) -> Floats:
    """CIE daylight of a correlated colour temperature, 4000 to 25,000 K, on the grid, (681,): CIE 15.

    M₁ and M₂ are rounded to three decimals, as CIE does for its D illuminants.
    """
    t = 1e3 / kelvin
    if kelvin <= 7000.0:
        x = ((-4.6070 * t + 2.9678) * t + 0.09911) * t + 0.244063
    else:
        x = ((-2.0064 * t + 1.9018) * t + 0.24748) * t + 0.237040
    y = (-3.0 * x + 2.87) * x - 0.275
    m = 0.0241 + 0.2562 * x - 0.7341 * y
    m1 = np.rint(1000.0 * ((-1.3515 - 1.7703 * x + 5.9114 * y) / m)) / 1000.0
    m2 = np.rint(1000.0 * ((0.03 - 31.4424 * x + 30.0717 * y) / m)) / 1000.0
    part = bundled()["daylight"]
    s0, s1, s2 = (np.array(part[name]) for name in ("S0", "S1", "S2"))
    return linear({"start": part["start"], "step": part["step"], "values": s0 + m1 * s1 + m2 * s2})


def linear(table: dict[str, Any]) -> Floats:
    """Interpolate even nodes linearly to the grid, (681,); constant outside."""
    nodes = table["start"] + table["step"] * np.arange(len(table["values"]))
    return np.asarray(np.interp(WAVELENGTHS, nodes, table["values"]))


def sprague(start: float, step: float, values: Floats) -> Floats:
    """Interpolate at least 6 even nodes to the grid, (681,), by Sprague's polynomials (CIE 167:2005); constant
    outside.

    With i the node at or below λ (at most the last but one) and X = (λ - λ_i) / step:
    r_i + X (a₁ + X (a₂ + X (a₃ + X (a₄ + X a₅)))), where each a is a sum from i - 2 to i + 3, in this order.
    """
    last = len(values) - 1
    left = [_weighted(row, values[:6]) / 209.0 for row in _OUTER]
    right = [_weighted(row, values[:-7:-1]) / 209.0 for row in _OUTER[::-1]]
    r = np.concatenate([left, values, right])  # node i lies at i + 2
    at = np.clip(WAVELENGTHS, start, start + step * last)
    i = np.minimum(((at - start) / step).astype(np.int64), last - 1)
    X = (at - (start + step * i)) / step
    a = [_weighted(row, [r[i + k] for k in range(6)]) / 24.0 for row in _INNER]
    total = np.zeros_like(at)
    for part in reversed(a):
        total = X * (part + total)
    return np.asarray(r[i + 2] + total)


def _weighted(weights: tuple[int, ...], points: Any) -> Any:
    total = weights[0] * points[0]
    for weight, point in zip(weights[1:], points[1:], strict=True):
        total = total + weight * point
    return total


COLOUR_FORMAT = "camssf-surfaces/1"
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
    return _rows(_colour_table()["surfaces"])


@cache
def surface_sets() -> tuple[SurfaceSet, ...]:
    """The library: 760 general surfaces and 97 skins, each set with its origin."""
    table = _colour_table()
    library, training = table["library"], table["surfaces"]
    thinned = np.array(training["values"])[:, :: round(library["step"] / training["step"])]
    sets = [SurfaceSet("rawtoaces", "general", training["name"], frozen(thinned))]
    for entry in library["sets"]:
        values = frozen(np.array(entry["values"]) * library["unit"])
        sets.append(SurfaceSet(entry["name"], entry["kind"], entry["origin"], values))
    return tuple(sets)


@cache
def absorbers() -> dict[str, Floats]:
    """Absorption (35,) of oxyhaemoglobin, deoxyhaemoglobin and bilirubin at SURFACE_NODES; 1 at its largest."""
    return {name: frozen(np.array(row)) for name, row in _colour_table()["absorbers"]["values"].items()}


@cache
def absorber_changes() -> dict[str, tuple[float, float]]:
    """How much each absorber of a skin changes within one person: the standard deviations of -Δ ln R at its largest
    absorption, of a layer above everything and of one that light reaches the less the more it is absorbed.
    """
    return {name: (above, below) for name, (above, below) in _colour_table()["absorbers"]["changes"].items()}


@cache
def observer(name: str) -> Floats:
    """Colour-matching functions x̄ ȳ z̄, (681, 3): CIE 1931 (2°) or CIE 1964 (10°), linear between 1-nm nodes.

    Raises:
        InvalidArgument: unknown name.
    """
    if name not in OBSERVERS:
        raise InvalidArgument(f"No observer is called {name!r}.", f"Take {' or '.join(OBSERVERS)}.")
    table = (bundled() if name == "1931" else _colour_table())["observer"]
    return frozen(_rows(table | {"values": [table[axis] for axis in "xyz"]}).T)


def correlated_temperature(xyz: Floats) -> Floats:
    """Correlated colour temperature of XYZ (..., 3), CIE 1931, K: McCamy (Color Res. Appl. 1992, 17, 142).

    T = -449 n³ + 3525 n² - 6823.3 n + 5520.33, n = (x - 0.3320) / (y - 0.1858).
    """
    x, y = np.moveaxis(xyz[..., :2] / xyz.sum(axis=-1, keepdims=True), -1, 0)
    n = (x - 0.3320) / (y - 0.1858)
    return np.asarray(((-449.0 * n + 3525.0) * n - 6823.3) * n + 5520.33)


@cache
def _colour_table() -> dict[str, Any]:
    table: dict[str, Any] = json.loads((files("camssf") / "data" / "colour.json").read_text("utf-8"))
    return table


def _rows(table: dict[str, Any]) -> Floats:
    return frozen(np.stack([linear(table | {"values": row}) for row in table["values"]]))
