"""Finds the pose of the chart in a mosaic: its position and orientation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import CalibrationError, InvalidArgument
from camssf.grid import Floats
from camssf.messages import fail
from camssf.photo.find.geometry import (
    WINDOWS_BY_HAND,
    area,
    block_corners,
    convex,
    homography,
    map_points,
    patch_corners,
    pitch_of,
    refine_corners,
)
from camssf.photo.find.picture import brightness, thumbnail_around
from camssf.photo.find.search import ACCEPT, OWN, Match, matches_in, orient_corners, plain_signals, refine_closely
from camssf.photo.read.dng import Mosaic
from camssf.photo.read.pieces import MAX_SIDE
from camssf.photo.read.unit import Area
from camssf.rules import rules
from camssf.shapes import Bounds, Quad, Quads, Text, Words
from camssf.spectra import ChartTable
from camssf.spectra.layouts import ChartLayout
from camssf.spectra.limits import SMALLEST_PHOTO

WIDEST_EDGE = 3.5
"""Standard deviation of the sharpest edges above which a photo is blurred, px. Simulated photos have at most 2.9
when sharp, and at least 4.1 when blur prevents the search."""
WINDOW = 33
"""Side of the neighbourhood of an edge, green samples."""
CONTRAST = 0.3
"""Smallest contrast of an edge, relative to the photo's."""
STEP = 0.3
"""Smallest contrast of an edge, relative to its bright side above the black level; light falloff is below it."""
MOST = 1 << 22
"""Largest number of green samples that is searched for edges: of a larger photo its middle."""
SIGNAL_TO_NOISE = 20.0
"""Smallest contrast of an edge, relative to the noise."""


def edge_width(mosaic: Mosaic) -> float | None:
    """Standard deviation of the blur of the sharpest edges, px; None if no edge exceeds the noise.

    Of a photo of more than 4 × MOST samples only the middle is looked at, so that memory is bounded.

    An edge from low to high, blurred by a Gaussian, has the largest slope (high - low) / (σ √(2π)). Noise only makes
    slopes steeper, so it never makes a sharp photo look blurred.
    """
    import cv2

    row, column = divmod(mosaic.cfa.index("G"), 2)
    samples = mosaic.samples[row::2, column::2]
    share = min(1.0, (MOST / samples.size) ** 0.5)
    (top, left), (rows, columns) = (
        [int(side * part) for side in samples.shape] for part in ((1.0 - share) / 2, share)
    )
    samples = samples[top : top + rows, left : left + columns]
    green = cv2.medianBlur(np.ascontiguousarray(samples), 3).astype(np.float32)
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


NEAR, LOCKED, ACCEPT_BY_HAND = (rules().number(f"pose.{word}") for word in ("near", "locked", "accept"))
MARGIN, MARGIN_PIXELS = (rules().number(f"pose.{word}") for word in ("margin", "margin_pixels"))

CORNERS = "Give four points x,y in pixels of the photo, one after the other around the block of patches."


@dataclass(frozen=True)
class Pose:
    """Position and orientation of the chart.

    All points are (x, y) in pixels of the active area, where the centre of the first sample is (0, 0).
    Corners run top left, top right, bottom right, bottom left **of the chart**, not of the photo.

    Attributes:
        layout: name of the ChartLayout.
        corners: (4, 2) outer corners of the block of patches (outer borders of the corner patches).
        patches: (n, 4, 2) corners of each patch, on its borders, in the chart's reading order.
        quarter_turns: number of 90° clockwise turns from an upright chart to the chart in the photo, 0 to 3.
        method: "detected" or "by hand".
        score: agreement with the chart's own colours, 0 to 1 (correlation).
        notes: messages for the user, e.g. that a second chart was in view.
    """

    layout: Text
    corners: Quad
    patches: Quads
    quarter_turns: Annotated[int, Bounds(0, 3)]
    method: Annotated[str, Words(("detected", "by hand", "simulated"))]
    score: Annotated[float, Bounds(-1.0, 1.0)]
    notes: tuple[Text, ...] = ()


