"""Computes the 3 × 3 matrices of colour formats from curves and a lamp. All of them map white exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.colorimetry import BRADFORD, adaptation, choose
from camssf.errors import InvalidArgument
from camssf.exports.curves import ExportedCurves
from camssf.grid import Floats
from camssf.spectra import read_lamp

D50: Floats = np.array([0.9642, 1.0, 0.8249])
"""White of ICC's profile connection space and of DNG's forward matrices."""
ACES_WHITE: Floats = np.array([0.32168 / 0.33767, 1.0, (1.0 - 0.32168 - 0.33767) / 0.33767])
ACES: Floats = np.array(
    [
        [1.0498110175, 0.0, -0.0000974845],
        [-0.4959030231, 1.3733130458, 0.0982400361],
        [0.0, 0.0, 0.9912520182],
    ]
)
"""XYZ to ACES2065-1 (SMPTE ST 2065-1)."""
LARGEST = 100.0
"""Largest coefficient that the formats can hold; those of cameras are below 3."""
for _each in (D50, ACES_WHITE, ACES):
    _each.setflags(write=False)


@dataclass(frozen=True)
class Matrices:
    """The matrices of curves for one lamp.

    Attributes:
        lamp: name of the lamp.
        adaptation: (3, 3) XYZ under the lamp to XYZ under D50, by Bradford's transform, as ICC and DNG do.
        to_d50: (3, 3) white-balanced camera RGB to XYZ adapted to D50: M @ (1, 1, 1) = D50.
        to_aces: (3, 3) the same to ACES2065-1, adapted by CAT16: M @ (1, 1, 1) = (1, 1, 1).
        to_xyz: (3, 3) the same to XYZ under the lamp itself.
        delta_e00: mean over surfaces that were left out of the fit.
    """

    lamp: str
    adaptation: Floats
    to_d50: Floats
    to_aces: Floats
    to_xyz: Floats
    delta_e00: float


def matrices(curves: ExportedCurves, lamp: str) -> Matrices:
    """The matrices for a lamp, by least squares over 190 surfaces.

    Raises:
        InvalidArgument: an unknown lamp, or one under which the curves give no valid matrix.
    """
    transform = choose(curves.values, read_lamp(lamp).values, kind="matrix")
    own = transform.coefficients.T
    if not np.abs(own).max() < LARGEST or np.linalg.cond(own) > 1e6:
        raise InvalidArgument(
            f"No matrix from these curves to colours could be computed under {lamp}.", "Check the curves."
        )
    to_aces = ACES @ adaptation(transform.white, ACES_WHITE) @ own
    # ACES's published digits map white to 1 within 1e-7; normalising the rows removes the rest
    to_aces = to_aces / to_aces.sum(axis=1, keepdims=True)
    to_pcs = adaptation(transform.white, D50, BRADFORD)
    return Matrices(lamp, to_pcs, to_pcs @ own, to_aces, own, transform.delta_e00["matrix"])


def neutral(curves: ExportedCurves, lamp: str) -> Floats:
    """Raw signals (3,) of white under a lamp, the largest 1.

    Raises:
        InvalidArgument: the channels' relative scale is unknown, or a channel has almost no signal under the lamp.
    """
    raw = read_lamp(lamp).values @ curves.own
    if not (np.isfinite(raw).all() and (raw > 1e-3 * np.abs(raw).max()).all()):
        raise InvalidArgument(f"A channel has almost no response under {lamp}.", "Check the curves.")
    return np.asarray(raw / raw.max())
