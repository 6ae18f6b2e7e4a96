"""Which samples of a patch are measured: rules 1 to 3 of docs/patches.md."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.messages import fail
from camssf.rules import rules

SHRINK = rules().number("patches.shrink")
"""Fraction of each patch edge that is measured."""
REJECT = rules().whole("patches.reject")
"""Samples further from the median than this many MAD (plus FLOOR) are rejected as dust or hot pixels."""
FLOOR = rules().whole("patches.floor")
"""Deviation that is always allowed, DN: without noise the MAD of whole numbers is zero."""


def cells_of(cfa: str) -> list[tuple[int, int]]:
    """(row, column) in the 2 × 2 cell of R, the green on R's rows, the green on B's rows, B."""
    red, blue = divmod(cfa.index("R"), 2), divmod(cfa.index("B"), 2)
    return [red, (red[0], 1 - red[1]), (blue[0], 1 - blue[1]), blue]


def samples_in(
    quad: Floats, cell: tuple[int, int], shape: tuple[int, ...], patch: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the cell's samples in the shrunk quad: rules 1 and 2."""
    centre = centre_of(quad)
    moved = 16 * (centre + SHRINK * (quad - centre))
    limit = 16 * np.array([shape[1] - 1, shape[0] - 1])
    if not all(isfinite(v) for v in moved.flat) or np.any(moved < 0) or np.any(moved > limit):
        raise fail("chart_not_found.outside", patch=patch)
    corners = np.floor(moved + 0.5).astype(np.int64)
    low, high = (corners.min(axis=0) + 15) // 16, corners.max(axis=0) // 16
    rows = np.arange(low[1] + (cell[0] - low[1]) % 2, high[1] + 1, 2)
    columns = np.arange(low[0] + (cell[1] - low[0]) % 2, high[0] + 1, 2)
    inside = np.ones((rows.size, columns.size), dtype=bool)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (b[0] - a[0]) * (16 * rows[:, None] - a[1]) >= (b[1] - a[1]) * (16 * columns - a[0])
    y, x = np.nonzero(inside)
    return rows[y], columns[x]


def centre_of(quad: Floats) -> Floats:
    """Mean (2,) of a quad's corners (4, 2)."""
    return np.asarray(((quad[0] + quad[1]) + (quad[2] + quad[3])) * 0.25)


def _twice_median(v: NDArray[np.int32]) -> int:
    ordered = np.sort(v)
    return int(ordered[(v.size - 1) // 2]) + int(ordered[v.size // 2])


def kept(v: NDArray[np.int32]) -> NDArray[np.bool_]:
    """False for dust and hot pixels: rule 3."""
    deviation = np.abs(2 * v - _twice_median(v))
    kept: NDArray[np.bool_] = 2 * deviation <= REJECT * _twice_median(deviation) + 4 * FLOOR
    return kept
