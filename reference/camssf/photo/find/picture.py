"""Reduces a mosaic to a thumbnail in colour, in which charts are refined, and to the picture that is searched.

The latter holds whole numbers from 0 to 4095 on a square-root scale. From these codes to the blobs all numbers are
whole, so that Kotlin gives the same result to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.photo.find.chart_colours import limit
from camssf.photo.read.dng import Mosaic
from camssf.rules import rules
from camssf.spectra.layouts import ChartLayout

BAND = 64
"""Rows of the reduced picture that are made at a time."""
PATCH, THINNED = (rules().whole(f"pose.{word}") for word in ("patch_pixels", "thinned"))
BRIGHT = rules().number("pose.bright")


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

    Reads a band of one plane of the CFA at a time, so that little of the mosaic is copied.
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
                plane = np.concatenate([
                    cv2.resize(np.ascontiguousarray(band), (columns // factor, len(band) // factor),
                               interpolation=cv2.INTER_AREA)
                    for band in np.split(plane, range(factor * BAND, rows, factor * BAND))
                ])  # fmt: skip
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
    """(h, w) sum over channels of √(signal / its quantile BRIGHT): even noise, and visible dark patches."""
    tops = np.maximum(np.quantile(small.colours[::THINNED, ::THINNED], BRIGHT, axis=(0, 1)), 1.0)
    total = np.zeros(small.colours.shape[:2])
    for channel in range(3):
        total += np.sqrt(np.maximum(small.colours[:, :, channel] / tops[channel], 0))
    return total


LONGEST: int = limit("longest")
SMALLEST: int = limit("smallest")
TOP: int = limit("largest_code")


@dataclass(frozen=True)
class SearchImage:
    """A picture to be searched: codes (h, w, 1 or 3), 0 to 4095; one pixel is `step` px of the source."""

    values: NDArray[np.int64]
    step: int

    def to_source(self, points: Floats) -> Floats:
        """Points (..., 2) in px of the source, where the centre of the first pixel is (0, 0)."""
        return np.asarray(points * self.step + (self.step - 1) / 2.0)

    def halved(self) -> SearchImage:
        """Means of 2 × 2 pixels."""
        return SearchImage(_blocks(self.values, 2), 2 * self.step)


def codes_of_mosaic(mosaic: Mosaic) -> SearchImage:
    """Codes of a mosaic: each colour above black, relative to its largest block of cells."""
    height, width = mosaic.samples.shape
    rows, columns = height // 2, width // 2
    factor = _factor(rows, columns)
    rows, columns = rows // factor, columns // factor
    light = np.zeros((rows, columns, 3))
    for row in (0, 1):
        lines = np.zeros((rows, width), dtype=np.uint32)
        for v in range(factor):
            lines += mosaic.samples[row + 2 * v :: 2 * factor][:rows]
        for column in (0, 1):
            total = sum(lines[:, column + 2 * u :: 2 * factor][:, :columns] for u in range(factor))
            colour = "RGB".index(mosaic.cfa[2 * row + column])
            light[:, :, colour] += total - factor * factor * float(mosaic.black[row, column])
    return SearchImage(_roots(light), 2 * factor)


def codes_of_light(light: NDArray[np.floating[Any]]) -> SearchImage:
    """Codes of a linear picture (h, w) or (h, w, 3), in any unit in which black is 0."""
    planes = _planes(np.asarray(light, dtype=np.float64))
    height, width = planes.shape[:2]
    factor = _factor(height, width)
    rows, columns = height // factor, width // factor
    total = np.zeros((rows, columns, planes.shape[2]))
    for v in range(factor):
        for u in range(factor):
            total += planes[v : rows * factor : factor, u : columns * factor : factor]
    return SearchImage(_roots(total), factor)


def codes_of_bytes(shown: NDArray[np.uint8]) -> SearchImage:
    """Codes of an 8-bit picture for a display: (h, w) luma or (h, w, 3) red, green, blue."""
    planes = _planes(np.asarray(shown))
    factor = _factor(*planes.shape[:2])
    return SearchImage(_blocks(planes.astype(np.int64) * 16, factor), factor)


def rgb_of_yuv(y: NDArray[np.uint8], u: NDArray[np.uint8], v: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(h, w, 3) RGB of full-range BT.601 YUV with chroma at half resolution, as camera previews have it."""
    height, width = y.shape
    luma = y.astype(np.int64) << 16
    cb, cr = (np.repeat(np.repeat(p.astype(np.int64) - 128, 2, axis=0), 2, axis=1)[:height, :width] for p in (u, v))
    red, green, blue = luma + 91881 * cr, luma - 22554 * cb - 46802 * cr, luma + 116130 * cb
    shown = (np.stack([red, green, blue], axis=2) + 32768) >> 16
    return np.asarray(np.clip(shown, 0, 255), dtype=np.uint8)


def _planes(picture: NDArray[Any]) -> NDArray[Any]:
    """(h, w, channels), checked."""
    planes = picture[:, :, None] if picture.ndim == 2 else picture
    if planes.ndim != 3 or planes.shape[2] not in (1, 3) or min(planes.shape[:2]) < SMALLEST:
        raise InvalidArgument(
            f"An array of shape {picture.shape} is not a picture.",
            f"Give (h, w) or (h, w, 3) with {SMALLEST} px a side at least, better 640 × 480.",
        )
    return planes


def _factor(height: int, width: int) -> int:
    """Side of the blocks of pixels that are combined, px."""
    if min(height, width) < SMALLEST:
        raise InvalidArgument(
            f"A picture of {width} × {height} px is too small to find a chart in.",
            f"Give one of {SMALLEST} px a side at least, better 640 × 480.",
        )
    return max(1, -(-max(height, width) // LONGEST))


def _blocks(values: NDArray[np.int64], factor: int) -> NDArray[np.int64]:
    """Means of factor × factor codes, rounded; incomplete blocks at the right and bottom are dropped."""
    rows, columns = values.shape[0] // factor, values.shape[1] // factor
    total = np.zeros((rows, columns, values.shape[2]), dtype=np.int64)
    for v in range(factor):
        for u in range(factor):
            total += values[v : rows * factor : factor, u : columns * factor : factor]
    return (total + factor * factor // 2) // (factor * factor)


def _roots(light: Floats) -> NDArray[np.int64]:
    """Codes of light: each colour relative to its largest value."""
    codes = np.zeros(light.shape, dtype=np.int64)
    for channel in range(light.shape[2]):
        plane = light[:, :, channel]
        top = float(np.nanmax(np.where(np.isfinite(plane), plane, 0.0)))
        if top > 0:
            share = np.where(np.isfinite(plane), plane, 0.0) / top
            codes[:, :, channel] = np.floor(TOP * np.sqrt(np.maximum(share, 0.0))).astype(np.int64)
    return codes
