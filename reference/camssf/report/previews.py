"""Makes JPEG previews of photos for the report, in the sensor's orientation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.photo.capture import MeasuredShot, Record, cell_blacks, thumbnail
from camssf.photo.read.dng import Mosaic


def photo_preview(mosaic: Mosaic) -> bytes | None:
    """A JPEG of a photo's active area."""
    return _encode(thumbnail(mosaic), cell_blacks(mosaic), mosaic.white)


def shot_preview(shot: MeasuredShot) -> bytes | None:
    """A JPEG of the shot's photo; None if the shot holds no thumbnail."""
    return None if shot.thumbnail is None else _encode(shot.thumbnail, shot.means.black, shot.means.saturation)


def previews(record: Record) -> tuple[bytes | None, ...]:
    """A preview of each measured shot, and of the unfinished one if its photo was read."""
    found = tuple(shot_preview(shot) for shot in record.shots)
    last = record.unfinished
    if last is None or last.photo is None or last.thumbnail is None:
        return found
    return (*found, _encode(last.thumbnail, last.black, last.saturation))


def _encode(cells: NDArray[np.uint16], black: Floats, saturation: float) -> bytes | None:
    """Encode a display picture, white-balanced on its brightest parts."""
    import cv2

    picture = np.maximum(cells - black, 0.0) / (saturation - black)
    top = np.maximum(np.percentile(picture[::2, ::2], 99, axis=(0, 1)), 1e-6)
    display = (255.0 * np.clip(picture / top, 0.0, 1.0) ** (1 / 2.2) + 0.5).astype(np.uint8)
    done, data = cv2.imencode(".jpg", display[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    return bytes(data) if done else None
