"""The geometry of a chart's patches in a picture: lattice coordinates, corners, printed borders."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.grid import Floats
from camssf.rules import rules
from camssf.spectra.layouts import ChartLayout
from camssf.spectra.limits import NARROWEST

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


WINDOWS_BY_HAND = tuple(
    rules().number(f"pose.{word}_window") for word in ("first", "second", "third", "last", "last")
)
"""How far from its expected place a border is searched in each round, pitches, for corners given by hand."""
WINDOWS = (0.40, *WINDOWS_BY_HAND[1:])
"""The same for corners that a finder proposes."""
STEP, REACH, FAVOUR = (rules().number(f"pose.{word}") for word in ("profile_step", "profile_reach", "near_favour"))
FAR, SPREAD, IN_PLACE = (rules().number(f"pose.{word}") for word in ("fit_far", "least_spread", "in_place"))
WIDEST = rules().number("pose.widest")
FALL, PLACES, ROUNDS = (rules().whole(f"pose.{word}") for word in ("fall_steps", "profile_places", "fit_rounds"))

_ALONG = np.linspace(-REACH, REACH, PLACES)


def refine_corners(
    image: NDArray[np.floating[Any]],
    corners: ArrayLike,
    layout: ChartLayout,
    *,
    windows: tuple[float, ...] = WINDOWS,
) -> tuple[Floats, tuple[float, float], float]:
    """Move the corners of the block of patches to the printed borders, and measure the gap between them.

    Lattice coordinates: the centre of patch (column i, row j) is (i, j), its borders lie sx/2, sy/2 away; H maps
    them to the picture. Each round, with w of `windows`:

    1. For each of a patch's four borders, the mean profile along its outward normal: offsets t = -w to w
       every STEP, averaged over PLACES from -REACH to REACH of the border's length; bilinear samples.
    2. Its fall at t: mean of the FALL samples of the profile before t minus that of those behind t (gaps are
       darker than their patches). The border is where fall · (1 - FAVOUR (t/w)²) is largest, moved by
       the parabola through the three falls there. Weight: fall / (fall + median fall of all borders), 0 if
       negative or outside the picture.
    3. A correction of the lattice, linear in ten unknowns: for a vertical border found at (u, v) of patch
       column i, u + a₀ + a₁u + a₂v - u(gu + hv) = i ± sx/2; for a horizontal one of row j,
       v + b₀ + b₁u + b₂v - v(gu + hv) = j ± sy/2. Weighted least squares, in ROUNDS, each with Tukey's
       weights (1 - (r / FAR s)²)², where s is 1.4826 times the median of |r|, at least SPREAD. sx, sy stay
       within NARROWEST to WIDEST. H ← H · correction⁻¹.

    Args:
        image: (h, w) brightness, any scale on which the patches are brighter than the gaps.
        corners: (4, 2) first guess, px of `image`: top left, top right, bottom right, bottom left.
        layout: columns, rows and the first guess of the gap.
        windows: search range of each round, in pitches.

    Returns:
        corners (4, 2), patch edge (sx, sy) in pitches, and the share of borders that were found within
        IN_PLACE of the fitted lattice; 0, with the input corners, if the fit failed.
    """
    start = np.asarray(corners, dtype=np.float64)
    side = np.array(layout.side)
    lattice = homography(block_corners(layout, side), start)
    locked = 0.0
    for window in windows:
        borders = _borders(np.asarray(image), lattice, side, layout, window)
        if np.count_nonzero(borders[3]) < 10:  # fewer borders than unknowns
            return start, layout.side, 0.0
        correction, side, locked = _correct(*borders, side)
        try:
            lattice = lattice @ np.linalg.inv(correction)
        except np.linalg.LinAlgError:
            return start, layout.side, 0.0
        moved = map_points(lattice, block_corners(layout, side))
        if not np.isfinite(moved).all() or not convex(moved):
            return start, layout.side, 0.0
    return moved, (float(side[0]), float(side[1])), locked


def _borders(
    image: NDArray[np.floating[Any]], lattice: Floats, side: Floats, layout: ChartLayout, window: float
) -> tuple[Floats, NDArray[np.int64], Floats, Floats]:
    """Find each border: rules 1 and 2 of `refine_corners`.

    Returns:
        seen (e, 2) lattice coordinates, axis (e,) 0 for vertical borders, target (e, 2): patch index on that
        axis and -1 or 1 for its side, weight (e,).
    """
    index = np.arange(layout.columns * layout.rows)
    centres = np.stack([index % layout.columns, index // layout.columns], axis=1).astype(float)
    reach = round((window + FALL * STEP) / STEP)
    offsets = STEP * np.arange(-reach, reach + 1)
    seen, axes, targets, profiles = [], [], [], []
    for axis in (0, 1):
        for sign in (-1.0, 1.0):
            spots = np.repeat(np.repeat(centres[:, None, None, :], PLACES, axis=1), offsets.size, axis=2)
            spots[..., axis] += sign * (side[axis] / 2 + offsets)
            spots[..., 1 - axis] += (_ALONG * side[1 - axis])[:, None]
            profiles.append(_sample(image, map_points(lattice, spots)).mean(axis=1))
            seen.append(centres)
            axes.append(np.full(len(centres), axis))
            targets.append(np.stack([centres[:, axis], np.full(len(centres), sign)], axis=1))
    profile = np.concatenate(profiles)
    sums = np.cumsum(np.pad(profile, [(0, 0), (1, 0)]), axis=1)
    middle = np.arange(FALL, offsets.size - FALL)
    fall = (sums[:, middle] - sums[:, middle - FALL] - sums[:, middle + FALL + 1] + sums[:, middle + 1]) / FALL
    fall = np.where(np.isfinite(fall), fall, -np.inf)
    t = offsets[middle]
    peak = np.argmax(fall * (1 - FAVOUR * (t / window) ** 2), axis=1)
    height = fall[np.arange(len(fall)), peak]
    left, right = (fall[np.arange(len(fall)), np.clip(peak + d, 0, t.size - 1)] for d in (-1, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        bend = left - 2 * height + right
        step = np.where(np.isfinite(bend) & (bend < 0), 0.5 * (left - right) / bend, 0.0)
    place = t[peak] + STEP * np.clip(step, -1, 1)
    good = np.isfinite(height) & (height > 0)
    usual = float(np.median(height[good])) if good.any() else 1.0
    weight = np.where(good, np.where(good, height, 0) / (np.where(good, height, 0) + usual), 0.0)
    axis_of, target, where = np.concatenate(axes), np.concatenate(targets), np.concatenate(seen).copy()
    rows = np.arange(len(where))
    where[rows, axis_of] += target[:, 1] * (side[axis_of] / 2 + place)
    return where, axis_of, target, weight


def _correct(
    observed: Floats, axis: NDArray[np.int64], target: Floats, weight: Floats, side: Floats
) -> tuple[Floats, Floats, float]:
    """The lattice's correction (3, 3), the new patch edges, and the share of borders in place: rule 3."""
    u, v = observed[:, 0], observed[:, 1]
    along = np.where(axis == 0, u, v)
    one, zero = np.ones_like(u), np.zeros_like(u)
    vertical = axis == 0
    plane = np.stack([one, u, v], axis=1)
    A = np.concatenate(
        [
            np.where(vertical[:, None], plane, 0),
            np.where(vertical[:, None], 0, plane),
            np.stack([-along * u, -along * v], axis=1),
            np.stack(
                [np.where(vertical, -target[:, 1] / 2, zero), np.where(vertical, zero, -target[:, 1] / 2)],
                axis=1,
            ),
        ],
        axis=1,
    )
    b = target[:, 0] - along
    robust = np.ones_like(b)
    solution = np.zeros(10)
    for _ in range(ROUNDS):
        root = np.sqrt(weight * robust)
        solution = np.linalg.lstsq(A * root[:, None], b * root, rcond=None)[0]
        solution[8:] = np.clip(solution[8:], NARROWEST, WIDEST)
        residual = np.abs(A @ solution - b)
        spread = max(SPREAD, 1.4826 * float(np.median(residual[weight > 0])))
        robust = np.maximum(0, 1 - (residual / (FAR * spread)) ** 2) ** 2
    a0, a1, a2, b0, b1, b2, g, h = solution[:8]
    correction = np.array([[1 + a1, a2, a0], [b1, 1 + b2, b0], [g, h, 1.0]])
    locked = float(np.mean((residual < IN_PLACE) & (weight > 0)))
    return correction, solution[8:].copy(), locked


def _sample(image: NDArray[np.floating[Any]], points: Floats) -> Floats:
    """Bilinear samples at (..., 2) points; NaN outside."""
    height, width = image.shape
    x, y = points[..., 0], points[..., 1]
    inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    x, y = np.where(inside, x, 0), np.where(inside, y, 0)
    i, j = np.minimum(y.astype(np.int64), height - 2), np.minimum(x.astype(np.int64), width - 2)
    q, p = y - i, x - j
    top = image[i, j] * (1 - p) + image[i, j + 1] * p
    bottom = image[i + 1, j] * (1 - p) + image[i + 1, j + 1] * p
    return np.where(inside, top * (1 - q) + bottom * q, np.nan)
