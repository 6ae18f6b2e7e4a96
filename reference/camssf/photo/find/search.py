"""Searches a mosaic for grids of patches that may be the chart, and orients each by its colours.

camssf's own finder (`candidates`) proposes, and OpenCV's cv2.mcc (`opencv_proposals`) if the finder's best is not
sure. `refine_corners` moves each proposal to the printed borders, and `agreement` compares its colours with the
table's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from camssf.grid import CHANNELS, WAVELENGTHS, Floats
from camssf.photo.find.candidates import find_candidates
from camssf.photo.find.chart_colours import CHROMA, ChartColours
from camssf.photo.find.geometry import WINDOWS, area, block_corners, convex, homography, map_points, refine_corners
from camssf.photo.find.picture import Thumbnail, brightness, codes_of_mosaic, thumbnail, thumbnail_around
from camssf.photo.read.dng import Mosaic
from camssf.rules import rules
from camssf.spectra import ChartTable
from camssf.spectra.layouts import ChartLayout

ATTEMPTS: tuple[tuple[int, int, bool], ...] = ((1000, 0, False), (1000, 1000, False), (1600, 0, True))
"""Longest side of the thumbnail, px; smallest picture for cv2.mcc (it enlarges others); whether contrast is
equalised."""

SMALLEST = 32
"""Smallest side of a picture for cv2.mcc, px."""


def opencv_proposals(
    mosaic: Mosaic, layout: ChartLayout, _expected: Floats
) -> Iterator[tuple[Thumbnail, list[Floats]]]:
    """A thumbnail for each attempt, and the quadrilaterals (4, 2) in it that cv2.mcc accepts as such a chart.

    cv2.mcc knows no layout of the user's own.
    """
    if not layout.shipped:
        return
    for longest, smallest, equalise in ATTEMPTS:
        small = thumbnail(mosaic, longest)
        yield small, _quads(_rendered(small.colours, equalise), layout, smallest)


def _rendered(colours: NDArray[np.float32], equalise: bool) -> NDArray[np.uint8]:
    """8-bit BGR picture: each channel relative to its 98th percentile, gamma 2.2."""
    import cv2

    tops = np.maximum(np.percentile(colours[::4, ::4], 98, axis=(0, 1)), 1.0).astype(np.float32)
    shown = np.clip(colours / tops, 0, 1) ** np.float32(1 / 2.2)
    picture = np.ascontiguousarray((255 * shown[:, :, ::-1]).astype(np.uint8))
    if equalise:
        tiles = cv2.createCLAHE(clipLimit=4.0, tileGridSize=(8, 8))
        picture = cv2.merge([tiles.apply(plane) for plane in cv2.split(picture)])
    return picture


def _quads(picture: NDArray[np.uint8], layout: ChartLayout, smallest: int) -> list[Floats]:
    import cv2

    if min(picture.shape[:2]) < SMALLEST:
        return []
    detector = cv2.mcc.CCheckerDetector.create()
    options = cv2.mcc.DetectorParametersMCC()
    options.minImageSize = smallest
    detector.setDetectionParams(options)
    detector.setColorChartType(cv2.mcc.SG140 if layout.columns == 14 else cv2.mcc.MCC24)
    try:
        if not detector.process(picture, 4):
            return []
        checkers = detector.getListColorChecker()
    except cv2.error:  # it fails on some pictures; the next attempt may work
        return []
    quads = [np.array(c.getBox(), dtype=np.float64) for c in checkers]
    return [quad for quad in quads if quad.shape == (4, 2) and np.isfinite(quad).all() and convex(quad)]


ACCEPT = 0.75
"""Correlation with the table's colours from which a grid of patches is accepted as the chart."""

SURE = 0.95
"""Agreement from which the finder's own match needs no second opinion."""

REFINE = 0.3
"""Agreement from which a proposal is refined."""

