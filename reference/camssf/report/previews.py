"""Makes JPEG previews of photos for the report, in the sensor's orientation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.photo.capture import Capture, MeasuredShot, cell_blacks, thumbnail
from camssf.photo.read.dng import Mosaic

WHITE = 0.9
"""Reflectance of a chart's brightest patch, about; every chart's is neutral."""


def photo_preview(mosaic: Mosaic) -> bytes | None:
    """A JPEG of a photo's active area."""
    return _encode(thumbnail(mosaic), cell_blacks(mosaic), mosaic.white)


def shot_preview(shot: MeasuredShot) -> bytes | None:
    """A JPEG of the shot's photo; None if the shot holds no thumbnail."""
    if shot.thumbnail is None:
        return None
    means = shot.means
    bright = int((means.chart.mean - means.black).min(axis=1).argmax())
    white = (means.chart.mean[bright] - means.black) / (means.saturation - means.black)
    return _encode(shot.thumbnail, means.black, means.saturation, white / WHITE)


def previews(capture: Capture) -> tuple[bytes | None, ...]:
    """A preview of each measured shot, and of the unfinished one if its photo was read."""
    measured = tuple(shot_preview(shot) for shot in capture.shots)
    last = capture.unfinished
    if last is None or last.thumbnail is None or last.black is None:
        return measured
    return (*measured, _encode(last.thumbnail, last.black, last.saturation))


def _encode(cells: NDArray[np.uint16], black: Floats, saturation: float, white: Floats | None = None) -> bytes | None:
    """Encode a display picture, white-balanced on `white` (3,), else on its brightest parts."""
    import cv2

    picture = np.maximum(cells - black, 0.0) / (saturation - black)
    top = np.percentile(picture[::2, ::2], 99, axis=(0, 1)) if white is None else white
    top = np.maximum(top, 1e-6)
    display = (255.0 * np.clip(picture / top, 0.0, 1.0) ** (1 / 2.2) + 0.5).astype(np.uint8)
    done, data = cv2.imencode(".jpg", display[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    return bytes(data) if done else None
