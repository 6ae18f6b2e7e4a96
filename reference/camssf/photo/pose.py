"""Mosaic → pose: where the chart lies and which way up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.errors import ChartNotFound, InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.mosaic import Mosaic
from camssf.spectra import ChartTable

ACCEPT = 0.75
"""Correlation with the table's colours from which a grid of patches is taken for the chart."""

ACCEPT_BY_HAND = 0.6
"""The same for corners given by hand, where somebody has seen the chart."""

WINDOWS = (0.40, 0.25, 0.15, 0.10, 0.10)
"""How far from the expected place each round of `refine_corners` looks for a border, in pitches."""

WINDOWS_BY_HAND = (0.50, 0.25, 0.15, 0.10, 0.10)
"""The same for corners given by hand: a tap may be off by half a patch; beyond half a pitch the next patch begins."""

NEAR = 0.55
"""How far `refine_corners` may move a corner given by hand, in pitches."""

LOCKED = 0.6
"""Share of patch borders that must lie where the lattice says."""

SMALLEST = 64
"""Sides of a photo, px, in which a chart can be looked for."""

WORTH = 0.3
"""Agreement of a proposal's colours, before it is refined, below which it is not refined at all."""


@dataclass(frozen=True)
class ChartLayout:
    """The printed geometry of a chart, in units of its patch pitch (centre to centre).

    Attributes:
        name: key in LAYOUTS.
        columns, rows: of patches; patch i lies at column i % columns, row i // columns.
        side: edge of a patch in pitches, along x and y (the rest is the gap).
        products: what is sold in this geometry.
    """

    name: str
    columns: int
    rows: int
    side: tuple[float, float]
    products: str


LAYOUTS: dict[str, ChartLayout] = {
    layout.name: layout
    for layout in (
        ChartLayout("classic24", 6, 4, (0.88, 0.88), "ColorChecker Classic (X-Rite, Calibrite, Macbeth)"),
        ChartLayout("passport24", 6, 4, (0.83, 0.83), "ColorChecker Passport Photo and Video, classic page"),
        ChartLayout("nano24", 6, 4, (0.86, 0.86), "ColorChecker Classic Nano"),
        ChartLayout("mini24", 6, 4, (0.88, 0.88), "ColorChecker Classic Mini"),
        ChartLayout("sg140", 14, 10, (0.835, 0.836), "ColorChecker Digital SG"),
    )
}
"""The charts that camssf knows, by name. `find_chart` measures the gap anew in every photo."""


@dataclass(frozen=True)
class Pose:
    """Where the chart lies.

    All points are (x, y) in pixels of the active area, where the centre of the first sample is (0, 0).
    Corners run top left, top right, bottom right, bottom left **of the chart**, not of the photo.

    Attributes:
        layout: name of the ChartLayout.
        corners: (4, 2) outer corners of the block of patches (outer borders of the corner patches).
        patches: (n, 4, 2) corners of each patch, on its borders, in the chart's reading order.
        quarter_turns: how often 90° clockwise turns the chart as photographed from upright: 0 to 3.
        method: "detected" or "by hand".
        score: agreement with the chart's own colours, 0 to 1 (correlation).
        notes: what the user should know, e.g. that a second chart was in view.
    """

    layout: str
    corners: Floats
    patches: Floats
    quarter_turns: int
    method: str
    score: float
    notes: tuple[str, ...]


