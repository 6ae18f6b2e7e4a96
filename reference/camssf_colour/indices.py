"""Colorimetric quality of a camera's curves: the Luther condition and the sensitivity metamerism index."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.colorimetry import Transform, choose, fit, lab, signals_of, xyz_of
from camssf.grid import Floats
from camssf.spectra import read_chart, read_lamp
from camssf.spectra.bundled import observer

SMI_LAMP = "D55"
SMI_PATCHES = 18
"""The chart's chromatic patches; its six greys are left out."""
SMI_SLOPE = 5.5


@dataclass(frozen=True)
class Quality:
    """How close a camera is to an observer.

    Attributes:
        luther: share of the squared norm of the observer's functions, 0 to 1, outside the span of the three curves;
            0 if the Luther condition holds.
        vora: Vora and Trussell's value of the set of curves, 0 to 1; 1 if the Luther condition holds.
        smi: sensitivity metamerism index: 100 minus 5.5 times the mean ΔE*ab of the ColorChecker's 18 colours under
            D55 through the best matrix; 100 is an ideal observer, negative values are possible.
        matrix, polynomial: the two transforms under `lamp`.
        lamp: its name.
    """

    luther: float
    vora: float
    smi: float
    matrix: Transform
    polynomial: Transform
    lamp: str


def quality_of(curves: Floats, lamp: str = "D65", name: str = "1931") -> Quality:
    """Luther condition, SMI and the transforms of curves (681, 3) for an observer and a lamp.

    Raises:
        InvalidArgument: an unknown lamp or observer.
    """
    functions = observer(name)
    ours, theirs = (np.linalg.qr(columns)[0] for columns in (curves, functions))
    left = functions - ours @ (ours.T @ functions)
    power = read_lamp(lamp).values
    return Quality(
        luther=float(np.sum(left**2) / np.sum(functions**2)),
        vora=float(np.sum((ours.T @ theirs) ** 2) / 3.0),
        smi=_metamerism(curves, functions),
        matrix=choose(curves, power, name, "matrix"),
        polynomial=choose(curves, power, name, "root-polynomial"),
        lamp=lamp,
    )


def _metamerism(curves: Floats, functions: Floats) -> float:
    """The index of ISO 17321-1. The matrix is fitted by least squares in XYZ and keeps white."""
    power = read_lamp(SMI_LAMP).values
    patches = read_chart("classic24").values[:SMI_PATCHES]
    y, target = signals_of(patches, power, curves), xyz_of(patches, power, functions)
    white = xyz_of(np.ones(power.shape), power, functions)
    xyz = np.maximum(y, 0.0) @ fit(y, target, white, "matrix")
    return 100.0 - SMI_SLOPE * float(np.linalg.norm(lab(xyz, white) - lab(target, white), axis=1).mean())
