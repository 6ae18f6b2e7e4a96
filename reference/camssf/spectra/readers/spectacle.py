"""Reads SPECTACLE's calibration/spectral_response.csv: λ, R, G, B, G2 and four errors, with comments as header."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra.text import numbers_of

COLUMNS = 9


def claims(text: str) -> bool:
    """Whether the first line that is not a comment has nine numbers."""
    first = next((line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")), "")
    return len(numbers_of(first.split(",")) or ()) == COLUMNS


def read(text: str, path: Path) -> dict[str, tuple[Floats, Floats]]:
    """The one camera, named after the file; green is the mean of G and G2.

    Raises:
        InvalidArgument: a line without nine numbers.
    """
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    table = [numbers_of(line.split(",")) for line in lines]
    if any(len(row or ()) != COLUMNS for row in table):
        raise InvalidArgument(
            f"{path} has a line without nine numbers.", "SPECTACLE writes λ, R, G, B, G2 and four errors."
        )
    curves = np.array(table, dtype=np.float64)
    green = 0.5 * (curves[:, 2] + curves[:, 4])
    return {path.stem: (curves[:, 0], np.column_stack([curves[:, 1], green, curves[:, 3]]))}
