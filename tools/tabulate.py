"""Makes data/spectra.json from colour-science: the lamps and charts that Python and Kotlin read.

`python -m tools.tabulate` writes the file, `--check` tests that colour-science, the families and the layouts still
give the same. Reading a lamp or a chart does not use this module.
"""

from __future__ import annotations

import hashlib
import sys
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from camssf.grid import STEP, WAVELENGTHS
from camssf.spectra import colour_science
from camssf.spectra.bundled import FORMAT
from camssf.spectra.families import FAMILIES, DrawnKind, Temperature, principal_modes
from camssf.spectra.layouts import LAYOUTS
from camssf.spectra.limits import DIMMEST, NAMED_LAMP, limits
from tools.lamp_kinds import drawn_kind
from tools.pages import DATA, Json, made_files

PLACE = DATA / "spectra.json"
ILLUMINANTS = (
    *("A", "B", "C", "D50", "D55", "D60", "D65", "D75", "E", "ID50", "ID65"),
    *(f"FL{i}" for i in range(1, 13)),
    *(f"FL3.{i}" for i in range(1, 16)),
    *(f"HP{i}" for i in range(1, 6)),
    *(f"LED-B{i}" for i in range(1, 6)),
    *("LED-BH1", "LED-RGB1", "LED-V1", "LED-V2"),
)
KELVIN = {"A": 2856.0, "D50": 5003.0, "D55": 5503.0, "D60": 6003.0, "D65": 6504.0, "D75": 7504.0}
"""Colour temperatures of lamps that have one, K, for c₂ = 1.4388e-2 m K."""
TABLES = {"babelcolor": "BabelColor Average", "ohta": "ColorChecker N Ohta"}
"""Chart tables by the word after the colon in `classic24:ohta`; the first is the default."""
CHARTS = ("classic24", "nano24", "mini24", "passport24")
WHITE = "white 9.5 (.05 D)"
ROUNDING = {r"/weights/": 1e-9, r"/shapes/\d/(modes|mean)/": 2e-5, r"/(modes|mean)/": 2e-7}
"""What numbers of the families may differ by."""
EXACT = 1e-12
"""Largest difference between a family's modes and those computed from its stored weights."""


def tabulate() -> Json:
    """The file's content, from colour-science and camssf's own definitions."""
    science = colour_science()
    daylight = science.colorimetry.datasets.illuminants.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES
    return {
        "format": FORMAT,
        "origin": origin(),
        "grid": {"start": float(WAVELENGTHS[0]), "step": STEP, "count": WAVELENGTHS.size},
        "limits": limits(),
        "lamps": {name: even(science.SDS_ILLUMINANTS[name]) for name in ILLUMINANTS},
        "kelvin": KELVIN,
        "daylight": _daylight(daylight),
        "observer": observer(science.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]),
        "families": {name: _family(name, science) for name in FAMILIES},
        "charts": {"names": list(CHARTS), "tables": TABLES},
        "tables": {name: _chart(science.SDS_COLOURCHECKERS[name]) for name in TABLES.values()},
        "layouts": {
            name: {"columns": each.columns, "rows": each.rows, "side": list(each.side), "products": each.products}
            for name, each in LAYOUTS.items()
        },
    }


def origin() -> Json:
    """Name, version, licence and URL of colour-science, the source of a file."""
    return {
        "name": "colour-science",
        "version": version("colour-science"),
        "licence": "BSD-3-Clause",
        "url": "https://github.com/colour-science/colour",
    }


def digest(values: Any) -> str:
    """SHA-256, hex, of numbers as little-endian float64 in row-major order."""
    return hashlib.sha256(np.asarray(values, "<f8").tobytes()).hexdigest()


def even(table: Any) -> Json:
    """A spectrum, or several, with equal wavelength steps, as JSON."""
    nm, values = np.asarray(table.wavelengths, float), np.asarray(table.values, float)
    step = float(nm[1] - nm[0])
    if not np.array_equal(nm, nm[0] + step * np.arange(nm.size)):
        raise ValueError(f"{table.name}: uneven wavelengths")
    return {"start": float(nm[0]), "step": step, "sha256": digest(values), "values": values.tolist()}


def _stacked(start: float, step: float, values: Json) -> Json:
    """Several spectra of the same wavelengths, as JSON."""
    return {"start": start, "step": step, "sha256": digest(list(values.values()))} | values


def _daylight(parts: Any) -> Json:
    spectra = {name: even(parts[name]) for name in ("S0", "S1", "S2")}
    start, step = spectra["S0"]["start"], spectra["S0"]["step"]
    return _stacked(start, step, {name: each["values"] for name, each in spectra.items()})


def observer(table: Any) -> Json:
    """The colour-matching functions from 380 to 720 nm."""
    rows = [i for i, nm in enumerate(table.wavelengths) if WAVELENGTHS[0] <= nm <= WAVELENGTHS[-1]]
    start, after = (float(table.wavelengths[i]) for i in rows[:2])
    return _stacked(start, after - start, {xyz: table.values[rows, c].tolist() for c, xyz in enumerate("xyz")})


def _chart(table: Any) -> Json:
    rows, names = [even(each) for each in table.values()], [str(name) for name in table]
    values = [row["values"] for row in rows]
    head = {"start": rows[0]["start"], "step": rows[0]["step"], "white": names.index(WHITE), "patches": names}
    return head | {"sha256": digest(values), "values": values}


def _family(name: str, science: Any) -> Json:
    """The definition of a family; for a family of tabulated lamps also the weights that give its modes.

    With L_i divided by its mean over the grid: the mean lamp is the mean of L_i; mode k is Σ_i weights[k][i] L_i
    divided by the larger of the mean lamp and `dimmest` times its peak.
    """
    family = FAMILIES[name]
    if isinstance(family, Temperature):
        return {"formula": "planck", "centre": family.centre, "spread": family.spread, "tolerance": NAMED_LAMP}
    if isinstance(family, DrawnKind):
        return {"source": family.words} | drawn_kind(name)
    tables = [science.SDS_ILLUMINANTS[member] for member in family.members]
    lamps = [np.interp(WAVELENGTHS, table.wavelengths, table.values) for table in tables]
    mean, modes = principal_modes(lamps, family.components)
    modes = modes * np.maximum(mean, DIMMEST * mean.max())
    shapes = np.stack([lamp / lamp.mean() for lamp in lamps])
    weights = modes @ np.linalg.pinv(shapes - mean)
    weights *= np.sign(np.take_along_axis(weights, np.abs(weights).argmax(axis=1)[:, None], axis=1))
    if np.abs(np.abs(weights @ shapes) - np.abs(modes)).max() > EXACT:
        raise ValueError(f"{name}: the modes are no sums of the members")
    head = {"members": list(family.members), "dimmest": DIMMEST, "tolerance": family.left}
    return head | {"weights": weights.tolist()}


main = partial(made_files, __spec__, __doc__, lambda: {PLACE: tabulate()}, bounds=ROUNDING)

if __name__ == "__main__":
    sys.exit(main())
