"""Shared functions for meter files with one wavelength per line, some with two tables, every 5 nm and every 1 nm."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats

FEWEST = 6
"""Smallest number of matching lines by which a format is recognised."""


def enough(pattern: re.Pattern[str], text: str) -> bool:
    """Whether at least FEWEST lines match the pattern."""
    return len(pattern.findall(text)) >= FEWEST


def finest(pattern: re.Pattern[str], text: str, path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and power, (w,) each, of the table with the finest steps.

    Args:
        pattern: of a line, with groups for wavelength and value.
        text: of the file.
        path: of the file.

    Raises:
        InvalidArgument: a value is not a single number.
    """
    tables: list[list[tuple[float, float]]] = []
    for match in pattern.finditer(text):
        nm = float(match[1])
        try:
            pair = (nm, float(match[2]))
        except ValueError as error:
            raise InvalidArgument(
                f"{path} has no single number at {match[1]} nm.", "Export one measurement a file, and anew."
            ) from error
        if not tables or nm <= tables[-1][-1][0]:
            tables.append([])
        tables[-1].append(pair)
    best = min(tables, key=lambda table: (table[-1][0] - table[0][0] + 1.0) / len(table))
    found = np.array(best)
    return found[:, 0], found[:, 1]
