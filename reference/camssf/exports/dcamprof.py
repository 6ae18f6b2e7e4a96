"""Writes DCamProf's camera SSF file: JSON, the three curves on one scale, every 5 nm."""

from __future__ import annotations

import json

from camssf.exports.curves import ExportedCurves
from camssf.grid import WAVELENGTHS

_STEP = 5


def dcamprof(curves: ExportedCurves) -> str:
    """The file's text. DCamProf does not read `description`."""
    red, green, blue = curves.own[:: 2 * _STEP].T.tolist()
    document = {
        "camera_name": curves.camera,
        "description": curves.description,
        "ssf_bands": [int(WAVELENGTHS[0]), int(WAVELENGTHS[-1]), _STEP],
        "red_ssf": red,
        "green_ssf": green,
        "blue_ssf": blue,
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
