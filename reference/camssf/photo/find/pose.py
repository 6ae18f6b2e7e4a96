"""Finds the pose of the chart in a mosaic: its position and orientation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import Blurred, ChartNotFound, InvalidArgument
from camssf.grid import Floats
from camssf.photo.find.layouts import (
    LAYOUTS,
    ChartLayout,
    area,
    block_corners,
    convex,
    homography,
    map_points,
    patch_corners,
    pitch_of,
)
from camssf.photo.find.picture import codes_of_mosaic
from camssf.photo.find.refine import refine_corners
from camssf.photo.find.search import (
    ACCEPT,
    Match,
    brightness,
    finer,
    label,
    match_near,
    matches_in,
    plain_signals,
    thumbnail,
)
from camssf.photo.find.sharpness import WIDEST_EDGE, edge_width
from camssf.photo.find.sightings import Sighting, find_sightings
from camssf.photo.read.dng import Mosaic
from camssf.spectra import ChartTable

ACCEPT_BY_HAND = 0.6
"""As `ACCEPT`, for corners given by hand; lower, because the user has identified the chart."""

WINDOWS_BY_HAND = (0.50, 0.25, 0.15, 0.10, 0.10)
"""As `WINDOWS`, for corners given by hand: a tap may be off by half a patch; the next patch begins further away."""

NEAR = 0.55
"""Largest distance by which `refine_corners` may move a corner given by hand, in pitches."""

LOCKED = 0.6
"""Smallest share of patch borders that must lie on the fitted lattice."""

SURE = 0.95
"""Agreement from which one detector is enough if only one grid was in view."""

APART = 0.5
"""Largest distance between two detectors' patches that counts as the same place, in pitches."""

SMALLEST = 64
"""Smallest side of a photo that can be searched, px."""


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

    layout: str
    corners: Floats
    patches: Floats
    quarter_turns: int
    method: str
    score: float
    notes: tuple[str, ...]


def find_chart(mosaic: Mosaic, table: ChartTable, *, corners: ArrayLike | None = None) -> Pose:
    """Find the chart of `table` in the photo: its patch borders and its orientation.

    OpenCV's cv2.mcc proposes grids in a small display-like picture of the mosaic; if none agrees with the
    table's colours, other renderings and sizes follow. `refine_corners` moves a grid to the printed borders,
    and the colours choose among the four turns, independent of colour cast and exposure (`agreement`).

    Args:
        mosaic: the photo.
        table: table of the chart to find; its layout is a key of LAYOUTS.
        corners: (4, 2) outer corners of the block of patches, given by hand in order around the block, from any
            of them; px of the active area, off by half a patch at most. Refined if borders are found nearby,
            otherwise kept.

    Raises:
        Blurred: nothing looks like this chart, and no edge in the photo is sharp.
        ChartNotFound: nothing looks like this chart, it is mirrored, or the photo is too small.
        InvalidArgument: the table has no known layout, or `corners` are no convex quadrilateral in the photo.
    """
    layout = LAYOUTS.get(table.layout)
    if layout is None or len(table.values) != layout.columns * layout.rows:
        raise InvalidArgument(
            f"The chart table {table.table!r} fits no layout that camssf knows.",
            f"Use a table of one of these layouts: {', '.join(LAYOUTS)}.",
        )
    height, width = mosaic.samples.shape
    if min(height, width) < SMALLEST:
        raise ChartNotFound(
            f"{mosaic.path}: the photo has only {width} × {height} px.",
            "Give the RAW photo of the whole sensor.",
            value=float(min(height, width)),
            threshold=float(SMALLEST),
        )
    expected = plain_signals(table)
    if corners is not None:
        return _by_hand(mosaic, layout, expected, _checked(corners, mosaic))
    matches = matches_in(mosaic, layout, expected)
    others = _others(matches) if matches else ()
    if not matches or matches[0].score < SURE or others:
        matches, heard = _second_opinion(mosaic, layout, expected, matches)
        others += heard
    if not matches or matches[0].score < ACCEPT:
        width = edge_width(mosaic)
        if width is not None and width > WIDEST_EDGE:
            raise Blurred(
                f"{mosaic.path}: no chart was found, and the photo is blurred: its sharpest edges are {width:.1f} px "
                "wide (one standard deviation).",
                "Focus on the chart, and put the camera on a tripod.",
                value=width,
                threshold=WIDEST_EDGE,
            )
        raise ChartNotFound(
            f"{mosaic.path}: nothing in the photo agrees with the chart {table.name!r}.",
            "Let the chart fill more of the frame, tilt it less than 45°, keep its black border in view, in focus "
            "and free of shadows and reflections, and hold the camera still. Check --chart, and that chart, white "
            "and dark frame are not exchanged; a file may also name a wrong order of its colour filters. Else give "
            "the block's outer corners by --corners.",
            value=matches[0].score if matches else 0.0,
            threshold=ACCEPT,
        )
    best = matches[0]
    if best.mirrored:
        raise _mirrored(mosaic, best)
    return _pose(finer(mosaic, best, layout), layout, "detected", others)


