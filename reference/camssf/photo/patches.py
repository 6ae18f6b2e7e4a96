"""Measures patch means: mean, standard error and clipped share for each patch and CFA colour.

docs/patches.md states the algorithm in numbered rules; Kotlin's result is equal bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.messages import fail
from camssf.photo.find.pose import Pose
from camssf.photo.neighbours import SampleNoise, noise_of_neighbours
from camssf.photo.read.dng import Mosaic, shading
from camssf.photo.read.unit import check_unit
from camssf.photo.samples import cells_of, centre_of, kept, samples_in
from camssf.rules import rules
from camssf.shapes import Greens, Rgb, RowCounts, Rows, RowShares, RowSizes, Size

FEWEST = rules().whole("patches.fewest")
"""Smallest number of samples for each position of the CFA cell in every patch."""
LENS_SHADING = ("as-stored", "apply")
"""Treatments of the lens shading that a file describes: none, or rule 6."""
BLACK_ALIKE, LEAST_SIGNAL = rules().number("patches.black_alike"), rules().number("patches.least_signal")
ALIKE = rules().number("patches.alike")
"""Relative difference up to which two exposure times or ISO values count as equal: files round them."""


@dataclass(frozen=True)
class FrameMeans:
    """Statistics of one frame in the central part of every patch. Columns are R, G, B.

    Attributes:
        mean: (n, 3) DN, black level included; green is the mean of its two positions' means.
        standard_error: (n, 3) standard error of the mean, DN, from the scatter of the samples.
        count: (n, 3) number of samples used.
        clipped: (n, 3) share of samples at or above the white level, 0 to 1.
        dead: (n, 3) share of samples rejected as dust or hot pixels, 0 to 1.
        gradient: (n, 3) relative change of the signal from edge to edge of the measured part, 1.
        greens: (n, 2) mean of the green on R's rows and of the green on B's rows, DN.
    """

    mean: Rows
    standard_error: RowSizes
    count: RowCounts
    clipped: RowShares
    dead: RowShares
    gradient: Rows
    greens: Greens


@dataclass(frozen=True)
class PatchMeans:
    """Patch statistics of one shot: the same samples of the chart, white and dark frames.

    Attributes:
        chart: statistics of the chart photo.
        white, dark: statistics of these frames, None for a missing frame.
        black: (3,) the file's black level of R, G, B, DN.
        saturation: the white level, DN.
        evened: whether `chart` is that of even light already, by a white frame (`documents.previous.evened`).
        noise: how the samples of the chart photo differ from their neighbours; None if it was not measured.
    """

    chart: FrameMeans
    white: FrameMeans | None
    dark: FrameMeans | None
    black: Rgb
    saturation: Size
    evened: bool = False
    noise: SampleNoise | None = None


def measure_patches(
    chart: Mosaic,
    pose: Pose,
    *,
    white: Mosaic | None = None,
    dark: Mosaic | None = None,
    lens_shading: str = "as-stored",
) -> PatchMeans:
    """Measure the same samples of every patch in all frames of one shot.

    Args:
        chart: the photo of the chart.
        pose: the chart's position in it.
        white: the white frame, taken with the same settings as the chart photo; None if there is none.
        dark: the dark frame, also with these settings; None if there is none.
        lens_shading: "as-stored" leaves the samples as they are, "apply" multiplies the signal above black by the
            gain maps in the chart photo's file. With a white frame it is unnecessary.

    Raises:
        InvalidArgument: another value of `lens_shading`, or a file without gain maps to apply.
        UnsupportedRaw: the file has gain maps that camssf cannot apply.
        FramesDiffer: size, CFA, camera, levels, exposure or ISO of a frame differ from the chart photo's.
        UnitDiffers: the physical camera or lens of a frame differs.
        ChartNotFound: a patch leaves the photo, or holds fewer than 16 samples of a colour.
    """
    if lens_shading not in LENS_SHADING:
        raise InvalidArgument(f"Lens shading {lens_shading!r} is unknown.", f"Use {' or '.join(LENS_SHADING)}.")
    if lens_shading == "apply" and not chart.gain_maps:
        raise InvalidArgument(
            f"{chart.path} holds no lens-shading map to apply.", "Leave the samples as stored, or take a white frame."
        )
    frames = [chart]
    for word, frame in (("white", white), ("dark", dark)):
        if frame is not None:
            check_alike(chart, frame, word)
            frames.append(frame)
    cells = cells_of(chart.cfa)
    raw = np.array(
        [[_position(frames, quad, cell, patch) for cell in cells] for patch, quad in enumerate(pose.patches, 1)]
    )  # (n, 4 positions: R, green of R's rows, green of B's rows, B; frame; numbers)
    black = np.array([chart.black[cell] for cell in cells])
    scale = chart.white - black
    gains = np.ones((len(pose.patches), 4))
    if lens_shading == "apply":
        for patch, quad in enumerate(pose.patches):
            x, y = centre_of(quad)
            factors = shading(chart, float(x), float(y))
            gains[patch] = [factors[cell] for cell in cells]
    measured = [_join(raw[:, :, f], black, scale, gains) for f in range(len(frames))]
    rest = iter(measured[1:])
    return PatchMeans(
        chart=measured[0],
        white=next(rest) if white is not None else None,
        dark=next(rest) if dark is not None else None,
        black=np.array([black[0], (black[1] + black[2]) / 2, black[3]]),
        saturation=float(chart.white),
        noise=noise_of_neighbours(chart, pose),
    )


def check_alike(chart: Mosaic, frame: Mosaic, word: str) -> None:
    """Check that a frame was taken with the chart photo's camera and settings.

    Args:
        chart: the photo that it belongs to.
        frame: the frame.
        word: what it is called, for messages.

    Raises:
        FramesDiffer: size, CFA, camera, levels, exposure or ISO differ.
        UnitDiffers: the physical camera or lens differs.
    """
    differ = []
    if frame.samples.shape != chart.samples.shape:
        differ.append(f"size {_size(frame)} against {_size(chart)}")
    if frame.cfa != chart.cfa:
        differ.append(f"CFA pattern {frame.cfa} against {chart.cfa}")
    for name in ("make", "model"):
        theirs, ours = getattr(frame, name), getattr(chart, name)
        if theirs and ours and theirs != ours:
            differ.append(f"camera {name} {theirs!r} against {ours!r}")
    if frame.white != chart.white:
        differ.append(f"white level {frame.white:g} against {chart.white:g} DN")
    elif np.any(np.abs(frame.black - chart.black) > BLACK_ALIKE * chart.white):
        differ.append(f"black level {frame.black.mean():g} against {chart.black.mean():g} DN")
    for name, unit in (("exposure", " s"), ("iso", "")):
        theirs, ours = getattr(frame, name), getattr(chart, name)
        if theirs is not None and ours is not None and abs(theirs - ours) > ALIKE * max(theirs, ours):
            differ.append(f"{name} {theirs:g}{unit} against {ours:g}{unit}")
    if differ:
        raise fail(
            "frames_differ.settings", frame=word, file=frame.path, chart=chart.path, differences="; ".join(differ)
        )
    check_unit(
        f"the chart photo {chart.path}", (chart.unit, chart.active_area),
        f"The {word} frame {frame.path}", (frame.unit, frame.active_area),
    )  # fmt: skip


def _size(frame: Mosaic) -> str:
    return f"{frame.samples.shape[1]} × {frame.samples.shape[0]}"


def _position(frames: list[Mosaic], quad: Floats, cell: tuple[int, int], patch: int) -> Floats:
    """Statistics of one position of the CFA cell in one patch.

    Returns:
        (frame, 7): mean, standard error, count kept, edge-to-edge change in DN, counts clipped, rejected, total.
    """
    rows, columns = samples_in(quad, cell, frames[0].samples.shape, patch)
    if rows.size < FEWEST:
        _too_small(frames[0], patch, rows.size)
    samples = [frame.samples[rows, columns].astype(np.int32) for frame in frames]
    good = [kept(v) for v in samples]
    joint = np.logical_and.reduce(good)
    if np.count_nonzero(joint) < FEWEST:
        _too_small(frames[0], patch, int(np.count_nonzero(joint)))
    x, y = columns[joint] // 2, rows[joint] // 2
    return np.array(
        [
            [
                *_mean(v[joint], x - x.min(), y - y.min()),
                np.count_nonzero(v >= frame.white),
                np.count_nonzero(~k),
                v.size,
            ]
            for frame, v, k in zip(frames, samples, good, strict=True)
        ]
    )


def _too_small(frame: Mosaic, patch: int, count: int) -> None:
    raise fail(
        "chart_not_found.few_samples",
        value=float(count),
        threshold=float(FEWEST),
        file=frame.path,
        patch=patch,
        count=count,
        least=FEWEST,
    )


def _mean(v: NDArray[np.int32], x: NDArray[np.int64], y: NDArray[np.int64]) -> list[float]:
    """Mean, standard error about the plane, count, and change from edge to edge: rule 5."""
    n = v.size
    total = int(np.sum(v, dtype=np.int64))
    columns = np.array([np.ones(n), x, y, v - total // n], dtype=np.float64)
    sums = columns @ columns.T  # whole numbers below 2^53: exact in any order
    C = sums - np.outer(sums[0], sums[0]) / n
    xx, xy, yy, xe, ye, ee = C[1, 1], C[1, 2], C[2, 2], C[1, 3], C[2, 3], C[3, 3]
    determinant = xx * yy - xy * xy
    a = b = 0.0
    if determinant > 0:
        a, b = (yy * xe - xy * ye) / determinant, (xx * ye - xy * xe) / determinant
    variance = max(0.0, ee - a * xe - b * ye) / (n - 3) + 1 / 12
    change = abs(a) * float(x.max()) + abs(b) * float(y.max())
    return [total / n, (variance / n) ** 0.5, n, change]


def _join(raw: Floats, black: Floats, scale: Floats, gains: Floats) -> FrameMeans:
    """Statistics of one frame by colour, from `raw` (n, 4 positions, 7 numbers): rules 6 and 7."""
    mean, error, count, change, clipped, rejected, total = np.moveaxis(raw, 2, 0)
    gradient = change / np.maximum(np.abs(mean - black), LEAST_SIGNAL * scale)
    shaded = gains != 1.0
    mean, error = np.where(shaded, black + gains * (mean - black), mean), gains * error

    def colours(v: Floats, green: Floats) -> Floats:
        return np.stack([v[:, 0], green, v[:, 3]], axis=1)

    def average(v: Floats) -> Floats:
        return colours(v, (v[:, 1] + v[:, 2]) / 2)

    def total_of(v: Floats) -> Floats:
        return colours(v, v[:, 1] + v[:, 2])

    return FrameMeans(
        mean=average(mean),
        standard_error=colours(error, np.sqrt(error[:, 1] ** 2 + error[:, 2] ** 2) / 2),
        count=total_of(count).astype(np.int64),
        clipped=total_of(clipped) / total_of(total),
        dead=total_of(rejected) / total_of(total),
        gradient=average(gradient),
        greens=mean[:, 1:3].copy(),
    )
