"""Curves → tables of text: plain CSV, SPECTACLE's CSV, and colour-science's, all on the camera's own scale."""

from __future__ import annotations

import numpy as np

from camssf.exports.curves import Curves
from camssf.grid import WAVELENGTHS, Floats


def plain_csv(curves: Curves) -> str:
    """`wavelength_nm,red,green,blue` and their standard deviations where known, 681 rows; comments begin with #."""
    head, columns = ["wavelength_nm", "red", "green", "blue"], [WAVELENGTHS, *curves.own.T]
    if (std := curves.own_std) is not None:
        head, columns = [*head, "red_std", "green_std", "blue_std"], [*columns, *std.T]
    return f"# {curves.description}\n{_rows(head, np.column_stack(columns))}"


def spectacle_csv(curves: Curves) -> str:
    """`calibration/spectral_response.csv` of SPECTACLE: λ, R, G, B, G2 and their errors, every 1 nm.

    Both greens are the one green that was measured. SPECTACLE needs errors, so a result without bands says nan.
    """
    std = np.full_like(curves.values, np.nan) if curves.own_std is None else curves.own_std
    four = [0, 1, 2, 1]
    table = np.column_stack([WAVELENGTHS, curves.own[:, four], std[:, four]])[::2]
    head = "wavelength,R,G,B,G2,R_err,G_err,B_err,G2_err"
    return f"# {curves.description}\n# {_rows([head], table)}"


def colour_csv(curves: Curves) -> str:
    """What `colour.read_sds_from_csv_file` reads: the names first, so what must be said comes after the numbers."""
    table = np.column_stack([WAVELENGTHS, curves.own])
    return f"{_rows(['wavelength', 'R', 'G', 'B'], table)}# {curves.description}\n"


def _rows(head: list[str], table: Floats) -> str:
    """A header and lines of numbers that give back every float64."""
    lines = (",".join([f"{row[0]:g}", *(repr(value + 0.0) for value in row[1:])]) for row in table.tolist())
    return "\n".join([",".join(head), *lines, ""])
