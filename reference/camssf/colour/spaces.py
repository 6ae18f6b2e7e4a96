"""XYZ of reflectances, Lab, and chromatic adaptation. XYZ is relative: Y of a perfect white diffuser is 1."""

from __future__ import annotations

import numpy as np

from camssf.grid import Floats
from camssf.spectra.appearance import BEND, SLOPE
from camssf.spectra.surfaces import observer

CAT16: Floats = np.array(
    [[0.401288, 0.650173, -0.051461], [-0.250268, 1.204414, 0.045854], [-0.002079, 0.048952, 0.953127]]
)
"""XYZ to the sharpened cone signals of CAT16 (Li et al., Color Res. Appl. 2017, 42, 703)."""
BRADFORD: Floats = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""XYZ to the sharpened cone signals that ICC (ICC.1:2010, annex E) and DNG use for adaptation."""
for _each in (CAT16, BRADFORD):
    _each.setflags(write=False)


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


def adaptation(source: Floats, target: Floats, cones: Floats = CAT16) -> Floats:
    """(..., 3, 3) matrix that adapts XYZ from one white (..., 3) to another, with complete adaptation.

    `cones`, (3, 3), converts XYZ to the cone signals that are scaled.
    """
    scale = (np.asarray(target) @ cones.T) / (np.asarray(source) @ cones.T)
    return np.asarray(np.linalg.inv(cones) @ (scale[..., :, None] * cones))


def adapt(xyz: Floats, source: Floats, target: Floats) -> Floats:
    """XYZ (..., 3) adapted by CAT16 from one white (3,) to another (3,)."""
    return np.asarray(np.asarray(xyz) @ adaptation(source, target).T)
