"""A file's colour matrices: CIE XYZ to the camera's raw values, each made for one illuminant (DNG 1.7, chapter 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats
from camssf.spectra.surfaces import correlated_temperature

LIGHT_SOURCES = {17: "A", 18: "B", 19: "C", 20: "D55", 21: "D65", 22: "D75", 23: "D50"}
"""CIE illuminants by Exif's LightSource code."""
WHITE_POINTS = {  # CIE 1931 x, y (CIE 15)
    "A": (0.44758, 0.40745),
    "B": (0.34842, 0.35161),
    "C": (0.31006, 0.31616),
    "D55": (0.33243, 0.34744),
    "D65": (0.31272, 0.32903),
    "D75": (0.29903, 0.31488),
    "D50": (0.34567, 0.35851),
}
DARKEST_CHANNEL = 1e-3
"""A channel of the camera's white below this share of the largest: the matrix is damaged."""


@dataclass(frozen=True)
class ColourMatrix:
    """One colour matrix.

    Attributes:
        light: the CIE illuminant that it was made for.
        values: nine numbers, row by row: AnalogBalance · CameraCalibration · ColorMatrix, XYZ to raw R, G, B.
    """

    light: str
    values: tuple[float, ...]

    @property
    def to_raw(self) -> Floats:
        """(3, 3)."""
        return np.array(self.values).reshape(3, 3)

    @property
    def kelvin(self) -> float:
        """Correlated colour temperature of `light`, K."""
        return float(correlated_temperature(self._xyz))

    @property
    def white(self) -> Floats:
        """The camera's white (3,) under `light`, green 1."""
        white = self.to_raw @ self._xyz
        return np.asarray(white / white[1])

    @property
    def _xyz(self) -> Floats:
        x, y = WHITE_POINTS[self.light]
        return np.array([x / y, 1.0, (1.0 - x - y) / y])


def colour_matrix(
    light: int, matrix: Floats | None, calibration: Floats | None = None, balance: Floats | None = None
) -> ColourMatrix | None:
    """The colour matrix of a file; None if it is missing, damaged, or made for a light that Exif does not define.

    Args:
        light: Exif's LightSource code.
        matrix: (3, 3) XYZ to camera.
        calibration: (3, 3) of the individual camera; None for the identity.
        balance: (3,) analogue gains; None for ones.
    """
    if matrix is None or light not in LIGHT_SOURCES:
        return None
    values = matrix if calibration is None else calibration @ matrix
    values = values if balance is None else balance[:, None] * values
    found = ColourMatrix(LIGHT_SOURCES[light], tuple(values.ravel().tolist()))
    white = found.to_raw @ found._xyz
    return found if np.isfinite(white).all() and white.min() > DARKEST_CHANNEL * white.max() else None
