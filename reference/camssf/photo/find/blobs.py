"""Finds blobs: connected pixels that are brighter than a dark line around them and fill a parallelogram."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from camssf.photo.find.chart_colours import limit
from camssf.photo.find.picture import SearchImage

PASSES: list[tuple[int, int]] = limit("passes")
SMALLEST_AREA: int = limit("smallest_area")
LARGEST_SHARE: int = limit("largest_share")
FULL: tuple[float, float] = limit("full")
LONGEST_SHAPE: float = limit("longest_shape")
MOST: int = limit("most_blobs")
OVERLAP: float = limit("overlap")
SAME_SIZE: float = limit("same_size")
CELL = 16
"""Edge of the squares of the index by which blobs are looked up, px."""


@dataclass(frozen=True)
class Blob:
    """Centre (x, y) px, area px, second moments px² and their determinant."""

    x: float
    y: float
    area: float
    xx: float
    xy: float
    yy: float
    det: float


def blobs_in(codes: SearchImage) -> list[Blob]:
    """Blobs of all passes; of overlapping blobs, the first."""
    bright = codes.values[:, :, 0] + 0
    for channel in range(1, codes.values.shape[2]):
        bright += codes.values[:, :, channel]
    corner = np.zeros((bright.shape[0] + 1, bright.shape[1] + 1), dtype=np.int64)
    corner[1:, 1:] = np.cumsum(np.cumsum(bright, axis=0), axis=1)
    kept: list[Blob] = []
    cells: dict[tuple[int, int], list[int]] = {}
    window = cache(partial(_window, corner))
    for reach, sixteenths in PASSES:
        total, count = window(reach)
        for blob in _shapes(16 * bright * count > sixteenths * total):
            if len(kept) < MOST and _new(blob, kept, cells):
                cells.setdefault((int(blob.y) // CELL, int(blob.x) // CELL), []).append(len(kept))
                kept.append(blob)
    return kept


def _window(corner: NDArray[np.int64], reach: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sum and number (h, w) of the pixels in each pixel's window; windows end at the picture's edges."""
    height, width = corner.shape[0] - 1, corner.shape[1] - 1
    y, x = np.arange(height), np.arange(width)
    top, bottom = np.maximum(y - reach, 0), np.minimum(y + reach + 1, height)
    left, right = np.maximum(x - reach, 0), np.minimum(x + reach + 1, width)
    rows = corner[bottom] - corner[top]
    return rows[:, right] - rows[:, left], (bottom - top)[:, None] * (right - left)[None, :]


def _shapes(mask: NDArray[np.bool_]) -> list[Blob]:
    """Components (four neighbours) that look like a patch, in reading order of their first pixels."""
    import cv2

    count, unordered = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    count -= 1
    numbers, first = np.unique(unordered, return_index=True)
    order = np.zeros(count + 1, np.int64)
    order[numbers[numbers > 0][np.argsort(first[numbers > 0])]] = np.arange(1, count + 1)
    labels = order[unordered]
    area = np.bincount(labels.ravel(), minlength=count + 1)
    fits = (area >= SMALLEST_AREA) & (area * LARGEST_SHARE <= mask.size)
    fits[0] = False  # what is not bright
    y, x = np.nonzero(fits[labels])
    name = labels[y, x]
    sums = [
        np.bincount(name, weights=w, minlength=count + 1)[1:]
        for w in (np.ones(x.size), x, y, x * x, x * y, y * y)  # whole numbers below 2^53: no rounding in any order
    ]
    n, sx, sy, sxx, sxy, syy = sums
    shapes = []
    for i in np.flatnonzero(n):
        a = n[i]
        # Pixels are squares, not points: each adds a variance of 1/12 along both axes.
        xx = (sxx[i] * a - sx[i] * sx[i]) / (a * a) + 1 / 12
        yy = (syy[i] * a - sy[i] * sy[i]) / (a * a) + 1 / 12
        xy = (sxy[i] * a - sx[i] * sy[i]) / (a * a)
        det = xx * yy - xy * xy
        if det <= 0 or (xx + yy) * (xx + yy) > LONGEST_SHAPE * det:
            continue
        full = a / (12 * np.sqrt(det))
        if FULL[0] <= full <= FULL[1]:
            values = (sx[i] / a, sy[i] / a, a, xx, xy, yy, det)
            shapes.append(Blob(*(float(v) for v in values)))
    return shapes


def _new(blob: Blob, kept: list[Blob], cells: dict[tuple[int, int], list[int]]) -> bool:
    """True if the blob lies on no kept blob of similar size."""
    near = OVERLAP * blob.area
    reach = int(np.sqrt(near)) // CELL + 1
    row, column = int(blob.y) // CELL, int(blob.x) // CELL
    for r in range(row - reach, row + reach + 1):
        for c in range(column - reach, column + reach + 1):
            for index in cells.get((r, c), ()):
                other = kept[index]
                dx, dy = blob.x - other.x, blob.y - other.y
                alike = blob.area <= SAME_SIZE * other.area and other.area <= SAME_SIZE * blob.area
                if alike and dx * dx + dy * dy < near:
                    return False
    return True
