"""The colour error of a result: the one that its curves' band makes likely, and the one against a truth.

Both are over the 24 surfaces of a ColorChecker in daylight D65, beside a white reference, through `standard_colour`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from camssf.colorimetry import delta_e00
from camssf.documents.document import Document
from camssf.errors import CalibrationError
from camssf.grid import Floats
from camssf.spectra import read_chart, read_lamp
from camssf_colour.camera import Camera, camera_of_result
from camssf_colour.standard import of_surfaces, standard_colour
from camssf_colour.view import View

CHART, LAMP = "classic24", "D65"
SKINS = slice(0, 2)
"""Dark skin and light skin, the chart's first two patches."""
FINE, COARSE = 3.5, 5.0
"""ΔE: below FINE a difference is small, above COARSE two colours look different (Mokrzycki and Tatol, 2011)."""


@dataclass(frozen=True)
class ColourError:
    """Expected errors in ΔE00: root mean square of each surface, mean over the chart's 24 and over its two skins.

    `accepted` is the verdict: the band of a doubtful result does not cover what is doubted.
    """

    chart: float
    skin: float
    accepted: bool = True

    def in_words(self) -> str:
        """One sentence for a reader."""
        if not self.accepted:
            return (
                "How good the curves are for measuring colour is not known: the error band does not cover what the "
                "verdict doubts."
            )
        use = "Too uncertain for measuring colour"
        if self.chart <= COARSE:
            use = "Good for telling colours apart"
        if self.chart <= FINE:
            use = "Good for comparing colours between cameras"
        return (
            f"{use}: colour error about {self.chart:.1f} ΔE00 on the chart's colours, {self.skin:.1f} on its skin "
            "tones, in daylight."
        )


@lru_cache(maxsize=1)  # page and terminal state the same result's
def expected_error(document: Document) -> ColourError | None:
    """The colour error that the result's covariance gives; None without curves or bands, or if it cannot be computed.

    The expectation of ΔE00² is taken over the six points at ± √3 σ along the axes of each colour's covariance, which
    is exact where ΔE00² is quadratic.
    """
    if document.answer is None or document.answer.std is None or document.verdict is None:
        return None
    try:
        camera = camera_of_result(document)
        colour = standard_colour(camera, LAMP, _signals(camera.values))
    except CalibrationError:  # no colour can be computed from a foreign document's curves
        return None
    size, axes = np.linalg.eigh(colour.lab_covariance)
    steps = np.sqrt(3.0 * np.maximum(size, 0.0))[:, None, :] * axes  # (24, 3 of Lab, 3 axes)
    points = np.concatenate([steps, -steps], axis=2)
    centre = colour.lab[:, :, None]
    squares = delta_e00(np.moveaxis(centre + points, 1, -1), np.moveaxis(centre + 0 * points, 1, -1)) ** 2
    errors = np.sqrt(squares.sum(axis=1) / 6.0)
    accepted = document.verdict.status == "accepted"
    return ColourError(float(errors.mean()), float(errors[SKINS].mean()), accepted)


def true_error(values: Floats, truth: Floats) -> float | None:
    """Mean ΔE00 of the chart's colours through curves (681, 3), with signals of the truth; None if impossible."""
    try:
        camera = Camera("curves", values, np.zeros((0, *values.shape)))
        colour = standard_colour(camera, LAMP, _signals(truth))
    except CalibrationError:
        return None
    wanted = of_surfaces(read_chart(CHART).values, read_lamp(LAMP).values, View())[1]
    return float(delta_e00(colour.lab, wanted).mean())


def _signals(values: Floats) -> Floats:
    """(24, 3) signals of the chart under the lamp."""
    seen = read_lamp(LAMP).values[:, None] * values
    return np.asarray(read_chart(CHART).values @ seen / seen.sum(axis=0))