def find_chart(mosaic: Mosaic, table: ChartTable, *, corners: ArrayLike | None = None) -> Pose:
    """Find the chart of `table` in the photo, to its patch borders, right way up.

    OpenCV's cv2.mcc proposes grids in a small display-like picture of the mosaic; if none agrees with the
    table's colours, other renderings and sizes follow. `refine_corners` moves a grid to the printed borders,
    and the colours choose among the four turns, whatever the cast and the exposure (`agreement`).

    Args:
        mosaic: the photo.
        table: of the chart that is looked for; its layout is a key of LAYOUTS.
        corners: (4, 2) outer corners of the block of patches by hand, one after the other around the block
            from any of them, px of the active area, off by half a patch at most. Refined where the borders lie
            near, else kept.

    Raises:
        ChartNotFound: nothing looks like this chart, or it is mirrored.
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
    matches: list[_Match] = []
    for longest, look, smallest in ATTEMPTS:
        view = _view(mosaic, longest)
        for quad in _propose(_display(view.colours, look), layout, smallest):
            matches.append(_match(view, quad, layout, expected))
        matches.sort(key=lambda m: -m.score)
        if matches and matches[0].score >= ACCEPT:
            break
    if not matches or matches[0].score < ACCEPT:
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
    return _pose(_finer(mosaic, best, layout), layout, "detected", _others(matches))


def refine_corners(
    image: NDArray[np.floating[Any]],
    corners: ArrayLike,
    layout: ChartLayout,
    *,
    windows: tuple[float, ...] = WINDOWS,
) -> tuple[Floats, tuple[float, float], float]:
    """Move the corners of the block of patches to the printed borders, and measure the gap between them.

    The rule, in numbers. Lattice coordinates: the centre of patch (column i, row j) is (i, j), its borders
    lie sx/2, sy/2 away; H maps them to the picture. Each round, with w of `windows`:

    1. For each of a patch's four borders, the mean profile along its outward normal: offsets t = -w to w
       every 0.02 pitch, averaged over 9 places from -0.3 to 0.3 of the border's length; bilinear samples.
    2. Its fall at t: mean of the profile over t - 0.08 to t - 0.02 less the mean over t + 0.02 to t + 0.08
       (gaps are darker than their patches). The border is where fall · (1 - 0.5 (t/w)²) is largest, moved by
       the parabola through the three falls there. Weight: fall / (fall + median fall of all borders), 0 if
       negative or outside the picture.
    3. A correction of the lattice, linear in ten unknowns: for a vertical border seen at (u, v) of patch
       column i, u + a₀ + a₁u + a₂v - u(gu + hv) = i ± sx/2; for a horizontal one of row j,
       v + b₀ + b₁u + b₂v - v(gu + hv) = j ± sy/2. Weighted least squares, six times, each time with Tukey's
       weights (1 - (r/5s)²)², where s is 1.4826 times the median of |r|, at least 0.01. sx, sy stay within
       0.6 to 0.98. H ← H · correction⁻¹.

    Args:
        image: (h, w) brightness, any scale on which the patches are brighter than the gaps.
        corners: (4, 2) first guess, px of `image`: top left, top right, bottom right, bottom left.
        layout: columns, rows and the first guess of the gap.
        windows: of the rounds, in pitches.

    Returns:
        corners (4, 2), patch edge (sx, sy) in pitches, and the share of borders that were seen within 0.05
        pitch of where they should be; 0 if the lattice was lost, with the corners as they came.
    """
    start = np.asarray(corners, dtype=np.float64)
    side = np.array(layout.side)
    lattice = _homography(block_corners(layout, side), start)
    locked = 0.0
    for window in windows:
        found = _borders(np.asarray(image), lattice, side, layout, window)
        if np.count_nonzero(found[3]) < 10:  # unknowns
            return start, layout.side, 0.0
        correction, side, locked = _correct(*found, side)
        try:
            lattice = lattice @ np.linalg.inv(correction)
        except np.linalg.LinAlgError:
            return start, layout.side, 0.0
        moved = map_points(lattice, block_corners(layout, side))
        if not np.isfinite(moved).all() or not _convex(moved):
            return start, layout.side, 0.0
    return moved, (float(side[0]), float(side[1])), locked


def agreement(measured: Floats, expected: Floats) -> float:
    """Correlation of patch colours with what the table predicts, -1 to 1, whatever cast and exposure.

    From ln c each channel's mean over the patches is taken out (a free gain a channel); the rest is split into
    lightness, the mean over channels, and chroma, the difference from it, which counts double.

    Args:
        measured: (n, 3) DN above black; values below 0.2 % of the largest count as that.
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
    """Map (..., 2) points by a homography (3, 3)."""
    mapped = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(mapped[..., :2] / mapped[..., 2:])


