"""What Argyll's `.sp` and `.ti3` say beside CGATS.17's table: exact wavelengths, and what was measured."""

from __future__ import annotations

import re

import numpy as np

from camssf.grid import Floats

_ROUNDED = 0.51
"""Names of fields are whole nanometres: SPEC_383 is 383.33."""


def shows_light(text: str) -> bool:
    """False for a reflectance or a transmittance."""
    found = re.search(r'^MEAS_TYPE\s+"?(\w+)', text, re.MULTILINE)
    return found is None or found[1] not in ("REFLECTIVE", "TRANSMISSIVE")


def exact_wavelengths(named: Floats, text: str) -> Floats:
    """Wavelengths (w,) by number of bands, first and last, where the file tells them and they fit the names."""
    told = [
        re.search(rf'^SPECTRAL_{word}\s+"?([0-9.]+)', text, re.MULTILINE) for word in ("BANDS", "START_NM", "END_NM")
    ]
    try:
        bands, first, last = (float(found[1]) if found else float("nan") for found in told)
    except ValueError:
        return named
    if bands != len(named):
        return named
    exact = np.linspace(first, last, len(named))
    return exact if np.abs(exact - named).max() < _ROUNDED else named
