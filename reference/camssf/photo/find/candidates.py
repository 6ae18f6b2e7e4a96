"""Finds the charts in a picture, and orients them by their colours: which corner is the first patch."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.photo.find.blobs import Blob, blobs_in
from camssf.photo.find.chart_colours import CHROMA, ChartColours, chart_colours, limit
from camssf.photo.find.lattices import BlobLattice, Matrix, fitted, inverse, lattices_of, mapped
from camssf.photo.find.picture import SMALLEST, SearchImage

ACCEPT: float = limit("accept")
ACCEPT_LUMA: float = limit("accept_luma")
FLOOR: float = limit("floor")
SPOTS: list[float] = limit("spots")
SEEN: float = limit("seen")
STRAY: float = limit("stray")
STRAY_MEDIANS: float = limit("stray_medians")
APART: float = limit("apart")
RING: float = limit("ring")


@dataclass(frozen=True)
class Placement:
    """A chart on a lattice: `places` (n, 2) lattice coordinates of the patches in the chart's order."""

    kind: ChartColours
    score: float
    mirrored: bool
    places: NDArray[np.int64]
    blobs: int


def orient(codes: SearchImage, lattice: BlobLattice, kind: ChartColours) -> Placement | None:
    """The placement that agrees best with the chart's colours; None if no part of the lattice can be the chart."""
    us, vs = [u for u, _ in lattice.places], [v for _, v in lattice.places]
    span = max(kind.columns, kind.rows) - 1
    left, right, top, bottom = min(us) - span, max(us) + span, min(vs) - span, max(vs) + span
    logs, inside = _colours(codes, lattice.map, (left, right, top, bottom))
    member = np.zeros(inside.shape, dtype=np.int64)
    for u, v in lattice.places:
        member[v - top, u - left] = 1
    wanted = features(np.log(kind.colours[None, :, :]), codes.values.shape[2])
    best: Placement | None = None
    for turn in range(4):
        for mirrored in (False, True):
            step = _steps(kind, turn, mirrored)
            low, high = step.min(axis=0), step.max(axis=0)
            starts = np.array(
                [
                    (u, v)
                    for v in range(-int(low[1]), inside.shape[0] - int(high[1]))
                    for u in range(-int(low[0]), inside.shape[1] - int(high[0]))
                ]
            )
            if starts.size == 0:
                continue
            places = starts[:, None, :] + step[None, :, :]
            seen = member[places[:, :, 1], places[:, :, 0]].sum(axis=1)
            good = (seen >= fewest(kind)) & inside[places[:, :, 1], places[:, :, 0]].all(axis=1)
            good &= _around(member, low, high, starts, seen) <= RING * 2 * (kind.columns + kind.rows + 2)
            places, seen = places[good], seen[good]
            if not len(places):
                continue
            scores = _correlation(features(logs[places[:, :, 1], places[:, :, 0]], logs.shape[2]), wanted)
            at = int(np.argmax(scores))
            if best is None or scores[at] > best.score:
                origin = np.array([left, top])
                best = Placement(kind, float(scores[at]), mirrored, places[at] + origin, int(seen[at]))
    return best


def fewest(kind: ChartColours) -> int:
    """Smallest number of patches that must have been found as blobs."""
    return math.ceil(SEEN * kind.columns * kind.rows)


def _steps(kind: ChartColours, turn: int, mirrored: bool) -> NDArray[np.int64]:
    """(n, 2) lattice steps from the first patch to each, for a chart turned by `turn` quarters."""
    index = np.arange(kind.columns * kind.rows)
    i, j = index % kind.columns, index // kind.columns
    if mirrored:
        i = -i
    turned = ((i, j), (-j, i), (-i, -j), (j, -i))[turn]
    return np.stack(turned, axis=1).astype(np.int64)


def _around(
    member: NDArray[np.int64],
    low: NDArray[np.int64],
    high: NDArray[np.int64],
    starts: NDArray[np.int64],
    observed: NDArray[np.int64],
) -> NDArray[np.int64]:
    """(m,) number of blobs in the ring of places around each block."""
    corner = np.zeros((member.shape[0] + 3, member.shape[1] + 3), dtype=np.int64)
    corner[2:-1, 2:-1] = np.cumsum(np.cumsum(member, axis=0), axis=1)
    corner[-1], corner[:, -1] = corner[-2], corner[:, -2]
    left, top = starts[:, 0] + low[0], starts[:, 1] + low[1]
    right, bottom = starts[:, 0] + high[0] + 3, starts[:, 1] + high[1] + 3
    whole = corner[bottom, right] - corner[top, right] - corner[bottom, left] + corner[top, left]
    return np.asarray(whole - observed)


