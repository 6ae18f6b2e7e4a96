"""XYZ of reflectances, Lab, and chromatic adaptation. XYZ is relative: Y of a perfect white diffuser is 1."""

from __future__ import annotations

import numpy as np

from camssf.grid import Floats
from camssf.spectra.appearance import BEND, SLOPE, lab
from camssf.spectra.surfaces import observer

__all__ = ["CAT16", "adapt", "adaptation", "lab", "lab_slopes", "white_of", "xyz_of"]

CAT16: Floats = np.array(
    [[0.401288, 0.650173, -0.051461], [-0.250268, 1.204414, 0.045854], [-0.002079, 0.048952, 0.953127]]
)
"""XYZ to the sharpened cone signals of CAT16 (Li et al., Color Res. Appl. 2017, 42, 703)."""
CAT16.setflags(write=False)


def xyz_of(reflectance: Floats, lamp: Floats, functions: Floats) -> Floats:
    """XYZ of reflectances (..., 681) under a lamp (681,), with colour-matching functions (681, 3): (..., 3)."""
    light = lamp[:, None] * functions
    return np.asarray(reflectance @ light / light[:, 1].sum())


def white_of(lamp: Floats, name: str = "1931") -> Floats:
    """XYZ (3,) of a perfect white diffuser under a lamp (681,), for the observer of that name."""
    light = lamp @ observer(name)
    return np.asarray(light / light[1])


def lab_slopes(xyz: Floats, white: Floats) -> Floats:
    """∂ Lab / ∂ XYZ, (..., 3, 3)."""
    t = np.asarray(xyz) / white
    f = np.where(t > BEND, np.cbrt(np.maximum(t, BEND)) ** -2 / 3.0, SLOPE / 116.0) / white
    x, y, z = np.moveaxis(f, -1, 0)
    none = np.zeros_like(x)
    rows = ([none, 116.0 * y, none], [500.0 * x, -500.0 * y, none], [none, 200.0 * y, -200.0 * z])
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def adaptation(source: Floats, target: Floats) -> Floats:
    """(..., 3, 3) matrix that takes XYZ seen under a white (..., 3) to another: CAT16, adapted wholly."""
    scale = (np.asarray(target) @ CAT16.T) / (np.asarray(source) @ CAT16.T)
    return np.asarray(np.linalg.inv(CAT16) @ (scale[..., :, None] * CAT16))


def adapt(xyz: Floats, source: Floats, target: Floats) -> Floats:
    """XYZ (..., 3) seen under one white (3,) as it looks the same under another (3,)."""
    return np.asarray(np.asarray(xyz) @ adaptation(source, target).T)
