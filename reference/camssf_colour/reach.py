"""Distance of signals from those that any surface can give under the lamp."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.messages import fail
from camssf.recovery.basis import fold
from camssf.rules import rules
from camssf_colour.light import Light

REACH = rules().number("colour.reach")
MOST = 64
"""Number of colours above which no distances are computed."""


def distances(y: Floats, covariance: Floats, light: Light) -> Floats:
    """As `surface_distances`; NaN if there are more than MOST colours, because so many are slow to compute."""
    return np.full(len(y), np.nan) if len(y) > MOST else surface_distances(y, covariance, light)


def surface_distances(y: Floats, covariance: Floats, light: Light) -> Floats:
    """(m,) distances, in standard deviations, of signals (m, 3) from the nearest ones of a reflectance from 0 to 1.

    min over 0 ≤ R ≤ 1 of ‖Σ^-½ (y - A R)‖, R linear between 5-nm nodes, A lamp times curves, scaled so that white
    gives 1.
    """
    from scipy.optimize import lsq_linear

    seen = light.power[:, None] * light.curves
    matrix = fold((seen / seen.sum(axis=0)).T)  # (3, 69)
    lengths = np.zeros(len(y))
    for n in np.flatnonzero(~_within(y, matrix)):
        signal, spread = y[n], covariance[n]
        floor = 1e-12 + 1e-6 * np.trace(spread) / 3.0
        root = np.linalg.cholesky(spread + floor * np.eye(3))
        whitened = np.linalg.solve(root, np.column_stack([matrix, signal]))
        fitted = lsq_linear(whitened[:, :-1], whitened[:, -1], (0.0, 1.0), method="bvls")
        lengths[n] = np.sqrt(2.0 * fitted.cost)
    return lengths


def _within(y: Floats, matrix: Floats) -> NDArray[np.bool_]:
    """(m,) whether signals (m, 3) are A R of a reflectance from 0 to 1, A (3, nodes).

    These signals fill a solid around that of R = ½; two columns of A span each of its faces (a zonotope).
    """
    first, second = np.triu_indices(matrix.shape[1], 1)
    normals = np.cross(matrix[:, first], matrix[:, second], axis=0)
    half_widths = 0.5 * np.abs(normals.T @ matrix).sum(axis=1)
    return np.asarray((np.abs((y - 0.5 * matrix.sum(axis=1)) @ normals) <= half_widths).all(axis=1))


def check_reach(reach: Floats) -> None:
    """Refuse colours that no surface can have.

    Raises:
        ColourOutOfReach: a distance above REACH.
    """
    far = np.flatnonzero(reach > REACH)
    if far.size:
        raise fail(
            "colour_out_of_reach.numbered",
            value=float(reach[far[0]]),
            threshold=REACH,
            number=far[0] + 1,
            distance=reach[far[0]],
        )
