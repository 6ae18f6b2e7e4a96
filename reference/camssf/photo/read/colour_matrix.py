"""A file's colour matrices: CIE XYZ to the camera's raw values, each made for one illuminant (DNG 1.7, chapter 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from camssf.colorimetry import chromaticity, off_locus
from camssf.grid import Floats
from camssf.rules import rules
from camssf.shapes import Bounds, Number, Words
from camssf.spectra.bundled import correlated_temperature

LIGHT_SOURCES = {
    1: "D55", 3: "A", 4: "D55", 9: "D55", 10: "D65", 11: "D75",
    17: "A", 18: "B", 19: "C", 20: "D55", 21: "D65", 22: "D75", 23: "D50",
}  # fmt: skip
"""CIE illuminants by Exif's LightSource code; daylight, flash and weathers by the temperatures of Adobe's SDK."""
WHITE_POINTS = {  # CIE 1931 x, y (CIE 15)
    "A": (0.44758, 0.40745),
    "B": (0.34842, 0.35161),
    "C": (0.31006, 0.31616),
    "D55": (0.33243, 0.34744),
    "D65": (0.31272, 0.32903),
    "D75": (0.29903, 0.31488),
    "D50": (0.34567, 0.35851),
}
MOST_RED_DAYLIGHT, MOST_RED_BULB, OFF_LOCUS, EQUAL_NEUTRAL, DARKEST_CHANNEL = (
    rules().number(f"lamp.{word}")
    for word in ("most_red_daylight", "most_red_bulb", "off_locus", "equal_neutral", "darkest_channel")
)


@dataclass(frozen=True)
class ColourMatrix:
    """One colour matrix.

    Attributes:
        light: the CIE illuminant that it was made for.
        values: nine numbers, row by row: AnalogBalance · CameraCalibration · ColorMatrix, XYZ to raw R, G, B.
    """

    light: Annotated[str, Words(tuple(WHITE_POINTS))]
    values: Annotated[tuple[Number, ...], Bounds(9, 9)]

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
    light: int, matrix: Floats, calibration: Floats | None = None, balance: Floats | None = None
) -> ColourMatrix:
    """The colour matrix of a file, if a camera can have it.

    Args:
        light: Exif's LightSource code; 0 for unknown.
        matrix: (3, 3) XYZ to camera.
        calibration: (3, 3) of the individual camera; None for the identity.
        balance: (3,) analogue gains; None for ones.

    Raises:
        ValueError: it was made for a light without a known spectrum, is damaged, or gives a white that no sensor has,
            as the placeholders of some writers do. The message completes "was left out: it ...".
    """
    if light not in LIGHT_SOURCES:
        raise ValueError(f"was made for light source {light}, whose spectrum is not known")
    values = matrix if calibration is None else calibration @ matrix
    values = values if balance is None else balance[:, None] * values
    calibrated = ColourMatrix(LIGHT_SOURCES[light], tuple(values.ravel().tolist()))
    white = calibrated.to_raw @ calibrated._xyz
    if not (np.isfinite(white).all() and white.min() > DARKEST_CHANNEL * white.max()):
        raise ValueError(f"gives no white under {calibrated.light}")
    red = float(white[0] / white[1])
    if red > (MOST_RED_BULB if calibrated.light == "A" else MOST_RED_DAYLIGHT):
        raise ValueError(
            f"gives a white under {calibrated.light} whose red is {red:.2f} of its green, as no sensor's is"
        )
    return calibrated


def no_light(neutral: Floats, matrices: Sequence[ColourMatrix]) -> bool:
    """Whether the matrices turn a file's AsShotNeutral (3,) into a white that no lamp has, OFF_LOCUS or more away.

    A neutral of three equal numbers says nothing: some writers store it for unknown.
    """
    if not matrices or neutral.max() < EQUAL_NEUTRAL * neutral.min():
        return False
    white = chromaticity(neutral, [(matrix.kelvin, matrix.to_raw) for matrix in matrices])
    return white is None or off_locus(white) > OFF_LOCUS
