"""Demosaics a Bayer mosaic by the linear filters of Malvar, He and Cutler (ICASSP 2004, III, 485).

Each missing colour is the mean of its neighbours, corrected by the second derivative of the colour that is there. The
filters are linear, so the noise of a colour follows from that of the samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from camssf.grid import Floats
from camssf.recovery.arrays import Array, namespace

RED, GREEN, BLUE = range(3)
CELL = ((RED, GREEN), (GREEN, BLUE))
"""Colours of the 2 × 2 cell that `demosaic` takes."""
PLACES = ((0, 0), (0, 1), (1, 0), (1, 1))
"""Row and column of the samples of a cell."""
GREEN_THERE = {
    (0, 0): 4, (0, 1): 2, (1, 0): 2, (0, -1): 2, (-1, 0): 2, (0, 2): -1, (2, 0): -1, (0, -2): -1, (-2, 0): -1,
}  # fmt: skip
"""Eighths by (row, column) from the sample: green where red or blue was sampled."""
ALONG_ROW = {
    (0, 0): 5, (0, 1): 4, (0, -1): 4, (0, 2): -1, (0, -2): -1, (1, 1): -1, (1, -1): -1, (-1, 1): -1, (-1, -1): -1,
    (2, 0): 0.5, (-2, 0): 0.5,
}  # fmt: skip
"""Where green was sampled: the colour that was sampled left and right of it."""
ALONG_COLUMN = {(column, row): eighths for (row, column), eighths in ALONG_ROW.items()}
"""The colour that was sampled above and below it."""
OPPOSITE = {
    (0, 0): 6, (1, 1): 2, (1, -1): 2, (-1, 1): 2, (-1, -1): 2,
    (0, 2): -1.5, (2, 0): -1.5, (0, -2): -1.5, (-2, 0): -1.5,
}  # fmt: skip
"""Red where blue was sampled, and blue where red was."""
ITSELF = {(0, 0): 8}
Filter = Mapping[tuple[int, int], float]


def _filter(row: int, column: int, colour: int) -> Filter:
    """The filter that gives a colour at a place of the cell."""
    sampled = CELL[row][column]
    if colour == sampled:
        return ITSELF
    if colour == GREEN:
        return GREEN_THERE
    if sampled == GREEN:
        return ALONG_ROW if colour in CELL[row] else ALONG_COLUMN
    return OPPOSITE


def demosaic(mosaic: Array) -> Array:
    """Colours (3, 4, h - 2, w - 2), at each of PLACES, of a mosaic (h, 2, w, 2) of cells red, green / green, blue.

    The outermost cells are the margin of the others and have no colours themselves.
    """
    xp, (h, _, w, _) = namespace(mosaic), mosaic.shape
    # Samples of one place lie side by side: NumPy is fastest so.
    planes = xp.reshape(xp.permute_dims(mosaic, (1, 3, 0, 2)), (4, h, w))

    def sample(row: int, column: int) -> Array:
        """(h - 2, w - 2) samples at this place, counted from the first of each cell."""
        up, left = row // 2 + 1, column // 2 + 1
        return planes[PLACES.index((row % 2, column % 2)), up : h - 2 + up, left : w - 2 + left]

    def colour(row: int, column: int, name: int) -> Array:
        alike: dict[float, list[Array]] = {}
        for (down, right), eighths in _filter(row, column, name).items():
            alike.setdefault(eighths, []).append(sample(row + down, column + right))
        terms = [sum(samples[1:], samples[0]) * (eighths / 8.0) for eighths, samples in alike.items()]
        return sum(terms[1:], terms[0])

    colours = [colour(row, column, name) for name in range(3) for row, column in PLACES]
    return xp.reshape(xp.stack(colours, axis=0), (3, 4, h - 2, w - 2))


def interleaved(colours: Array) -> Array:
    """(3, h, 2, w, 2) of colours (3, 4, h, w) at PLACES."""
    xp, (_, _, h, w) = namespace(colours), colours.shape
    return xp.permute_dims(xp.reshape(colours, (3, 2, 2, h, w)), (0, 3, 1, 4, 2))


@cache
def noise_shares() -> Floats:
    """(3, 3, 3) covariance of colours i and j, the mean over a cell, by the variance of samples of colour k."""
    shares = np.zeros((3, 3, 3))
    for row, column in np.ndindex(2, 2):
        weights: dict[tuple[int, int], Floats] = {}
        for name in range(3):
            for place, eighths in _filter(row, column, name).items():
                weights.setdefault(place, np.zeros(3))[name] += eighths / 8.0
        for (down, right), weight in weights.items():
            shares[..., CELL[(row + down) % 2][(column + right) % 2]] += np.outer(weight, weight) / 4.0
    return shares
