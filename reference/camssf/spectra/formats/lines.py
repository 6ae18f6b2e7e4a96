"""Meter files that name a wavelength a line, some in two steps, 5 nm and 1 nm: what they have in common."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats

FEWEST = 6
"""Lines by which a file is known."""


def enough(pattern: re.Pattern[str], text: str) -> bool:
    """Whether enough lines are of the pattern."""
    return len(pattern.findall(text)) >= FEWEST


def finest(pattern: re.Pattern[str], text: str, path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and power, (w,) each: the table with the finest steps.

    Args:
        pattern: of a line: wavelength and value.
        text: of the file.
        path: of it.

    Raises:
        InvalidArgument: a value that is no number, or several in a line.
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