@dataclass(frozen=True)
class _View:
    """A reduced picture: colours (h, w, 3) DN above black, one pixel `step` mosaic pixels from `origin` on."""

    colours: NDArray[np.float32]
    step: int
    origin: tuple[int, int]

    def to_mosaic(self, points: Floats) -> Floats:
        return np.asarray(self.step * points + (self.step - 1) / 2 + np.array(self.origin))

    def from_mosaic(self, points: Floats) -> Floats:
        return np.asarray((points - (self.step - 1) / 2 - np.array(self.origin)) / self.step)


@dataclass(frozen=True)
class _Match:
    """A grid compared with the colours: corners (4, 2) px, in the chart's own order; `seen` as proposed."""

    corners: Floats
    side: tuple[float, float]
    locked: float
    score: float
    mirrored: bool
    seen: Floats


@dataclass(frozen=True)
class _Look:
    """How a view is rendered for the detector."""

    percentile: float = 98.0
    gamma: float = 2.2
    balance: bool = True
    equalise: bool = False


ATTEMPTS: tuple[tuple[int, _Look, int], ...] = (
    (1000, _Look(), 0),
    (1000, _Look(), 1000),
    (1600, _Look(equalise=True), 0),
    (1600, _Look(gamma=3.5), 0),
    (1600, _Look(percentile=90), 0),
    (2400, _Look(), 0),
    (2400, _Look(balance=False, equalise=True), 0),
)
"""Tried in turn: longest side of the view, px; rendering; smallest picture of cv2.mcc (it enlarges others)."""