LONGEST = 1000
"""Longest side of the thumbnail on which the finder's candidates are refined, px."""
DARKEST, FWHM, SPOT_STEP = (rules().number(f"pose.{word}") for word in ("darkest", "fwhm", "spot_step"))
CENTRES: Floats = np.array([rules().number(f"pose.{colour}") for colour in CHANNELS])
SPOTS = rules().whole("pose.spots")


@dataclass(frozen=True)
class Match:
    """A grid compared with the colours: corners (4, 2) px in the chart's own order; `proposed` by the detector."""

    corners: Floats
    side: tuple[float, float]
    locked: float
    score: float
    mirrored: bool
    proposed: Floats
    detector: str = ""


@dataclass(frozen=True)
class Detector:
    """Proposes grids of patches; the search ends with the first proposals of which one agrees by `enough`."""

    name: str
    proposals: Callable[[Mosaic, ChartLayout, Floats], Iterator[tuple[Thumbnail, list[Floats]]]]
    enough: float


def own_proposals(mosaic: Mosaic, layout: ChartLayout, expected: Floats) -> Iterator[tuple[Thumbnail, list[Floats]]]:
    """A thumbnail, and in it the corners (4, 2) of the charts with such a grid that camssf's own finder sights.

    A layout of the user's own is searched by the colours `expected`, the shipped ones by those of `finder.json`.
    """
    kinds = None if layout.shipped else (own_kind(layout, expected),)
    size = layout.columns * layout.rows
    corners = [
        s.corners for s in find_candidates(codes_of_mosaic(mosaic), kinds).candidates if len(s.patches) == size
    ]
    if corners:
        small = thumbnail(mosaic, LONGEST)
        yield small, [small.from_mosaic(corner) for corner in corners]


def own_kind(layout: ChartLayout, expected: Floats) -> ChartColours:
    """The kind of chart of a user's own layout, with the signals (n, 3) of its table (`plain_signals`)."""
    return ChartColours(layout.name, layout.columns, layout.rows, layout.side, expected)


OWN = Detector("camssf", own_proposals, SURE)
OPENCV = Detector("OpenCV", opencv_proposals, ACCEPT)


def matches_in(
    mosaic: Mosaic, layout: ChartLayout, expected: Floats, detectors: tuple[Detector, ...] = (OWN, OPENCV)
) -> list[Match]:
    """Grids that may be the chart with the colours `expected` (n, 3), best first, from one detector after another."""
    matches: list[Match] = []
    for detector in detectors:
        for small, quads in detector.proposals(mosaic, layout, expected):
            refined = [_refined_match(small, quad, layout, expected) for quad in quads]
            matches += [replace(match, detector=detector.name) for match in refined]
            matches.sort(key=lambda m: -m.score)
            if matches and matches[0].score >= detector.enough:
                return matches
    return matches


def agreement(measured: Floats, expected: Floats) -> float:
    """Correlation of patch colours with the table's prediction, -1 to 1, independent of colour cast and exposure.

    Each channel's mean of ln c over the patches is removed (one free gain for each channel); the rest is split into
    lightness, the mean over channels, and chroma, the difference from it, which has double weight.

    Args:
        measured: (n, 3) DN above black; values below DARKEST of the largest are raised to that.
        expected: (n, 3) predicted signals, any scale.
    """

    def features(c: Floats) -> Floats:
        logs = np.log(np.maximum(c, max(DARKEST * float(c.max()), 1e-12)))
        logs = logs - logs.mean(axis=0)
        lightness = logs.mean(axis=1, keepdims=True)
        return np.concatenate([lightness, CHROMA * (logs - lightness)], axis=1)

    x, y = features(measured), features(expected)
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    return float(np.sum(x * y)) / size if size > 0 else 0.0


def plain_signals(table: ChartTable, power: Floats | None = None) -> Floats:
    """(n, 3) signals of a camera with Gaussian curves of `pose.red` ... under a lamp of `power` (681,).

    Without `power`, the lamp has a flat spectrum.
    """
    curves = np.exp(-4 * np.log(2) * ((WAVELENGTHS[:, None] - CENTRES) / FWHM) ** 2)
    curves = curves if power is None else curves * power[:, None]
    return np.asarray(table.values @ (curves / curves.sum(axis=0)))