def _colours(codes: SearchImage, h: Matrix, bounds: tuple[int, int, int, int]) -> tuple[Floats, NDArray[np.bool_]]:
    """Logarithms of the mean colours at every place (rows, columns, channels), and True for places in view."""
    left, right, top, bottom = bounds
    height, width, channels = codes.values.shape
    u, v = np.meshgrid(np.arange(left, right + 1.0), np.arange(top, bottom + 1.0))
    total = np.zeros((*u.shape, channels), dtype=np.int64)
    inside = np.ones(u.shape, dtype=bool)
    for dv in SPOTS:
        for du in SPOTS:
            p, q = u + du, v + dv
            w = h[6] * p + h[7] * q + h[8]
            ahead = w > 0.0
            w = np.where(ahead, w, 1.0)
            x = np.rint((h[0] * p + h[1] * q + h[2]) / w)
            y = np.rint((h[3] * p + h[4] * q + h[5]) / w)
            good = ahead & (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
            inside &= good
            column = np.where(good, x, 0).astype(np.int64)
            row = np.where(good, y, 0).astype(np.int64)
            total += codes.values[row, column]
    return np.log(total / float(len(SPOTS) * len(SPOTS)) + FLOOR), inside


def features(logs: Floats, channels: int) -> Floats:
    """Lightness, and doubled chroma if there is colour, of (m, n, channels) logarithms without each channel's mean.

    Means are summed in a fixed order, patch by patch, so that Kotlin gives the same bits.
    """
    if channels == 1 and logs.shape[2] == 3:  # a chart's colours for a picture without colour: green replaces luma
        logs = logs[:, :, 1:2]
    n = logs.shape[1]
    total = np.zeros((logs.shape[0], logs.shape[2]))
    for patch in range(n):
        total = total + logs[:, patch]
    centred = logs - (total / n)[:, None, :]
    if channels == 1:
        return np.asarray(centred)
    lightness = (centred[:, :, 0] + centred[:, :, 1] + centred[:, :, 2]) / 3.0
    chroma = CHROMA * (centred - lightness[:, :, None])
    return np.concatenate([lightness[:, :, None], chroma], axis=2)


def _correlation(observed: Floats, wanted: Floats) -> Floats:
    """(m,) correlations of (m, n, f) with (1, n, f), summed in a fixed order."""
    xy, xx, yy = np.zeros(len(observed)), np.zeros(len(observed)), 0.0
    for patch in range(observed.shape[1]):
        for f in range(observed.shape[2]):
            x, y = observed[:, patch, f], float(wanted[0, patch, f])
            xy, xx, yy = xy + x * y, xx + x * x, yy + y * y
    size = np.sqrt(xx * yy)
    scores = np.where(size > 0, xy / np.where(size > 0, size, 1.0), 0.0)
    # Nine digits: differences of logarithms between libraries must not decide between equal scores.
    return np.asarray(np.floor(scores * 1e9 + 0.5) / 1e9)


def placed(lattice: BlobLattice, placement: Placement, blobs: list[Blob]) -> tuple[Matrix, int] | None:
    """The homography from chart coordinates (column, row) to px, and the number of blobs that it was fitted to.

    Fitted to all blobs, and again without outliers, such as a blob that covers half a patch or two patches.
    """
    where = {(int(u), int(v)): k for k, (u, v) in enumerate(placement.places)}
    pairs = []
    for place, index in sorted(lattice.places.items()):
        k = where.get(place)
        if k is not None:
            pairs.append(
                (
                    float(k % placement.kind.columns),
                    float(k // placement.kind.columns),
                    blobs[index].x,
                    blobs[index].y,
                )
            )
    h = fitted(pairs)
    if h is None:
        return None
    offs = []
    back = inverse(h)
    for u, v, x, y in pairs:
        p, q = mapped(back, x, y)
        offs.append((p - u) * (p - u) + (q - v) * (q - v))
    limit = max(STRAY * STRAY, STRAY_MEDIANS * STRAY_MEDIANS * sorted(offs)[len(offs) // 2])
    straight = [pair for pair, off in zip(pairs, offs, strict=True) if off <= limit]
    if len(straight) < fewest(placement.kind):
        return None
    h = fitted(straight)
    return None if h is None else (h, len(straight))


def outline(h: Matrix, kind: ChartColours) -> list[tuple[float, float]]:
    """The block's four corners: top left, top right, bottom right, bottom left of the chart."""
    half, edge = kind.side[0] / 2, kind.side[1] / 2
    last, low = kind.columns - 1, kind.rows - 1
    ends = ((-half, -edge), (last + half, -edge), (last + half, low + edge), (-half, low + edge))
    return [mapped(h, u, v) for u, v in ends]


MOST_LATTICES: int = limit("most_lattices")


@dataclass(frozen=True)
class Candidate:
    """A chart in a picture. Points are px of the picture, where the centre of its first pixel is (0, 0).

    Attributes:
        kind: "classic24", which Classic, Nano, Mini and the Passport's classic page share, or "sg140",
            or the name of the user's own layout.
        corners: (4, 2) corners of the block of patches: top left, top right, bottom right, bottom left as printed.
        patches: (n, 2) centres, in the chart's reading order.
        mirrored: True if the colours agree with the chart seen in a mirror.
        confidence: agreement with the chart's colours, 0 to 1.
        blobs: number of patches found as blobs; the positions of the others follow from these.
    """

    kind: str
    corners: Floats
    patches: Floats
    mirrored: bool
    confidence: float
    blobs: int


@dataclass(frozen=True)
class FoundCharts:
    """The charts, best first, and remarks: "none", "mirrored", "two_charts"."""

    candidates: tuple[Candidate, ...]
    findings: tuple[str, ...]


def find_candidates(codes: SearchImage, kinds: tuple[ChartColours, ...] | None = None) -> FoundCharts:
    """Find charts of these kinds (default: the shipped ones); if there is none, in the picture at half its size."""
    kinds = chart_colours() if kinds is None else kinds
    candidates = _look(codes, kinds)
    if not candidates and min(codes.values.shape[:2]) >= 2 * SMALLEST:
        candidates = _look(codes.halved(), kinds)
    findings = [] if candidates else ["none"]
    if candidates and candidates[0].mirrored:
        findings.append("mirrored")
    if len(candidates) > 1:
        findings.append("two_charts")
    return FoundCharts(tuple(candidates), tuple(findings))


def _look(codes: SearchImage, kinds: tuple[ChartColours, ...]) -> list[Candidate]:
    blobs = blobs_in(codes)
    accept = ACCEPT if codes.values.shape[2] == 3 else ACCEPT_LUMA
    candidates: list[Candidate] = []
    for lattice in lattices_of(blobs)[:MOST_LATTICES]:
        best = None
        for kind in kinds:
            match = orient(codes, lattice, kind)
            if match is not None and match.score >= accept and (best is None or match.score > best.score):
                best = match
        if best is None:
            continue
        fit = placed(lattice, best, blobs)
        if fit is None:
            continue
        h, seen = fit
        kind = best.kind
        centres = [mapped(h, float(k % kind.columns), float(k // kind.columns)) for k in range(len(kind.colours))]
        candidates.append(
            Candidate(
                kind.name,
                codes.to_source(np.array(outline(h, kind))),
                codes.to_source(np.array(centres)),
                best.mirrored,
                min(max(best.score, 0.0), 1.0),
                seen,
            )
        )
    candidates.sort(key=lambda s: -s.confidence)
    return _apart(candidates)


def _apart(candidates: list[Candidate]) -> list[Candidate]:
    """Drop candidates that overlap a better one."""
    kept: list[Candidate] = []
    for candidate in candidates:
        if not any(_overlap(candidate, other) for other in kept):
            kept.append(candidate)
    return kept


def _overlap(a: Candidate, b: Candidate) -> bool:
    """True if a patch of one is too near to a patch of the other."""
    step = b.patches[1] - b.patches[0]
    near = APART * APART * float(step[0] * step[0] + step[1] * step[1])
    gaps = a.patches[:, None, :] - b.patches[None, :, :]
    return bool((gaps[..., 0] * gaps[..., 0] + gaps[..., 1] * gaps[..., 1] < near).any())