def _view(mosaic: Mosaic, longest: int, box: tuple[int, int, int, int] | None = None) -> _View:
    """Mean colours of the CFA cells of `box` (left, top, right, bottom), in whole-number blocks of cells.

    One plane of the CFA at a time, so that little more than a quarter of the mosaic is copied.
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
    return _View(colours, 2 * factor, (left, top))


def _display(colours: NDArray[np.float32], look: _Look) -> NDArray[np.uint8]:
    """8-bit BGR rendering for the detector."""
    import cv2

    thin = colours[::4, ::4]
    tops = np.maximum(np.percentile(thin, look.percentile, axis=(0, 1)), 1.0).astype(np.float32)
    if not look.balance:
        tops[:] = tops.max()
    shown = np.clip(colours / tops, 0, 1) ** np.float32(1 / look.gamma)
    picture = np.ascontiguousarray((255 * shown[:, :, ::-1]).astype(np.uint8))
    if look.equalise:
        tiles = cv2.createCLAHE(clipLimit=4.0, tileGridSize=(8, 8))
        picture = cv2.merge([tiles.apply(plane) for plane in cv2.split(picture)])
    return picture


def _propose(picture: NDArray[np.uint8], layout: ChartLayout, smallest: int) -> list[Floats]:
    """Quadrilaterals (4, 2) that cv2.mcc takes for such a chart, best first."""
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
    except cv2.error:  # it asserts on some pictures; the next rendering may do
        return []
    quads = [np.array(c.getBox(), dtype=np.float64) for c in found]
    return [quad for quad in quads if quad.shape == (4, 2) and np.isfinite(quad).all() and _convex(quad)]


def _brightness(view: _View) -> Floats:
    """(h, w) sum over channels of √(signal / its 98th percentile): even noise, and dark patches not lost."""
    tops = np.maximum(np.percentile(view.colours[::4, ::4], 98, axis=(0, 1)), 1.0)
    total = np.zeros(view.colours.shape[:2])
    for channel in range(3):
        total += np.sqrt(np.maximum(view.colours[:, :, channel] / tops[channel], 0))
    return total


def _match(view: _View, quad: Floats, layout: ChartLayout, expected: Floats) -> _Match:
    """A proposal, refined and labelled by its colours."""
    image = _brightness(view)
    around = quad if _area(quad) > 0 else quad[::-1]  # clockwise as seen, so that only a real mirror mirrors
    starts = [np.roll(around, -first, axis=0) for first in (0, 1)]  # which side runs along the columns?
    guesses = [_label(view, start, layout.side, layout, expected, reach=1) for start in starts]
    best = _Match(around, layout.side, 0.0, -1.0, False, quad)
    for guess in sorted(guesses, key=lambda g: -g.score):
        if guess.score < WORTH:
            best = guess if guess.score > best.score else best
            continue
        corners, side, locked = refine_corners(image, guess.corners, layout)
        match = _label(view, corners, side, layout, expected, reach=1)
        if np.abs(match.corners - corners).max() > 0.01:  # turned, or one patch off
            corners, side, locked = refine_corners(image, match.corners, layout)
            match = _label(view, corners, side, layout, expected, reach=0)
        if match.score > best.score:
            best = replace(match, locked=locked)
        if best.score >= ACCEPT:
            break
    return replace(best, corners=view.to_mosaic(best.corners), seen=view.to_mosaic(quad))


def _label(
    view: _View, corners: Floats, side: tuple[float, float], layout: ChartLayout, expected: Floats, reach: int
) -> _Match:
    """Which way up the lattice is, by its colours; it may also lie up to `reach` patches beside `corners`.

    A quarter turn is another lattice: the caller tries both. Corners in and out are px of the view.
    """
    span = np.arange(-0.2, 0.21, 0.1)
    columns = np.arange(-reach, layout.columns + reach, dtype=np.float64)
    rows = np.arange(-reach, layout.rows + reach, dtype=np.float64)
    block = block_corners(layout, side)
    lattice = _homography(block, corners)
    spots = np.stack(np.meshgrid(columns, rows), axis=-1)[:, :, None, None] + np.stack(
        np.meshgrid(span * side[0], span * side[1]), axis=-1
    )
    pixels = np.rint(map_points(lattice, spots)).astype(np.int64)
    height, width = view.colours.shape[:2]
    x, y = np.clip(pixels[..., 0], 0, width - 1), np.clip(pixels[..., 1], 0, height - 1)
    seen = view.colours[y, x].mean(axis=(2, 3), dtype=np.float64)
    best = _Match(corners, side, 0.0, -2.0, False, corners)
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
                        best = _Match(order, side, 0.0, score, mirrored, corners)
    return best


def _finer(mosaic: Mosaic, match: _Match, layout: ChartLayout, enough: float = 40.0) -> _Match:
    """Refine once more on a closer view if the patches were small in the first one."""
    low, high = match.corners.min(axis=0), match.corners.max(axis=0)
    margin = 0.1 * (high - low)
    bounds = np.array(mosaic.samples.shape[::-1])
    box = (
        *np.maximum(low - margin, 0).astype(int).tolist(),
        *np.minimum(high + margin, bounds).astype(int).tolist(),
    )
    view = _view(mosaic, max(64, int(enough * max(layout.columns, layout.rows))), box)
    corners, side, locked = refine_corners(
        _brightness(view), view.from_mosaic(match.corners), layout, windows=WINDOWS[-2:]
    )
    if locked < match.locked - 0.1:
        return match
    return replace(match, corners=view.to_mosaic(corners), side=side, locked=locked)


def _by_hand(mosaic: Mosaic, layout: ChartLayout, expected: Floats, corners: Floats) -> Pose:
    """The pose from corners given by hand: turned by the colours, moved to the borders if these lie near."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 0.15 * (high - low) + 8
    bounds = np.array(mosaic.samples.shape[::-1])
    box = (
        *np.maximum(low - margin, 0).astype(int).tolist(),
        *np.minimum(high + margin, bounds).astype(int).tolist(),
    )
    view = _view(mosaic, 40 * max(layout.columns, layout.rows), box)
    around = corners if _area(corners) > 0 else corners[::-1]
    tries = [
        _label(view, view.from_mosaic(np.roll(around, -first, axis=0)), layout.side, layout, expected, reach=0)
        for first in (0, 1)
    ]
    best = max(tries, key=lambda m: m.score)
    refined, side, locked = refine_corners(_brightness(view), best.corners, layout, windows=WINDOWS_BY_HAND)
    moved = np.linalg.norm(refined - best.corners, axis=1).max() / _pitch(best.corners, layout)
    notes: tuple[str, ...] = ()
    if locked >= LOCKED and moved <= NEAR:
        score = _label(view, refined, side, layout, expected, reach=0).score
        best = replace(best, corners=refined, side=side, locked=locked, score=score)
    else:
        notes = ("No patch borders lie near the corners given by hand: they were kept as they are.",)
    if best.score < ACCEPT_BY_HAND:
        raise ChartNotFound(
            f"{mosaic.path}: the colours inside the corners given by hand do not agree with the chart.",
            "Give the outer corners of the block of patches, one after the other, and check --chart.",
            value=best.score,
            threshold=ACCEPT_BY_HAND,
        )
    best = replace(best, corners=view.to_mosaic(best.corners))
    if best.mirrored:
        raise _mirrored(mosaic, best)
    return _pose(best, layout, "by hand", notes)


