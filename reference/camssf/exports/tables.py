"""Writes curves as plain CSV, SPECTACLE's CSV and colour-science's CSV, all on the camera's own scale."""

from __future__ import annotations

import numpy as np

from camssf.exports.curves import ExportedCurves
from camssf.grid import WAVELENGTHS, Floats


def plain_csv(curves: ExportedCurves) -> str:
    """`wavelength_nm,red,green,blue` and standard deviations if known, 681 rows; comments begin with #."""
    head, columns = ["wavelength_nm", "red", "green", "blue"], [WAVELENGTHS, *curves.own.T]
    if (std := curves.own_std) is not None:
        head, columns = [*head, "red_std", "green_std", "blue_std"], [*columns, *std.T]
    return f"# {curves.description}\n{_rows(head, np.column_stack(columns))}"


def spectacle_csv(curves: ExportedCurves) -> str:
    """`calibration/spectral_response.csv` of SPECTACLE: λ, R, G, B, G2 and their errors, every 1 nm.

    Both greens are the same curve. SPECTACLE needs errors, so a result without bands has nan.
    """
    std = np.full_like(curves.values, np.nan) if curves.own_std is None else curves.own_std
    four = [0, 1, 2, 1]
    table = np.column_stack([WAVELENGTHS, curves.own[:, four], std[:, four]])[::2]
    head = "wavelength,R,G,B,G2,R_err,G_err,B_err,G2_err"
    return f"# {curves.description}\n# {_rows([head], table)}"


def colour_csv(curves: ExportedCurves) -> str:
    """CSV for `colour.read_sds_from_csv_file`, which needs the header first: the description follows the numbers."""
    table = np.column_stack([WAVELENGTHS, curves.own])
    return f"{_rows(['wavelength', 'R', 'G', 'B'], table)}# {curves.description}\n"


def _rows(head: list[str], table: Floats) -> str:
    """A header and lines of numbers without loss of precision."""
    lines = (",".join([f"{row[0]:g}", *(repr(value + 0.0) for value in row[1:])]) for row in table.tolist())
    return "\n".join([",".join(head), *lines, ""])
