"""A sum of a few Gaussians a channel, amplitude, centre and width free: SciPy's `least_squares`.

The free number is how many. Starts stand where sensors of that colour peak, the further ones on their flanks.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from benchmarks.paper.rivals import Given
from camssf.grid import WAVELENGTHS, Floats

NAME = "sum of Gaussians"
WEIGHTS = (1.0, 2.0)
STARTS = ((600.0, 450.0), (535.0, 600.0), (460.0, 530.0))
"""Centres of R, G, B to start from, nm."""
WIDTH, NARROWEST, WIDEST = 35.0, 8.0, 120.0
"""Standard deviations, nm."""


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    rows, count = given.rows(), int(weight)
    curves = []
    for y, sigma, centres in zip(given.signals.T, given.scale().T, STARTS, strict=True):
        start = [(1.0 if i == 0 else 0.1, centre, WIDTH) for i, centre in enumerate(centres[:count])]
        fit = least_squares(
            lambda p, y=y, sigma=sigma: (rows @ _curve(p) - y) / sigma,
            np.ravel(start),
            jac=lambda p, sigma=sigma: rows @ _slopes(p) / sigma[:, None],
            bounds=(np.tile([0.0, 370.0, NARROWEST], count), np.tile([np.inf, 730.0, WIDEST], count)),
            x_scale=np.tile([1.0, 20.0, 10.0], count),
            max_nfev=200,
        )
        curves.append(_curve(fit.x))
    return np.stack(curves, axis=1)


def _curve(p: Floats) -> Floats:
    height, centre, width = p.reshape(-1, 3).T
    return np.exp(-0.5 * ((WAVELENGTHS[:, None] - centre) / width) ** 2) @ height


def _slopes(p: Floats) -> Floats:
    """(681, 3 count): by height, centre and width of each."""
    height, centre, width = p.reshape(-1, 3).T
    off = (WAVELENGTHS[:, None] - centre) / width
    bell = np.exp(-0.5 * off**2)
    return np.stack([bell, height * bell * off / width, height * bell * off**2 / width], axis=2).reshape(
        WAVELENGTHS.size, -1
    )
