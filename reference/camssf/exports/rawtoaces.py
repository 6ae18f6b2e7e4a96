"""Writes a camera file of rawtoaces: JSON in its schema 1.0.0.

rawtoaces needs 81 samples, 380 to 780 nm every 5 nm. Above 720 nm, where cameras have an infrared filter, the curves
are unknown: 0 is written, and the file's comments state this.
"""

from __future__ import annotations

import json
from datetime import datetime

from camssf.exports.curves import ExportedCurves
from camssf.grid import WAVELENGTHS

SCHEMA_VERSION = "1.0.0"
_LAST = 780


def rawtoaces(curves: ExportedCurves, created: datetime, licence: str) -> str:
    """The file's text.

    Args:
        curves: every tenth sample is written.
        created: time in the header, UTC.
        licence: licence of the curves.
    """
    rows = {f"{nm:.0f}": row for nm, row in zip(WAVELENGTHS[::10], curves.own[::10].tolist(), strict=True)}
    rows |= {str(nm): [0.0, 0.0, 0.0] for nm in range(725, _LAST + 1, 5)}
    document = {
        "header": {
            "schema_version": SCHEMA_VERSION,
            "manufacturer": curves.make or None,
            "model": curves.model or None,
            "type": "camera",
            "description": curves.description,
            "document_creator": curves.generator,
            "unique_identifier": curves.sha256,
            "measurement_equipment": "photos of a colour chart",
            "laboratory": None,
            "document_creation_date": f"{created:%Y-%m-%dT%H:%M:%SZ}",
            "comments": (
                "The channels keep the camera's own scale; the largest peak is 1. Nothing is known above 720 nm: 0 "
                "stands there."
            ),
            "license": licence,
        },
        "spectral_data": {
            "units": "relative",
            "reflection_geometry": None,
            "transmission_geometry": None,
            "bandwidth_FWHM": None,
            "bandwidth_corrected": None,
            "index": {"main": ["R", "G", "B"]},
            "data": {"main": rows},
        },
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
