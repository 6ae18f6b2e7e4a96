"""Makes the charts' colours in data/finder.json from colour-science: the finder searches for them, in both languages.

Kotlin's guide also compares a preview's light with the luminances of the Classic, whose spectra are public.

`python -m tools.chart_colours` writes the file, `--check` tests that the sources still give the same. The finder's
limits in the same file are written by hand, and kept.
"""

from __future__ import annotations

import json
import sys
from functools import partial

import numpy as np

from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.find.chart_colours import FORMAT
from camssf.photo.find.search import plain_signals
from camssf.spectra import ChartTable, colour_science, read_chart
from camssf.spectra.layouts import LAYOUTS
from tools.pages import DATA, Json, made_files
from tools.tabulate import origin

PLACE = DATA / "finder.json"
SEMI_GLOSS = "ColorCheckerSG - After November 2014"


def tabulate() -> Json:
    """The file's content: its limits, and under a flat lamp a Gaussian camera's signals and luminances."""
    kinds: Json = {}
    for table in (read_chart("classic24"), semi_gloss()):
        layout = LAYOUTS[table.name]
        colours = plain_signals(table).round(4).tolist()
        kinds[table.name] = {
            "columns": layout.columns, "rows": layout.rows, "side": layout.side[0], "colours": colours,
        }  # fmt: skip
    v = np.exp(-(((WAVELENGTHS - 559) / 42) ** 2) / 2)  # V(λ), approximated
    kinds["classic24"]["luminance"] = (read_chart("classic24").values @ v / v.sum()).round(4).tolist()
    limits = json.loads(PLACE.read_text("utf-8"))["limits"]
    return {"format": FORMAT, "origin": origin(), "limits": limits, "kinds": kinds}


def semi_gloss() -> ChartTable:
    """The Digital SG chart from its published colours, each a sum of three bands; its spectra are not public."""
    science = colour_science()
    chart = science.CCS_COLOURCHECKERS[SEMI_GLOSS]
    names = [f"{column}{row}" for row in range(1, 11) for column in "ABCDEFGHIJKLMN"]
    xyz = np.array([science.xyY_to_XYZ(chart.data[name]) for name in names])
    shape = science.SpectralShape(380, 720, 0.5)
    observer = science.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    light = science.SDS_ILLUMINANTS["D50"].copy().align(shape).values
    rise = 1 / (1 + np.exp((WAVELENGTHS[:, None] - np.array([490, 585])) / 12))
    bands: Floats = np.stack([rise[:, 0], rise[:, 1] - rise[:, 0], 1 - rise[:, 1]], axis=1)
    to_xyz = (bands * light[:, None]).T @ observer / (light @ observer[:, 1])
    values = np.clip(xyz @ np.linalg.inv(to_xyz) @ bands.T, 0.005, 0.95)
    layout, white, error = LAYOUTS["sg140"], names.index("E5"), np.full(140, 0.03)
    return ChartTable("sg140", "bands", layout, tuple(names), WAVELENGTHS, values, error, white, "colour-science")


main = partial(made_files, __spec__, __doc__, lambda: {PLACE: tabulate()})

if __name__ == "__main__":
    sys.exit(main())
