"""Signals → how far they lie from what any surface could give under the lamp."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from camssf.colour.light import Light
from camssf.curves.basis import fold
from camssf.errors import ColourOutOfReach
from camssf.grid import Floats

REACH = 4.0
"""Standard deviations from the nearest reflectance between 0 and 1: by chance 1 in 1,000 of three numbers."""
MOST = 64
"""Colours that are asked one by one; of more than these the question is not asked."""


def distances(y: Floats, covariance: Floats, light: Light) -> Floats:
    """(m,) standard deviations between signals (m, 3) and the nearest that a reflectance from 0 to 1 gives.

    min over 0 ≤ R ≤ 1 of ‖Σ^-½ (y - A R)‖, R straight between 5-nm nodes, A the light as the curves see it, white 1.
    NaN where there are more colours than MOST: a live picture is not the place to ask.
    """
    if len(y) > MOST:
        return np.full(len(y), np.nan)
    seen = light.power[:, None] * light.curves
    matrix = fold((seen / seen.sum(axis=0)).T)  # (3, 69)
    found = []
    for signal, spread in zip(y, covariance, strict=True):
        floor = 1e-12 + 1e-6 * np.trace(spread) / 3.0
        root = np.linalg.cholesky(spread + floor * np.eye(3))
        whitened = np.linalg.solve(root, np.column_stack([matrix, signal]))
        fitted = lsq_linear(whitened[:, :-1], whitened[:, -1], (0.0, 1.0), method="bvls")
        found.append(float(np.sqrt(2.0 * fitted.cost)))
    return np.array(found)


def check_reach(reach: Floats) -> None:
    """Refuse colours that no surface has.

    Raises:
        ColourOutOfReach: a distance above REACH.
    """
    far = np.flatnonzero(reach > REACH)
    if far.size:
        raise ColourOutOfReach(
            f"Colour {far[0] + 1} is none that a surface has under this lamp: {reach[far[0]]:.1f} standard "
            "deviations from the nearest.",
            "Check the white reference and the lamp; leave out glare, light sources and fluorescent surfaces.",
            value=float(reach[far[0]]),
            threshold=REACH,
        )
