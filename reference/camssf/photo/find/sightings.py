"""Finds the charts in a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats
from camssf.photo.find.blobs import blobs_in
from camssf.photo.find.chart_colours import ChartColours, chart_colours, limit
from camssf.photo.find.lattices import grids_of, mapped
from camssf.photo.find.orientation import ACCEPT, ACCEPT_LUMA, orient, outline, placed
from camssf.photo.find.picture import SMALLEST, SearchImage

MOST_GRIDS: int = limit("most_grids")


@dataclass(frozen=True)
class Sighting:
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

    sightings: tuple[Sighting, ...]
    findings: tuple[str, ...]


def find_sightings(codes: SearchImage, kinds: tuple[ChartColours, ...] | None = None) -> FoundCharts:
    """Find charts of these kinds (default: the shipped ones); if there is none, in the picture at half its size."""
    kinds = chart_colours() if kinds is None else kinds
    sightings = _look(codes, kinds)
    if not sightings and min(codes.values.shape[:2]) >= 2 * SMALLEST:
        sightings = _look(codes.halved(), kinds)
    findings = [] if sightings else ["none"]
    if sightings and sightings[0].mirrored:
        findings.append("mirrored")
    if len(sightings) > 1:
        findings.append("two_charts")
    return FoundCharts(tuple(sightings), tuple(findings))


def _look(codes: SearchImage, kinds: tuple[ChartColours, ...]) -> list[Sighting]:
    blobs = blobs_in(codes)
    accept = ACCEPT if codes.values.shape[2] == 3 else ACCEPT_LUMA
    sightings: list[Sighting] = []
    for grid in grids_of(blobs)[:MOST_GRIDS]:
        best = None
        for kind in kinds:
            match = orient(codes, grid, kind)
            if match is not None and match.score >= accept and (best is None or match.score > best.score):
                best = match
        if best is None:
            continue
        fit = placed(grid, best, blobs)
        if fit is None:
            continue
        h, seen = fit
        kind = best.kind
        centres = [mapped(h, float(k % kind.columns), float(k // kind.columns)) for k in range(len(kind.colours))]
        sightings.append(
            Sighting(
                kind.name,
                codes.to_source(np.array(outline(h, kind))),
                codes.to_source(np.array(centres)),
                best.mirrored,
                min(max(best.score, 0.0), 1.0),
                seen,
            )
        )
    sightings.sort(key=lambda s: -s.confidence)
    return _apart(sightings)


def _apart(sightings: list[Sighting]) -> list[Sighting]:
    """Drop sightings that overlap a better one."""
    kept: list[Sighting] = []
    for sighting in sightings:
        if not any(_overlap(sighting, other) for other in kept):
            kept.append(sighting)
    return kept


def _overlap(a: Sighting, b: Sighting) -> bool:
    """True if a patch of one is nearer than half a pitch to a patch of the other."""
    step = b.patches[1] - b.patches[0]
    near = 0.25 * float(step[0] * step[0] + step[1] * step[1])
    gaps = a.patches[:, None, :] - b.patches[None, :, :]
    return bool((gaps[..., 0] * gaps[..., 0] + gaps[..., 1] * gaps[..., 1] < near).any())