def _refined_match(small: Thumbnail, quad: Floats, layout: ChartLayout, expected: Floats) -> Match:
    """Refine a proposal and orient it by its colours."""
    image = brightness(small)
    around = quad if area(quad) > 0 else quad[::-1]  # clockwise, so that only a mirrored chart appears mirrored
    starts = [np.roll(around, -first, axis=0) for first in (0, 1)]  # either side may run along the columns
    guesses = [orient_corners(small, start, layout.side, layout, expected, reach=1) for start in starts]
    best = Match(around, layout.side, 0.0, -1.0, False, quad)
    for guess in sorted(guesses, key=lambda g: -g.score):
        if guess.score < REFINE:
            best = guess if guess.score > best.score else best
            continue
        corners, side, locked = refine_corners(image, guess.corners, layout)
        match = orient_corners(small, corners, side, layout, expected, reach=1)
        if np.abs(match.corners - corners).max() > 0.01:  # turned, or one patch off
            corners, side, locked = refine_corners(image, match.corners, layout)
            match = orient_corners(small, corners, side, layout, expected, reach=0)
        if match.score > best.score:
            best = replace(match, locked=locked)
        if best.score >= ACCEPT:
            break
    return replace(best, corners=small.to_mosaic(best.corners), proposed=small.to_mosaic(quad))


def orient_corners(
    small: Thumbnail, corners: Floats, side: tuple[float, float], layout: ChartLayout, expected: Floats, reach: int
) -> Match:
    """Orient the lattice by its colours; the chart may also lie up to `reach` patches away from `corners`.

    A quarter turn is another lattice: the caller tries both. Input and output corners are px of `small`.
    """
    span = -(SPOTS // 2) * SPOT_STEP + np.arange(SPOTS) * SPOT_STEP
    columns = np.arange(-reach, layout.columns + reach, dtype=np.float64)
    rows = np.arange(-reach, layout.rows + reach, dtype=np.float64)
    block = block_corners(layout, side)
    lattice = homography(block, corners)
    spots = np.stack(np.meshgrid(columns, rows), axis=-1)[:, :, None, None] + np.stack(
        np.meshgrid(span * side[0], span * side[1]), axis=-1
    )
    pixels = np.rint(map_points(lattice, spots)).astype(np.int64)
    height, width = small.colours.shape[:2]
    x, y = np.clip(pixels[..., 0], 0, width - 1), np.clip(pixels[..., 1], 0, height - 1)
    colours = small.colours[y, x].mean(axis=(2, 3), dtype=np.float64)
    best = Match(corners, side, 0.0, -2.0, False, corners)
    for dy in range(2 * reach + 1):
        for dx in range(2 * reach + 1):
            part = colours[dy : dy + layout.rows, dx : dx + layout.columns]
            moved = map_points(lattice, block + np.array([dx - reach, dy - reach]))
            for turned in (part, part[::-1, ::-1]):
                for mirrored in (False, True):
                    upright = turned[:, ::-1] if mirrored else turned
                    score = agreement(upright.reshape(-1, 3), expected)
                    if score > best.score:
                        order = np.roll(moved, 2, axis=0) if turned is not part else moved
                        best = Match(order, side, 0.0, score, mirrored, corners)
    return best


def refine_closely(mosaic: Mosaic, match: Match, layout: ChartLayout) -> Match:
    """Refine a match on a closer picture; keeps `match` if that finds clearly fewer borders."""
    small = thumbnail_around(mosaic, match.corners, layout, margin=0.1)
    corners, side, locked = refine_corners(
        brightness(small), small.from_mosaic(match.corners), layout, windows=WINDOWS[-2:]
    )
    if locked < match.locked - 0.1:
        return match
    return replace(match, corners=small.to_mosaic(corners), side=side, locked=locked)
