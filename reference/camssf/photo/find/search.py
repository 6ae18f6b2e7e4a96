"""Searches a mosaic for grids of patches that may be the chart, and orients each by its colours.

OpenCV's cv2.mcc proposes quadrilaterals in a small display-like picture of the mosaic; `refine_corners` moves each
to the printed borders, and `agreement` compares its colours with the table's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.find.layouts import ChartLayout, area, block_corners, convex, homography, map_points
from camssf.photo.find.refine import WINDOWS, refine_corners
from camssf.photo.read.dng import Mosaic
from camssf.spectra import ChartTable

ACCEPT = 0.75
"""Correlation with the table's colours from which a grid of patches is accepted as the chart."""

WORTH = 0.3
"""A proposal whose colours agree less than this is not refined."""


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


@dataclass(frozen=True)
class Match:
    """A grid compared with the colours: corners (4, 2) px in the chart's own order; `proposed` as found."""

    corners: Floats
    side: tuple[float, float]
    locked: float
    score: float
    mirrored: bool
    proposed: Floats


@dataclass(frozen=True)
class Rendering:
    """Settings for rendering a reduced picture for the detector."""

    percentile: float = 98.0
    gamma: float = 2.2
    balance: bool = True
    equalise: bool = False


ATTEMPTS: tuple[tuple[int, Rendering, int], ...] = (
    (1000, Rendering(), 0),
    (1000, Rendering(), 1000),
    (1600, Rendering(equalise=True), 0),
    (1600, Rendering(gamma=3.5), 0),
    (1600, Rendering(percentile=90), 0),
    (2400, Rendering(), 0),
    (2400, Rendering(balance=False, equalise=True), 0),
)
"""Tried in turn: longest side of the thumbnail, px; rendering; smallest picture for cv2.mcc (it enlarges others)."""


def matches_in(mosaic: Mosaic, layout: ChartLayout, expected: Floats) -> list[Match]:
    """Candidates for the chart, best first, from attempts until one agrees with the colours `expected` (n, 3)."""
    matches: list[Match] = []
    for longest, rendering, smallest in ATTEMPTS:
        small = thumbnail(mosaic, longest)
        for quad in _propose(_render(small.colours, rendering), layout, smallest):
            matches.append(_match(small, quad, layout, expected))
        matches.sort(key=lambda m: -m.score)
        if matches and matches[0].score >= ACCEPT:
            break
    return matches


def match_near(mosaic: Mosaic, quad: Floats, layout: ChartLayout, expected: Floats) -> Match:
    """The match near corners (4, 2) px of another detector, refined and oriented like cv2.mcc's proposals."""
    small = thumbnail(mosaic, ATTEMPTS[0][0])
    return _match(small, small.from_mosaic(quad), layout, expected)


def agreement(measured: Floats, expected: Floats) -> float:
    """Correlation of patch colours with the table's prediction, -1 to 1, independent of colour cast and exposure.

    Each channel's mean of ln c over the patches is removed (one free gain for each channel); the rest is split into
    lightness, the mean over channels, and chroma, the difference from it, which has double weight.

    Args:
        measured: (n, 3) DN above black; values below 0.2 % of the largest are raised to that.
        expected: (n, 3) predicted signals, any scale.
    """

    def features(c: Floats) -> Floats:
        logs = np.log(np.maximum(c, max(2e-3 * float(c.max()), 1e-12)))
        logs = logs - logs.mean(axis=0)
        lightness = logs.mean(axis=1, keepdims=True)
        return np.concatenate([lightness, 2 * (logs - lightness)], axis=1)

    x, y = features(measured), features(expected)
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    return float(np.sum(x * y)) / size if size > 0 else 0.0


def plain_signals(table: ChartTable, power: Floats | None = None) -> Floats:
    """(n, 3) signals of a camera with Gaussian curves (600, 540, 455 nm, FWHM 90 nm) under a lamp of `power` (681,).

    Without `power`, the lamp has a flat spectrum.
    """
    curves = np.exp(-4 * np.log(2) * ((WAVELENGTHS[:, None] - np.array([600.0, 540.0, 455.0])) / 90) ** 2)
    curves = curves if power is None else curves * power[:, None]
    return np.asarray(table.values @ (curves / curves.sum(axis=0)))


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


def _render(colours: NDArray[np.float32], rendering: Rendering) -> NDArray[np.uint8]:
    """8-bit BGR rendering for the detector."""
    import cv2

    thin = colours[::4, ::4]
    tops = np.maximum(np.percentile(thin, rendering.percentile, axis=(0, 1)), 1.0).astype(np.float32)
    if not rendering.balance:
        tops[:] = tops.max()
    shown = np.clip(colours / tops, 0, 1) ** np.float32(1 / rendering.gamma)
    picture = np.ascontiguousarray((255 * shown[:, :, ::-1]).astype(np.uint8))
    if rendering.equalise:
        tiles = cv2.createCLAHE(clipLimit=4.0, tileGridSize=(8, 8))
        picture = cv2.merge([tiles.apply(plane) for plane in cv2.split(picture)])
    return picture


