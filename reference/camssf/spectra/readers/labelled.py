"""Reads meters' files with a named wavelength in each line, as Sekonic's CSV and UPRtek's text.

Lines are `Spectral Data 380[nm],0.0012` (C-700, C-800, C-7000) or `380nm`, a tab and a value (CV600, MK350 ...; with
the suffix `.xls`). Some files have two tables, every 5 nm and every 1 nm; other lines are left out.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra.limits import FEWEST_LABELLED
from camssf.spectra.text import TextRow, number_of, numbers_in, rows_of, wavelength_of

_LIKELY = re.compile(r"(?:^|\r)[ \t\"]*(?:[a-zλ]|[0-9.,]+[ _-]*[\[(]?nm)", re.IGNORECASE | re.MULTILINE)
"""Beginnings of lines with letters before or behind a number; most tables have few of them."""


def claims(text: str) -> bool:
    """Whether enough lines have this form."""
    likely = len(_LIKELY.findall(text)) >= FEWEST_LABELLED and "BEGIN_DATA_FORMAT" not in text
    return likely and len(_rows(text)) >= FEWEST_LABELLED


def read(text: str, path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and power, (w,) each, of the table with the finest steps.

    Raises:
        InvalidArgument: a value is not a single number, or may have thousands separators.
    """
    rows = _rows(text)
    if (odd := next((row for row in rows if len(row.fields) != 2), None)) is not None:
        raise InvalidArgument(
            f"{path}, line {odd.line} has {len(odd.fields) - 1} values at {float(odd.fields[0]):g} nm.",
            "Export one measurement a file, and anew.",
        )
    table = numbers_in(rows, path, wavelengths=True)
    steps = np.sign(np.diff(table[:, 0]))
    parts = np.split(table, np.flatnonzero(steps != steps[0]) + 1)
    best = min(parts, key=lambda part: (abs(float(part[-1, 0] - part[0, 0])) + 1.0) / len(part))
    return best[:, 0], best[:, 1]


def _rows(text: str) -> list[TextRow]:
    """The lines of this form, with 380.0 in place of the name."""
    return [
        row._replace(fields=[repr(value), *row.fields[1:]])
        for row in rows_of(text)
        if number_of(row.fields[0]) is None and (value := wavelength_of(row.fields[0])) is not None
    ]