def _checked(corners: ArrayLike, mosaic: Mosaic) -> Floats:
    """Corners by hand as an array, or InvalidArgument."""
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
    if not _convex(points):
        raise InvalidArgument("The corners do not go around a convex quadrilateral.", advice)
    return points


def _mirrored(mosaic: Mosaic, match: _Match) -> ChartNotFound:
    return ChartNotFound(
        f"{mosaic.path}: the chart is mirrored (its colours agree as seen in a mirror, {match.score:.2f}).",
        "Photograph the chart itself, not its mirror image, and export the RAW without flipping it.",
    )


def _others(matches: list[_Match]) -> tuple[str, ...]:
    """A note if another grid was proposed beside the best one."""
    low, high = matches[0].corners.min(axis=0), matches[0].corners.max(axis=0)
    apart = [m for m in matches[1:] if np.any((m.seen.max(axis=0) < low) | (m.seen.min(axis=0) > high))]
    if not apart:
        return ()
    return (
        "A second grid of patches was in view: the one whose colours agree better with the chart was taken "
        f"({matches[0].score:.2f} against {max(m.score for m in apart):.2f}).",
    )


def _pose(match: _Match, layout: ChartLayout, method: str, notes: tuple[str, ...]) -> Pose:
    lattice = _homography(block_corners(layout, match.side), match.corners)
    patches = patch_corners(lattice, layout, match.side)
    across = match.corners[[1, 2]].sum(axis=0) - match.corners[[0, 3]].sum(axis=0)
    turns = round(float(np.degrees(np.arctan2(across[1], across[0]))) / 90) % 4
    score = min(max(match.score, 0.0), 1.0)
    return Pose(layout.name, match.corners, patches, turns, method, score, notes)


def plain_signals(table: ChartTable) -> Floats:
    """(n, 3) signals of a plain camera (Gaussians at 600, 540, 455 nm, FWHM 90 nm) under a flat lamp."""
    curves = np.exp(-4 * np.log(2) * ((WAVELENGTHS[:, None] - np.array([600.0, 540.0, 455.0])) / 90) ** 2)
    return np.asarray(table.values @ (curves / curves.sum(axis=0)))


_ALONG = np.linspace(-0.3, 0.3, 9)


