"""Simulates the reflectances of an ink-jet copy: the same colours under D50, with three inks."""

from __future__ import annotations

import numpy as np

from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_lamp
from camssf.spectra.bundled import observer


def ink_jet_copy(wanted: Floats) -> Floats:
    """(n, 681) reflectance of ink amounts whose XYZ under D50 comes closest to that of `wanted`."""
    from scipy.optimize import least_squares

    weights = observer("1931") * read_lamp("D50").values[:, None]
    weights = weights / weights[:, 1].sum()
    bands = ((605.0, 720.0), (505.0, 585.0), (375.0, 490.0))  # absorbed by cyan, magenta, yellow
    ink = np.array(
        [1 / (1 + np.exp((low - WAVELENGTHS) / 12)) / (1 + np.exp((WAVELENGTHS - high) / 15)) for low, high in bands]
    )
    density = 1.6 * ink + 0.12 * ink[[1, 0, 1]] + 0.03
    stock = 0.90 - 0.06 / (1 + np.exp((WAVELENGTHS - 415) / 8))

    def paint(amounts: Floats) -> Floats:
        return np.asarray(stock * 10 ** -(amounts @ density))

    found = []
    for target in wanted @ weights:
        root = np.cbrt(target + 0.001)
        fit = least_squares(lambda a, r=root: np.cbrt(paint(a) @ weights + 0.001) - r, np.full(3, 0.4), bounds=(0, 2))
        found.append(paint(fit.x))
    return np.stack(found)