def _second_opinion(
    mosaic: Mosaic, layout: ChartLayout, expected: Floats, matches: list[Match]
) -> tuple[list[Match], tuple[str, ...]]:
    """The matches, completed by camssf's own finder, and notes for the user.

    If no match of cv2.mcc is accepted, the finder's sightings are refined and oriented like its proposals.
    Otherwise cv2.mcc's match is used, and a note says if the finder sees a chart elsewhere.
    """
    size = layout.columns * layout.rows
    if min(mosaic.samples.shape) < 2 * SMALLEST:
        return matches, ()
    seen = [each for each in find_sightings(codes_of_mosaic(mosaic)).sightings if len(each.patches) == size]
    if matches and matches[0].score >= ACCEPT:
        away = [each for each in seen if _apart(matches[0], each, layout)]
        if not away:
            return matches, ()
        middle = away[0].patches.mean(axis=0)
        return matches, (
            f"camssf's own finder sees another chart about ({middle[0]:.0f}, {middle[1]:.0f}) px, agreement "
            f"{away[0].confidence:.2f}, mirrored: {'yes' if away[0].mirrored else 'no'}. If that is the one, give "
            "its corners by --corners.",
        )
    found = [match_near(mosaic, each.corners, layout, expected) for each in seen]
    found.sort(key=lambda match: -match.score)
    if not found or found[0].score < ACCEPT:
        return sorted([*matches, *found], key=lambda match: -match.score), ()
    note = "OpenCV's detector did not find the chart; camssf's own finder did."
    more = ("A second chart was in view: the one whose colours agree better was taken.",) if len(found) > 1 else ()
    return found, (note, *more)


