"""Whether neighbouring samples of a mosaic share noise, as they do where a program has demosaiced or smoothed it.

A sensor's samples have independent noise. A mosaic made from a demosaiced picture has noise that neighbours of other
colours share; one that was smoothed has noise that next samples of one colour share. Texture of the chart does the
same, the more the less noise there is, so its part is removed by its growth with the signal-to-noise ratio.

All sums are of whole numbers, so they are the same in any order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.photo.find.pose import Pose
from camssf.photo.photon_noise import Estimate
from camssf.photo.read.dng import Mosaic
from camssf.photo.samples import cells_of, kept, samples_in
from camssf.rules import rules
from camssf.shapes import Size

ALONG, ACROSS, FEWEST_PAIRS = (rules().whole(f"noise.{word}") for word in ("along", "across", "fewest_pairs"))
SHARED = rules().number("noise.shared")
STEPS = ((0, 1), (1, 1), (1, -1), (2, 0))
"""Neighbours (across, along) whose noise is compared."""

Whole = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class SampleNoise:
    """The noise of a chart photo's samples beside their neighbours.

    Attributes:
        step: DN, the greatest common divisor of the samples' distances.
        unlike: correlation of neighbours of different colours, without texture's part; None for too few pairs.
        like: the same of next samples of one colour.
    """

    step: Size
    unlike: Estimate | None
    like: Estimate | None


@dataclass(frozen=True)
class _Pairs:
    """Neighbours in one direction in one patch.

    Attributes:
        like: whether they have the same colour.
        count: of pairs. correlation: of their noise.
        texture: product of their signals over that of their noise's standard deviations.
    """

    like: bool
    count: float
    correlation: float
    texture: float


def noise_of_neighbours(mosaic: Mosaic, pose: Pose) -> SampleNoise:
    """The noise of the measured samples of all patches."""
    cells = cells_of(mosaic.cfa)
    pairs: list[_Pairs] = []
    step = 0
    for number, quad in enumerate(pose.patches, 1):
        window, inside = window_of(mosaic, quad, cells, number)
        pairs += _pairs_of(window, inside, cells, mosaic.black)
        step = int(np.gcd.reduce(window[inside] - window[inside].min(), initial=step))
    unlike, like = ([pair for pair in pairs if pair.like is same] for same in (False, True))
    return SampleNoise(float(max(step, 1)), _common(unlike), _common(like))


def window_of(mosaic: Mosaic, quad: Floats, cells: Sequence[tuple[int, int]], number: int) -> tuple[Whole, Mask]:
    """The samples (h, w) around a patch's measured part, from an even row and column on, and which are kept."""
    positions = [samples_in(quad, cell, mosaic.samples.shape, number) for cell in cells]
    top, left = (min(int(each[axis].min()) for each in positions) // 2 * 2 for axis in (0, 1))
    bottom, right = (max(int(each[axis].max()) for each in positions) + 1 for axis in (0, 1))
    window = mosaic.samples[top:bottom, left:right].astype(np.int64)
    inside = np.zeros(window.shape, dtype=bool)
    for rows, columns in positions:
        samples = mosaic.samples[rows, columns].astype(np.int32)
        inside[rows - top, columns - left] = kept(samples)
    return window, inside


def _pairs_of(window: Whole, inside: Mask, cells: Sequence[tuple[int, int]], black: Floats) -> Iterator[_Pairs]:
    means = []
    for cell in cells:
        own = inside[cell[0] :: 2, cell[1] :: 2]
        values = window[cell[0] :: 2, cell[1] :: 2][own]
        means.append(max(float(values.sum()) / max(values.size, 1) - float(black[cell]), 0.0))
    for horizontal in (True, False):
        noise, usable = _differences(window, inside) if horizontal else _differences(window.T, inside.T)
        if not horizontal:
            noise, usable = noise.T, usable.T
        variances = [_mean_square(noise[c[0] :: 2, c[1] :: 2], usable[c[0] :: 2, c[1] :: 2]) for c in cells]
        for across, along in STEPS:
            dy, dx = (across, along) if horizontal else (along, across)
            yield from _in_direction(noise, usable, (dy, dx), cells, variances, means)


def _differences(window: Whole, inside: Mask) -> tuple[Whole, Mask]:
    """Second difference along a row minus that of the row ACROSS below, and where all six samples are kept."""
    noise, usable = np.zeros_like(window), np.zeros_like(inside)
    h, w = window.shape
    if h <= ACROSS or w <= 2 * ALONG:
        return noise, usable
    second = 2 * window[:, ALONG:-ALONG] - window[:, : -2 * ALONG] - window[:, 2 * ALONG :]
    whole = inside[:, ALONG:-ALONG] & inside[:, : -2 * ALONG] & inside[:, 2 * ALONG :]
    usable[:-ACROSS, ALONG:-ALONG] = whole[:-ACROSS] & whole[ACROSS:]
    noise[:-ACROSS, ALONG:-ALONG] = (second[:-ACROSS] - second[ACROSS:]) * usable[:-ACROSS, ALONG:-ALONG]
    return noise, usable


def _mean_square(noise: Whole, usable: Mask) -> float:
    count = int(usable.sum())
    return float((noise * noise).sum()) / count if count else 0.0


def _in_direction(
    noise: Whole,
    usable: Mask,
    step: tuple[int, int],
    cells: Sequence[tuple[int, int]],
    variances: Sequence[float],
    means: Sequence[float],
) -> Iterator[_Pairs]:
    """The neighbours of each cell's samples at a step (rows, columns), of which columns may be negative."""
    dy, dx = step
    h, w = noise.shape
    if dy < 0:
        dy, dx = -dy, -dx
    first = slice(0, h - dy), slice(max(0, -dx), w - max(0, dx))
    second = slice(dy, h), slice(max(0, dx), w + min(0, dx))
    products, both = noise[first] * noise[second], usable[first] & usable[second]
    for i, cell in enumerate(cells):
        j = cells.index(((cell[0] + dy) % 2, (cell[1] + dx) % 2))
        if {i, j} == {1, 2}:  # two greens have one colour, and are not next to each other
            continue
        place = cell[0] % 2, (cell[1] - max(0, -dx)) % 2
        own, there = products[place[0] :: 2, place[1] :: 2], both[place[0] :: 2, place[1] :: 2]
        count = int(there.sum())
        if count >= FEWEST_PAIRS and variances[i] > 0.0 and variances[j] > 0.0:
            deviation = float(np.sqrt(variances[i] * variances[j]))
            diagonal = dy != 0 and dx != 0
            yield _Pairs(
                i == j,
                count / (2.0 if diagonal else 1.0),
                float(own.sum()) / count / deviation,
                12.0 * means[i] * means[j] / deviation,
            )


def _common(pairs: Sequence[_Pairs]) -> Estimate | None:
    """The pairs' correlation at no texture: a line over `texture` if it rises, weighted by the numbers of pairs."""
    if not pairs:
        return None
    n = np.array([pair.count for pair in pairs]) / SHARED
    r, q = (np.array([getattr(pair, name) for pair in pairs]) for name in ("correlation", "texture"))
    total = float(n.sum())
    value, middle, slope, error = float(n @ r) / total, float(n @ q) / total, 0.0, total**-0.5
    spread, rise = float(n @ (q - middle) ** 2), float(n @ ((q - middle) * r))
    if spread > 0.0 and rise > 0.0:
        slope = rise / spread
        value, error = value - slope * middle, float(np.sqrt(1.0 / total + middle**2 / spread))
    scatter = float(n @ (r - value - slope * q) ** 2) / len(pairs)
    return Estimate(value, error * max(1.0, scatter) ** 0.5)