def _homography(source: Floats, target: Floats) -> Floats:
    """(3, 3) map of four points to four points."""
    rows, right = [], []
    for (x, y), (u, v) in zip(source, target, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        right += [u, v]
    return np.append(np.linalg.solve(np.array(rows), np.array(right)), 1.0).reshape(3, 3)


def _area(quad: Floats) -> float:
    """Signed; positive if the corners run clockwise as seen (y down)."""
    x, y = quad[:, 0], quad[:, 1]
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def _convex(quad: Floats) -> bool:
    a = np.roll(quad, -1, axis=0) - quad
    b = np.roll(a, -1, axis=0)
    turns = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return bool(np.all(turns > 0) or np.all(turns < 0))


def _pitch(corners: Floats, layout: ChartLayout) -> float:
    """Mean distance of patch centres in px."""
    return float(np.sqrt(abs(_area(corners)) / (layout.columns * layout.rows)))


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


def _borders(
    image: NDArray[np.floating[Any]], lattice: Floats, side: Floats, layout: ChartLayout, window: float
) -> tuple[Floats, NDArray[np.int64], Floats, Floats]:
    """Where each border is seen: rules 1 and 2 of `refine_corners`.

    Returns:
        seen (e, 2) lattice coordinates, axis (e,) 0 for vertical borders, target (e, 2): patch index on that
        axis and -1 or 1 for its side, weight (e,).
    """
    index = np.arange(layout.columns * layout.rows)
    centres = np.stack([index % layout.columns, index // layout.columns], axis=1).astype(float)
    reach = round((window + 0.08) / 0.02)
    offsets = 0.02 * np.arange(-reach, reach + 1)
    seen, axes, targets, profiles = [], [], [], []
    for axis in (0, 1):
        for sign in (-1.0, 1.0):
            spots = np.repeat(np.repeat(centres[:, None, None, :], 9, axis=1), offsets.size, axis=2)
            spots[..., axis] += sign * (side[axis] / 2 + offsets)
            spots[..., 1 - axis] += (_ALONG * side[1 - axis])[:, None]
            profiles.append(_sample(image, map_points(lattice, spots)).mean(axis=1))
            seen.append(centres)
            axes.append(np.full(len(centres), axis))
            targets.append(np.stack([centres[:, axis], np.full(len(centres), sign)], axis=1))
    profile = np.concatenate(profiles)
    sums = np.cumsum(np.pad(profile, [(0, 0), (1, 0)]), axis=1)
    middle = np.arange(4, offsets.size - 4)
    fall = (sums[:, middle] - sums[:, middle - 4] - sums[:, middle + 5] + sums[:, middle + 1]) / 4
    fall = np.where(np.isfinite(fall), fall, -np.inf)
    t = offsets[middle]
    peak = np.argmax(fall * (1 - 0.5 * (t / window) ** 2), axis=1)
    height = fall[np.arange(len(fall)), peak]
    left, right = (fall[np.arange(len(fall)), np.clip(peak + d, 0, t.size - 1)] for d in (-1, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        bend = left - 2 * height + right
        step = np.where(np.isfinite(bend) & (bend < 0), 0.5 * (left - right) / bend, 0.0)
    place = t[peak] + 0.02 * np.clip(step, -1, 1)
    good = np.isfinite(height) & (height > 0)
    usual = float(np.median(height[good])) if good.any() else 1.0
    weight = np.where(good, np.where(good, height, 0) / (np.where(good, height, 0) + usual), 0.0)
    axis_of, target, where = np.concatenate(axes), np.concatenate(targets), np.concatenate(seen).copy()
    rows = np.arange(len(where))
    where[rows, axis_of] += target[:, 1] * (side[axis_of] / 2 + place)
    return where, axis_of, target, weight


def _correct(
    seen: Floats, axis: NDArray[np.int64], target: Floats, weight: Floats, side: Floats
) -> tuple[Floats, Floats, float]:
    """The lattice's correction (3, 3), the new patch edges, and the share of borders in place: rule 3."""
    u, v = seen[:, 0], seen[:, 1]
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
    for _ in range(6):
        root = np.sqrt(weight * robust)
        solution = np.linalg.lstsq(A * root[:, None], b * root, rcond=None)[0]
        solution[8:] = np.clip(solution[8:], 0.6, 0.98)
        residual = np.abs(A @ solution - b)
        spread = max(0.01, 1.4826 * float(np.median(residual[weight > 0])))
        robust = np.maximum(0, 1 - (residual / (5 * spread)) ** 2) ** 2
    a0, a1, a2, b0, b1, b2, g, h = solution[:8]
    correction = np.array([[1 + a1, a2, a0], [b1, 1 + b2, b0], [g, h, 1.0]])
    locked = float(np.mean((residual < 0.05) & (weight > 0)))
    return correction, solution[8:].copy(), locked
