"""Measures the width of a mosaic's sharpest edges, to distinguish a blurred photo from one without a chart."""

from __future__ import annotations

import numpy as np

from camssf.photo.read.dng import Mosaic

WIDEST_EDGE = 3.5
"""Standard deviation of the sharpest edges above which a photo is blurred, px. Simulated photos have at most 2.9
when sharp, and at least 4.1 when blur prevents the search."""
WINDOW = 33
"""Side of the neighbourhood of an edge, green samples."""
CONTRAST = 0.3
"""Smallest contrast of an edge, relative to the photo's."""
STEP = 0.3
"""Smallest contrast of an edge, relative to its bright side above the black level; light falloff is below it."""
SIGNAL_TO_NOISE = 20.0
"""Smallest contrast of an edge, relative to the noise."""


def edge_width(mosaic: Mosaic) -> float | None:
    """Standard deviation of the blur of the sharpest edges, px; None if no edge exceeds the noise.

    An edge from low to high, blurred by a Gaussian, has the largest slope (high - low) / (σ √(2π)). Noise only makes
    slopes steeper, so it never makes a sharp photo look blurred.
    """
    import cv2

    row, column = divmod(mosaic.cfa.index("G"), 2)
    green = cv2.medianBlur(np.ascontiguousarray(mosaic.samples[row::2, column::2]), 3).astype(np.float32)
    light = cv2.GaussianBlur(green, (0, 0), 1.0)
    across = np.diff(light, axis=1, append=light[:, -1:])
    down = np.diff(light, axis=0, append=light[-1:])
    around = np.ones((WINDOW, WINDOW), np.uint8)
    steepest = cv2.dilate(np.hypot(across, down), around)
    bright = cv2.dilate(light, around)
    contrast = bright - cv2.erode(light, around)
    noise = 1.4826 * float(np.median(np.abs(across)))
    clear = (contrast > CONTRAST * np.percentile(contrast, 99)) & (contrast > SIGNAL_TO_NOISE * noise)
    clear &= contrast > STEP * (bright - mosaic.black[row, column])
    if not clear.any():
        return None
    widths = contrast[clear] / steepest[clear] / np.sqrt(2 * np.pi)
    return 2.0 * float(np.percentile(widths, 2))  # green samples are 2 px apart
