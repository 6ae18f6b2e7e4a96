"""Reduces a mosaic to a small picture in colour, in which charts are searched and refined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.photo.read.dng import Mosaic
from camssf.spectra.layouts import ChartLayout

PATCH = 40
"""Largest size of a patch on the thumbnail of a chart alone, px."""


@dataclass(frozen=True)
class Thumbnail:
    """A reduced picture: colours (h, w, 3) DN above black, a pixel covers `step` mosaic pixels, from `origin`."""

    colours: NDArray[np.float32]
    step: int
    origin: tuple[int, int]

    def to_mosaic(self, points: Floats) -> Floats:
        """Points of the reduced picture in px of the mosaic."""
        return np.asarray(self.step * points + (self.step - 1) / 2 + np.array(self.origin))

    def from_mosaic(self, points: Floats) -> Floats:
        """Points of the mosaic in px of the reduced picture."""
        return np.asarray((points - (self.step - 1) / 2 - np.array(self.origin)) / self.step)


def thumbnail(mosaic: Mosaic, longest: int, box: tuple[int, int, int, int] | None = None) -> Thumbnail:
    """Mean colours of the CFA cells of `box` (left, top, right, bottom), in square blocks of cells.

    Reads one plane of the CFA at a time, so that little more than a quarter of the mosaic is copied.
    """
    import cv2

    height, width = mosaic.samples.shape
    left, top, right, bottom = box or (0, 0, width, height)
    left, top = left // 2 * 2, top // 2 * 2
    rows, columns = (bottom - top) // 2, (right - left) // 2
    factor = max(1, -(-max(rows, columns) // longest))
    rows, columns = rows // factor * factor, columns // factor * factor
    colours = np.zeros((rows // factor, columns // factor, 3), dtype=np.float32)
    for row in (0, 1):
        for column in (0, 1):
            plane = mosaic.samples[top + row :: 2, left + column :: 2][:rows, :columns]
            if factor > 1:
                small = (columns // factor, rows // factor)
                plane = cv2.resize(np.ascontiguousarray(plane), small, interpolation=cv2.INTER_AREA)
            letter = mosaic.cfa[2 * row + column]
            share = 0.5 if letter == "G" else 1.0
            colours[:, :, "RGB".index(letter)] += share * (
                plane.astype(np.float32) - np.float32(mosaic.black[row, column])
            )
    return Thumbnail(colours, 2 * factor, (left, top))


def thumbnail_around(
    mosaic: Mosaic, corners: Floats, layout: ChartLayout, *, margin: float, extra: float = 0.0
) -> Thumbnail:
    """The thumbnail of the corners' bounding box, widened by `margin` of its size and `extra` px on each side."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    wider = margin * (high - low) + extra
    left, top = np.maximum(low - wider, 0).astype(int).tolist()
    right, bottom = np.minimum(high + wider, np.array(mosaic.samples.shape[::-1])).astype(int).tolist()
    return thumbnail(mosaic, PATCH * max(layout.columns, layout.rows), (left, top, right, bottom))


def brightness(small: Thumbnail) -> Floats:
    """(h, w) sum over channels of √(signal / its 98th percentile): even noise, and visible dark patches."""
    tops = np.maximum(np.percentile(small.colours[::4, ::4], 98, axis=(0, 1)), 1.0)
    total = np.zeros(small.colours.shape[:2])
    for channel in range(3):
        total += np.sqrt(np.maximum(small.colours[:, :, channel] / tops[channel], 0))
    return total
