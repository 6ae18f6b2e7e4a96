"""The geometry of a chart's patches in a picture: lattice coordinates, corners, homographies."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from camssf.grid import Floats
from camssf.spectra.layouts import ChartLayout

_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def block_corners(layout: ChartLayout, side: ArrayLike) -> Floats:
    """(4, 2) outer corners of the block of patches with edges `side`, in lattice coordinates (`refine_corners`)."""
    last = np.array([layout.columns - 1, layout.rows - 1])
    return np.asarray(_SQUARE * np.asarray(side) / 2 + last * (_SQUARE > 0))


def patch_corners(lattice: Floats, layout: ChartLayout, side: ArrayLike) -> Floats:
    """(n, 4, 2) px corners of every patch with edges `side`; `lattice` (3, 3) maps lattice coordinates to px."""
    index = np.arange(layout.columns * layout.rows)
    centres = np.stack([index % layout.columns, index // layout.columns], axis=1)[:, None, :]
    return map_points(lattice, centres + _SQUARE * np.asarray(side) / 2)


def map_points(matrix: Floats, points: Floats) -> Floats:
    """Map (..., 2) points through a homography (3, 3)."""
    mapped = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(mapped[..., :2] / mapped[..., 2:])


def homography(source: Floats, target: Floats) -> Floats:
    """(3, 3) homography that maps four points to four points."""
    rows, right = [], []
    for (x, y), (u, v) in zip(source, target, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        right += [u, v]
    return np.append(np.linalg.solve(np.array(rows), np.array(right)), 1.0).reshape(3, 3)


def area(quad: Floats) -> float:
    """Area of (4, 2) corners; positive if the corners run clockwise as seen (y down)."""
    x, y = quad[:, 0], quad[:, 1]
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def convex(quad: Floats) -> bool:
    """True if (4, 2) corners, in their order, form a convex quadrilateral."""
    a = np.roll(quad, -1, axis=0) - quad
    b = np.roll(a, -1, axis=0)
    turns = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return bool(np.all(turns > 0) or np.all(turns < 0))


def pitch_of(corners: Floats, layout: ChartLayout) -> float:
    """Mean distance of patch centres in px."""
    return float(np.sqrt(abs(area(corners)) / (layout.columns * layout.rows)))
