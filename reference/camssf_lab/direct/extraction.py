"""Extracts the spectrum along the rows of a frame, channel by channel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.messages import fail
from camssf_lab.direct.dispersion import fine_structure

_LEAST_CONTRAST = 20.0

_LEAN = 0.15


@dataclass(frozen=True)
class FrameSpectrum:
    """The spectrum recorded by one camera, channel by channel.

    Attributes:
        name: name of the file.
        pixel: (c) positions along the spectrum, (w,) each, px.
        signal: (c) mean signals there, (w,) each, DN.
        error: (c) their standard errors, (w,) each, DN; None for a table.
        tilt: angle between the spectral lines and the columns, degrees.
        black: source of the black level, in words.
    """

    name: str
    pixel: tuple[Floats, ...]
    signal: tuple[Floats, ...]
    error: tuple[Floats, ...] | None
    tilt: float
    black: str


def extract(light: Floats, cell: NDArray[np.int64], name: str, black: str) -> FrameSpectrum:
    """The spectrum along the rows of a frame.

    First the rows lit by the slit are found, then the tilt of the spectral lines, from the shift of the fine
    structure between strips of rows. Samples of a channel are averaged along the tilted lines in bins of two columns
    (one column for a single channel), each row weighted by its mean brightness.

    Args:
        light: (h, w) frame with black subtracted.
        cell: (2, 2) channel of each sample of the repeating cell.
        name: of the file, for messages.
        black: source of the black level, in words.

    Raises:
        Underexposed: the frame is too small, or no row stands out of the noise.
    """
    height, width = (side // 2 * 2 for side in light.shape)
    if height < 8 or width < 200:
        raise fail("underexposed.small_spectrum", file=name, width=width, height=height)
    light = light[:height, :width]
    grey = light.reshape(height // 2, 2, width // 2, 2).sum(axis=(1, 3))
    profile = grey.mean(axis=1)
    noise = float(np.median(np.abs(np.diff(grey, axis=1)))) / np.sqrt(width / 2)
    lit = np.flatnonzero(profile > 0.5 * np.quantile(profile, 0.98))
    if not profile.max() > _LEAST_CONTRAST * max(noise, 1e-9) or len(lit) < 4:
        raise fail(
            "underexposed.no_spectrum", value=float(profile.max()), threshold=_LEAST_CONTRAST * noise, file=name
        )
    top, bottom = int(lit[0]), int(lit[-1]) + 1
    middle = float(top + bottom - 1) / 2
    lean = _lean(grey[top:bottom], middle - top)
    rows = np.arange(2 * top, 2 * bottom)
    weight = np.repeat(profile[top:bottom], 2) / profile[top:bottom].mean()
    along = np.arange(width)[None, :] - lean * (rows - (2 * middle + 0.5))[:, None]
    which = np.tile(cell, (bottom - top, width // 2))
    block = light[2 * top : 2 * bottom]
    share = np.broadcast_to(weight[:, None], block.shape)
    bin_width = 2.0 if cell.any() else 1.0
    pixels, signals, errors = [], [], []
    for channel in range(int(cell.max()) + 1):
        mine = which == channel
        x, y, p = along[mine], block[mine], share[mine]
        # A sample covers half a column to either side. Bins begin at this edge, not at a sample's centre, where
        # rounding of the lean would decide the bin.
        index = np.floor((x + 0.5) / bin_width).astype(np.int64)
        index -= index.min()
        total = np.bincount(index, p)
        full = total > 0.5 * np.median(total)
        at = np.bincount(index, p * x) / np.maximum(total, 1e-12)
        mean = np.bincount(index, y) / np.maximum(total, 1e-12)
        scatter = np.bincount(index, (y - p * mean[index]) ** 2)
        pixels.append(at[full])
        signals.append(mean[full])
        errors.append((np.sqrt(scatter) / np.maximum(total, 1e-12))[full])
    tilt = float(np.rad2deg(np.arctan(lean)))
    return FrameSpectrum(name, tuple(pixels), tuple(signals), tuple(errors), tilt, black)


def _lean(grey: Floats, middle: float) -> float:
    """Shift of the lines in columns a row, from strips of a grey spectrum (h, w)."""
    from scipy.ndimage import gaussian_filter1d

    count = int(np.clip(len(grey) // 6, 2, 12))
    strips = np.array_split(np.arange(len(grey)), count)
    at = np.array([strip.mean() for strip in strips]) - middle
    shown = [gaussian_filter1d(fine_structure(grey[strip].mean(axis=0)[:, None]), 1.5) for strip in strips]
    columns = np.arange(grey.shape[1], dtype=float)

    def upright(lean: float) -> Floats:
        return np.stack([np.interp(columns + lean * y, columns, row) for y, row in zip(at, shown, strict=True)])

    # Coarse: the lean that makes the strips' mean sharpest. Fine: Gauss-Newton steps, because sharpness alone is
    # biased towards zero lean, where interpolation does not smooth the noise.
    trial = np.linspace(-_LEAN, _LEAN, 61)
    lean = float(trial[np.argmax([np.sum(upright(slope).mean(axis=0) ** 2) for slope in trial])])
    for _ in range(20):
        strips_now = upright(lean)
        slope = np.gradient(strips_now.mean(axis=0))
        step = -float(slope @ (at @ strips_now)) / float(np.sum(at**2) * (slope @ slope))
        lean += step
        if abs(step) < 1e-6:
            break
    return lean
