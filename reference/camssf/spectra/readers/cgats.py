"""Reads the keywords of Argyll's `.sp` and `.ti3` outside the CGATS.17 table: exact wavelengths, measurement type."""

from __future__ import annotations

import re

import numpy as np

from camssf.grid import Floats

_ROUNDED = 0.51
"""Largest rounding error, nm, of wavelengths in field names: SPEC_383 is 383.33."""


def shows_light(text: str) -> bool:
    """Whether the file holds light; False for a reflectance or transmittance."""
    found = re.search(r'^MEAS_TYPE\s+"?(\w+)', text, re.MULTILINE)
    return found is None or found[1] not in ("REFLECTIVE", "TRANSMISSIVE")


def exact_wavelengths(named: Floats, text: str) -> Floats:
    """Wavelengths (w,) from the file's number of bands, start and end, if they fit those of the names."""
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
