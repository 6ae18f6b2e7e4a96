"""Proposes grids of patches by OpenCV's cv2.mcc: the second opinion on camssf's own finder (`sightings`)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.photo.find.geometry import convex
from camssf.photo.find.thumbnail import Thumbnail, thumbnail
from camssf.photo.read.dng import Mosaic
from camssf.spectra.layouts import ChartLayout

ATTEMPTS: tuple[tuple[int, int, bool], ...] = ((1000, 0, False), (1000, 1000, False), (1600, 0, True))
"""Longest side of the thumbnail, px; smallest picture for cv2.mcc (it enlarges others); whether contrast is
equalised."""

SMALLEST = 32
"""Smallest side of a picture for cv2.mcc, px."""


def opencv_proposals(
    mosaic: Mosaic, layout: ChartLayout, _expected: Floats
) -> Iterator[tuple[Thumbnail, list[Floats]]]:
    """A thumbnail for each attempt, and the quadrilaterals (4, 2) in it that cv2.mcc accepts as such a chart.

    cv2.mcc knows no layout of the user's own.
    """
    if not layout.shipped:
        return
    for longest, smallest, equalise in ATTEMPTS:
        small = thumbnail(mosaic, longest)
        yield small, _quads(_rendered(small.colours, equalise), layout, smallest)


def _rendered(colours: NDArray[np.float32], equalise: bool) -> NDArray[np.uint8]:
    """8-bit BGR picture: each channel relative to its 98th percentile, gamma 2.2."""
    import cv2

    tops = np.maximum(np.percentile(colours[::4, ::4], 98, axis=(0, 1)), 1.0).astype(np.float32)
    shown = np.clip(colours / tops, 0, 1) ** np.float32(1 / 2.2)
    picture = np.ascontiguousarray((255 * shown[:, :, ::-1]).astype(np.uint8))
    if equalise:
        tiles = cv2.createCLAHE(clipLimit=4.0, tileGridSize=(8, 8))
        picture = cv2.merge([tiles.apply(plane) for plane in cv2.split(picture)])
    return picture


def _quads(picture: NDArray[np.uint8], layout: ChartLayout, smallest: int) -> list[Floats]:
    import cv2

    if min(picture.shape[:2]) < SMALLEST:
        return []
    detector = cv2.mcc.CCheckerDetector.create()
    options = cv2.mcc.DetectorParametersMCC()
    options.minImageSize = smallest
    detector.setDetectionParams(options)
    detector.setColorChartType(cv2.mcc.SG140 if layout.columns == 14 else cv2.mcc.MCC24)
    try:
        if not detector.process(picture, 4):
            return []
        found = detector.getListColorChecker()
    except cv2.error:  # it fails on some pictures; the next attempt may work
        return []
    quads = [np.array(c.getBox(), dtype=np.float64) for c in found]
    return [quad for quad in quads if quad.shape == (4, 2) and np.isfinite(quad).all() and convex(quad)]
