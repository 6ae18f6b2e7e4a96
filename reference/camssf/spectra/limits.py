"""Limits of what is read: photos, tables of spectra, charts and lamps; and their tolerances, one standard deviation.

`python -m tools.tabulate` writes each one to data/spectra.json, from which Kotlin reads it.
"""

from __future__ import annotations

from typing import Any

SMALLEST_PHOTO = 64
"""Smallest side, px, of a photo of a chart."""
LARGEST_FILE = 20_000_000
"""Bytes of a table."""
PREAMBLE = 40
"""Number of lines in which a header is searched; instruments write a preamble."""
FEWEST_IN_HEADER = 10
"""Smallest number of wavelengths by which a row is a header."""
FEWEST_LABELLED = 6
"""Smallest number of lines with a named wavelength by which a meter's file is recognised."""
SAMPLE = 1000
"""Number of lines by which the separator is chosen."""
LONGEST_CELL = 60
"""Largest length of a cell that names a wavelength."""
LONGEST_QUOTE = 60
"""Characters of a file that a message quotes."""
NAMED = (200.0, 2500.0)
"""Range of a wavelength that a cell names, nm."""
ROUNDED = 0.51
"""Largest rounding error, nm, of wavelengths in field names: SPEC_383 is 383.33."""
LARGEST_DEVIATION = 0.2
"""A third column without a header is a standard deviation if it stays below this part of the largest power."""
NANOMETRES = (100.0, 20_000.0)
"""Range of wavelengths that may be in nm."""
ANGSTROMS = (3000.0, 12_000.0)
"""Wavelengths that all lie in this range are in ångströms."""
OTHER_UNITS = {
    "micrometres": (0.1, 3.0),
    "metres": (1e-7, 3e-6),
    "ångströms": (2000.0, 12_000.0),
    "wavenumbers, 1/cm": (10_000.0, 50_000.0),
}
"""Range of wavelengths in other units."""
COVERED = (400.0, 700.0)
"""A table must cover this range, nm."""
FEWEST_WAVELENGTHS = 6
"""Smallest number of wavelengths of a table."""
WIDEST_STEP = 20.0
"""Largest step between wavelengths in the grid, nm."""
SMALLEST_STEP = 1e-3
"""Smallest step, nm; steps that differ by less count as even."""
TEMPERATURES = {"planck": (1000.0, 20_000.0), "daylight": (4000.0, 25_000.0)}
"""Ranges of a lamp's temperature, K."""
NAMED_LAMP = 0.02
"""Tolerance of a lamp given by name: real lamps differ from the table by batch, age, voltage, dimmer and room."""
MEASURED_LAMP = 0.01
"""Tolerance of a measured lamp: calibration error and noise of the spectrometer."""
NOISE_BELOW_ZERO = 0.005
"""Negative power down to this share of the peak is accepted as noise of a dark-corrected spectrometer."""
DIMMEST = 1e-3
"""Smallest power in parts of the peak; smaller values are raised to it, for finite logarithms and ratios."""
LARGEST_LAMP_TOLERANCE = 0.5
"""Tolerance of a lamp above which it is not known."""
LARGEST_KELVIN_TOLERANCE = 0.25
"""The same of its temperature, in parts of it."""
PUBLIC_CHART = 0.03
"""Tolerance of a public table: measured tables of the same product differ by 1 to 3 % RMS."""
MEASURED_CHART = 0.01
"""Tolerance of a measurement of the user's own chart: accuracy of the instrument, and fading since then."""
LARGEST_CHART_TOLERANCE = 0.5
"""Largest tolerance of a chart."""
PERCENT = 2.0
"""Reflectances are in percent if one is larger."""
LARGEST_REFLECTANCE = 1.2
"""Largest reflectance of a surface; fluorescent ones exceed 1."""
CARD = (0.05, LARGEST_REFLECTANCE)
"""Range of the reflectance of a white frame's target."""
REFERENCE = (0.02, LARGEST_REFLECTANCE)
"""Range of the reflectance of a white or grey reference in a photo."""
NEUTRAL = (430.0, 700.0)
"""Range, nm, in which a white patch's reflectance is even."""
UNEVEN = 0.08
"""Largest standard deviation of its reflectance there, relative to its mean."""
AS_WHITE = 0.95
"""Brightness of an SG's E5, relative to the brightest neutral patch, from which it is the white."""
OTHER_ORDER = 0.5
"""Colours are listed in another order if their misfit to it is below this part of that to the reading order."""
SIDES = (2, 30)
"""Range of a layout's number of columns and of rows."""
PATCHES = (12, 300)
"""Range of its number of patches."""
NARROWEST = 0.6
"""Smallest edge of a patch in pitches."""
LONGEST_NAME = 64
"""Characters of its name."""


def limits() -> dict[str, Any]:
    """All of them by their names in lower case."""
    return {name.lower(): value for name, value in globals().items() if name.isupper()}