def _apart(match: Match, sighting: Sighting, layout: ChartLayout) -> bool:
    """True if match and sighting lie at different places. A mirrored chart's first patch lies right of the second."""
    lattice = homography(block_corners(layout, match.side), match.corners)
    index = np.arange(layout.columns * layout.rows)
    column = index % layout.columns
    if match.mirrored:
        column = layout.columns - 1 - column
    ours = map_points(lattice, np.stack([column, index // layout.columns], axis=1).astype(np.float64))
    off = float(np.linalg.norm(ours - sighting.patches, axis=1).max())
    return off > APART * pitch_of(match.corners, layout)


def _by_hand(mosaic: Mosaic, layout: ChartLayout, expected: Floats, corners: Floats) -> Pose:
    """The pose from corners given by hand: oriented by the colours, moved to borders if these are nearby."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 0.15 * (high - low) + 8
    bounds = np.array(mosaic.samples.shape[::-1])
    box = (
        *np.maximum(low - margin, 0).astype(int).tolist(),
        *np.minimum(high + margin, bounds).astype(int).tolist(),
    )
    small = thumbnail(mosaic, 40 * max(layout.columns, layout.rows), box)
    around = corners if area(corners) > 0 else corners[::-1]
    tries = [
        label(small, small.from_mosaic(np.roll(around, -first, axis=0)), layout.side, layout, expected, reach=0)
        for first in (0, 1)
    ]
    best = max(tries, key=lambda m: m.score)
    refined, side, locked = refine_corners(brightness(small), best.corners, layout, windows=WINDOWS_BY_HAND)
    moved = np.linalg.norm(refined - best.corners, axis=1).max() / pitch_of(best.corners, layout)
    notes: tuple[str, ...] = ()
    if locked >= LOCKED and moved <= NEAR:
        score = label(small, refined, side, layout, expected, reach=0).score
        best = replace(best, corners=refined, side=side, locked=locked, score=score)
    else:
        notes = ("No patch borders lie near the corners given by hand: they were kept as they are.",)
    if best.score < ACCEPT_BY_HAND:
        raise ChartNotFound(
            f"{mosaic.path}: the colours inside the corners given by hand do not agree with the chart.",
            "Give the outer corners of the block of patches, one after the other, and check the chart's name.",
            value=best.score,
            threshold=ACCEPT_BY_HAND,
        )
    best = replace(best, corners=small.to_mosaic(best.corners))
    if best.mirrored:
        raise _mirrored(mosaic, best)
    return _pose(best, layout, "by hand", notes)


def _checked(corners: ArrayLike, mosaic: Mosaic) -> Floats:
    """Corners given by hand as an array; raises InvalidArgument if they are invalid."""
    advice = "Give four points x,y in pixels of the photo, one after the other around the block of patches."
    try:
        points = np.asarray(corners, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidArgument("The corners are not numbers.", advice) from None
    if points.shape != (4, 2):
        raise InvalidArgument(f"The corners have the shape {points.shape}, not four points of two.", advice)
    if not np.isfinite(points).all():
        raise InvalidArgument("A number of the corners is not finite.", advice)
    limit = np.array(mosaic.samples.shape[::-1]) - 1
    if np.any(points < 0) or np.any(points > limit):
        raise InvalidArgument(f"A corner lies outside the photo of {limit[0] + 1} × {limit[1] + 1} px.", advice)
    if not convex(points):
        raise InvalidArgument("The corners do not go around a convex quadrilateral.", advice)
    return points


def _mirrored(mosaic: Mosaic, match: Match) -> ChartNotFound:
    return ChartNotFound(
        f"{mosaic.path}: the chart is mirrored (its colours agree as seen in a mirror, {match.score:.2f}).",
        "Photograph the chart itself, not its mirror image, and export the RAW without flipping it.",
    )


def _others(matches: list[Match]) -> tuple[str, ...]:
    """A note if another grid was proposed away from the best one."""
    low, high = matches[0].corners.min(axis=0), matches[0].corners.max(axis=0)
    apart = [m for m in matches[1:] if np.any((m.proposed.max(axis=0) < low) | (m.proposed.min(axis=0) > high))]
    if not apart:
        return ()
    return (
        "A second grid of patches was in view: the one whose colours agree better with the chart was taken "
        f"({matches[0].score:.2f} against {max(m.score for m in apart):.2f}).",
    )


def _pose(match: Match, layout: ChartLayout, method: str, notes: tuple[str, ...]) -> Pose:
    lattice = homography(block_corners(layout, match.side), match.corners)
    patches = patch_corners(lattice, layout, match.side)
    across = match.corners[[1, 2]].sum(axis=0) - match.corners[[0, 3]].sum(axis=0)
    turns = round(float(np.degrees(np.arctan2(across[1], across[0]))) / 90) % 4
    score = min(max(match.score, 0.0), 1.0)
    return Pose(layout.name, match.corners, patches, turns, method, score, notes)