def find_chart(mosaic: Mosaic, table: ChartTable, *, corners: ArrayLike | None = None) -> Pose:
    """Find the chart of `table` in the photo: its patch borders and its orientation.

    camssf's own finder proposes grids of patches in a small picture of the mosaic; OpenCV's cv2.mcc does, too, if
    the finder finds nothing or is not sure. `refine_corners` moves a grid to the printed borders, and the colours
    choose among the grids and the four turns, independent of colour cast and exposure (`agreement`).

    Args:
        mosaic: the photo.
        table: table of the chart to find.
        corners: (4, 2) outer corners of the block of patches, or the fiducials of its layout, given by hand in
            order around the block, from any of them; px of the active area, off by half a patch at most. Refined
            if borders are found nearby, otherwise kept.

    Raises:
        Blurred: nothing looks like this chart, and no edge in the photo is sharp.
        ChartNotFound: nothing looks like this chart, it is mirrored, or the photo is too small.
        InvalidArgument: the table does not fit its layout, or `corners` are no convex quadrilateral in the photo.
    """
    layout = table.layout
    if len(table.values) != layout.columns * layout.rows:
        raise InvalidArgument(
            f"The chart table {table.table!r} does not fit the layout {layout.name}.",
            f"Give a table of {layout.columns * layout.rows} patches.",
        )
    height, width = mosaic.samples.shape
    if min(height, width) < SMALLEST_PHOTO:
        raise fail(
            "chart_not_found.small_photo",
            value=float(min(height, width)),
            threshold=float(SMALLEST_PHOTO),
            file=mosaic.path,
            width=width,
            height=height,
        )
    expected = plain_signals(table)
    if corners is not None:
        return _by_hand(mosaic, layout, expected, _checked(corners, mosaic))
    matches = matches_in(mosaic, layout, expected)
    if not matches or matches[0].score < ACCEPT:
        width = edge_width(mosaic)
        if width is not None and width > WIDEST_EDGE:
            raise fail("blurred.no_chart", value=width, threshold=WIDEST_EDGE, file=mosaic.path, width=width)
        raise fail(
            "chart_not_found.none",
            value=matches[0].score if matches else 0.0,
            threshold=ACCEPT,
            file=mosaic.path,
            chart=table.name,
        )
    best = matches[0]
    if best.mirrored:
        raise _mirrored(mosaic, best)
    return _pose(refine_closely(mosaic, best, layout), layout, "detected", _notes(matches))


def _by_hand(mosaic: Mosaic, layout: ChartLayout, expected: Floats, corners: Floats) -> Pose:
    """The pose from corners given by hand: oriented by the colours, moved to borders if these are nearby."""
    small = thumbnail_around(mosaic, corners, layout, margin=MARGIN, extra=MARGIN_PIXELS)
    around = corners if area(corners) > 0 else corners[::-1]
    tries = [
        orient_corners(small, small.from_mosaic(start), layout.side, layout, expected, reach=0)
        for start in _starts(around, layout)
    ]
    best = max(tries, key=lambda m: m.score)
    refined, side, locked = refine_corners(brightness(small), best.corners, layout, windows=WINDOWS_BY_HAND)
    moved = np.linalg.norm(refined - best.corners, axis=1).max() / pitch_of(best.corners, layout)
    notes: tuple[str, ...] = ()
    if locked >= LOCKED and moved <= NEAR:
        score = orient_corners(small, refined, side, layout, expected, reach=0).score
        best = replace(best, corners=refined, side=side, locked=locked, score=score)
    else:
        notes = ("No patch borders lie near the corners given by hand: they were kept as they are.",)
    if best.score < ACCEPT_BY_HAND:
        raise fail("chart_not_found.by_hand", value=best.score, threshold=ACCEPT_BY_HAND, file=mosaic.path)
    best = replace(best, corners=small.to_mosaic(best.corners))
    if best.mirrored:
        raise _mirrored(mosaic, best)
    return _pose(best, layout, "by hand", notes)