def _propose(picture: NDArray[np.uint8], layout: ChartLayout, smallest: int) -> list[Floats]:
    """Quadrilaterals (4, 2) that cv2.mcc accepts as such a chart, best first."""
    import cv2

    if min(picture.shape[:2]) < 32:
        return []
    detector = cv2.mcc.CCheckerDetector.create()
    options = cv2.mcc.DetectorParametersMCC()
    options.minImageSize = smallest
    detector.setDetectionParams(options)
    detector.setColorChartType(cv2.mcc.SG140 if layout.columns == 14 else cv2.mcc.MCC24)
    try:
        if not detector.process(picture, 4):
            return []
        found = detector.getListColorChecker()
    except cv2.error:  # it fails on some pictures; the next rendering may work
        return []
    quads = [np.array(c.getBox(), dtype=np.float64) for c in found]
    return [quad for quad in quads if quad.shape == (4, 2) and np.isfinite(quad).all() and convex(quad)]


def brightness(small: Thumbnail) -> Floats:
    """(h, w) sum over channels of √(signal / its 98th percentile): even noise, and visible dark patches."""
    tops = np.maximum(np.percentile(small.colours[::4, ::4], 98, axis=(0, 1)), 1.0)
    total = np.zeros(small.colours.shape[:2])
    for channel in range(3):
        total += np.sqrt(np.maximum(small.colours[:, :, channel] / tops[channel], 0))
    return total


def _match(small: Thumbnail, quad: Floats, layout: ChartLayout, expected: Floats) -> Match:
    """Refine a proposal and orient it by its colours."""
    image = brightness(small)
    around = quad if area(quad) > 0 else quad[::-1]  # clockwise, so that only a mirrored chart appears mirrored
    starts = [np.roll(around, -first, axis=0) for first in (0, 1)]  # either side may run along the columns
    guesses = [label(small, start, layout.side, layout, expected, reach=1) for start in starts]
    best = Match(around, layout.side, 0.0, -1.0, False, quad)
    for guess in sorted(guesses, key=lambda g: -g.score):
        if guess.score < WORTH:
            best = guess if guess.score > best.score else best
            continue
        corners, side, locked = refine_corners(image, guess.corners, layout)
        match = label(small, corners, side, layout, expected, reach=1)
        if np.abs(match.corners - corners).max() > 0.01:  # turned, or one patch off
            corners, side, locked = refine_corners(image, match.corners, layout)
            match = label(small, corners, side, layout, expected, reach=0)
        if match.score > best.score:
            best = replace(match, locked=locked)
        if best.score >= ACCEPT:
            break
    return replace(best, corners=small.to_mosaic(best.corners), proposed=small.to_mosaic(quad))


def label(
    small: Thumbnail, corners: Floats, side: tuple[float, float], layout: ChartLayout, expected: Floats, reach: int
) -> Match:
    """Orient the lattice by its colours; the chart may also lie up to `reach` patches away from `corners`.

    A quarter turn is another lattice: the caller tries both. Input and output corners are px of `small`.
    """
    span = np.arange(-0.2, 0.21, 0.1)
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
    seen = small.colours[y, x].mean(axis=(2, 3), dtype=np.float64)
    best = Match(corners, side, 0.0, -2.0, False, corners)
    for dy in range(2 * reach + 1):
        for dx in range(2 * reach + 1):
            part = seen[dy : dy + layout.rows, dx : dx + layout.columns]
            moved = map_points(lattice, block + np.array([dx - reach, dy - reach]))
            for turned in (part, part[::-1, ::-1]):
                for mirrored in (False, True):
                    named = turned[:, ::-1] if mirrored else turned
                    score = agreement(named.reshape(-1, 3), expected)
                    if score > best.score:
                        order = np.roll(moved, 2, axis=0) if turned is not part else moved
                        best = Match(order, side, 0.0, score, mirrored, corners)
    return best


def finer(mosaic: Mosaic, match: Match, layout: ChartLayout, enough: float = 40.0) -> Match:
    """Refine a match on a closer picture; keeps `match` if that finds clearly fewer borders."""
    low, high = match.corners.min(axis=0), match.corners.max(axis=0)
    margin = 0.1 * (high - low)
    bounds = np.array(mosaic.samples.shape[::-1])
    box = (
        *np.maximum(low - margin, 0).astype(int).tolist(),
        *np.minimum(high + margin, bounds).astype(int).tolist(),
    )
    small = thumbnail(mosaic, max(64, int(enough * max(layout.columns, layout.rows))), box)
    corners, side, locked = refine_corners(
        brightness(small), small.from_mosaic(match.corners), layout, windows=WINDOWS[-2:]
    )
    if locked < match.locked - 0.1:
        return match
    return replace(match, corners=small.to_mosaic(corners), side=side, locked=locked)