def _starts(around: Floats, layout: ChartLayout) -> list[Floats]:
    """Corners (4, 2) of the block of patches that the four points may mean, clockwise.

    Either side may run along the columns. Where the layout has fiducials, the points may be these, from any of them.
    """
    starts = [np.roll(around, -first, axis=0) for first in (0, 1)]
    if layout.fiducials:
        block = block_corners(layout, layout.side)
        marks = np.array(layout.fiducials)
        starts += [map_points(homography(marks, np.roll(around, -first, axis=0)), block) for first in range(4)]
    return starts


def chart_area(corners: ArrayLike) -> Area:
    """The part of a photo in which a chart with these corners is refined and measured.

    The corners' bounding box, widened on each side; it may extend beyond the photo.

    Raises:
        InvalidArgument: not four points.
    """
    points = _points(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN * (high - low) + MARGIN_PIXELS
    left, top = (np.clip(low - margin, 0.0, MAX_SIDE).astype(int) // 2 * 2).tolist()
    right, bottom = np.clip(high + margin, 1.0, MAX_SIDE).astype(int).tolist()
    return top, left, bottom, right


def _points(corners: ArrayLike) -> Floats:
    """Four points as an array (4, 2); raises InvalidArgument if they are not."""
    try:
        points = np.asarray(corners, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidArgument("The corners are not numbers.", CORNERS) from None
    if points.shape != (4, 2):
        raise InvalidArgument(f"The corners have the shape {points.shape}, not four points of two.", CORNERS)
    if not np.isfinite(points).all():
        raise InvalidArgument("A number of the corners is not finite.", CORNERS)
    return points


def _checked(corners: ArrayLike, mosaic: Mosaic) -> Floats:
    """Corners given by hand as an array; raises InvalidArgument if they are invalid."""
    points = _points(corners)
    limit = np.array(mosaic.samples.shape[::-1]) - 1
    if np.any(points < 0) or np.any(points > limit):
        raise InvalidArgument(f"A corner lies outside the photo of {limit[0] + 1} × {limit[1] + 1} px.", CORNERS)
    if not convex(points):
        raise InvalidArgument("The corners do not go around a convex quadrilateral.", CORNERS)
    return points


def _mirrored(mosaic: Mosaic, match: Match) -> CalibrationError:
    return fail("chart_not_found.mirrored", file=mosaic.path, score=match.score)


def _notes(matches: list[Match]) -> tuple[str, ...]:
    """Notes for the user: another grid was proposed away from the best one; only OpenCV found the chart."""
    best = matches[0]
    low, high = best.corners.min(axis=0), best.corners.max(axis=0)
    apart = [m for m in matches[1:] if np.any((m.proposed.max(axis=0) < low) | (m.proposed.min(axis=0) > high))]
    notes = []
    if apart:
        x, y = apart[0].proposed.mean(axis=0)
        notes.append(
            f"A second grid of patches was in view, about ({x:.0f}, {y:.0f}) px: the one whose colours agree better "
            f"with the chart was measured ({best.score:.2f} against {apart[0].score:.2f})."
        )
    if not any(m.detector == OWN.name and m.score >= ACCEPT for m in matches):
        notes.append("OpenCV's detector found the chart, camssf's own finder did not: check its outline.")
    return tuple(notes)


def _pose(match: Match, layout: ChartLayout, method: str, notes: tuple[str, ...]) -> Pose:
    lattice = homography(block_corners(layout, match.side), match.corners)
    patches = patch_corners(lattice, layout, match.side)
    across = match.corners[[1, 2]].sum(axis=0) - match.corners[[0, 3]].sum(axis=0)
    turns = round(float(np.degrees(np.arctan2(across[1], across[0]))) / 90) % 4
    score = min(max(match.score, 0.0), 1.0)
    return Pose(layout.name, match.corners, patches, turns, method, score, notes)
