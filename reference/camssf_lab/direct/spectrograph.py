"""Computes curves from frames of one spectrum by two cameras, of which one is known (the paper's Sec. 4).

The colour camera and a mono camera of known response photograph the same spectrum of sunlight in turn. Each frame's
wavelengths are calibrated by its Fraunhofer lines (`camssf_lab.direct.dispersion`). Then light, grating and lens
cancel, Eq. (12):

    S(λ) = S_mono(λ) · [I(λ) / |dλ/dx|] / [I_mono(λ) / |dλ/dx|_mono]

The brackets convert signal a pixel to signal a nanometre, so the two cameras may have different pixels.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.messages import fail
from camssf.progress import Progress, part_of
from camssf_lab.direct.columns import PathLike, read_columns
from camssf_lab.direct.dispersion import Dispersion, disperse
from camssf_lab.direct.extraction import FrameSpectrum
from camssf_lab.direct.reading import read_spectrum
from camssf_lab.direct.result import FIRST, LAST, Direct, checked, identified

FAINTEST = 0.004
"""Wavelengths where the mono camera's signal a nm is below this fraction of its maximum are not used."""


def divide(
    rgb: PathLike,
    mono: PathLike,
    *,
    dark: PathLike | None = None,
    mono_dark: PathLike | None = None,
    response: PathLike | None = None,
    progress: Progress | None = None,
) -> Direct:
    """Divide the colour camera's spectrum by the mono camera's, Eq. (12).

    The spectrum runs along the rows, in either direction; the slit's image may be tilted by a few degrees.

    Args:
        rgb: DNG of the colour camera, or a CSV pixel,red,green,blue of an extracted spectrum.
        mono: frame of the mono camera: a grey TIFF (8 or 16 bits), a DNG of a single channel, or a CSV pixel,signal.
        dark, mono_dark: frames without light, same exposure; if None, the file's black level or the darkest rows are
            used.
        response: CSV wavelength_nm,response of the mono camera (with its lens and grating, if those differ between
            the cameras), any scale; None for a flat response.
        progress: called with (stage, fraction).

    Raises:
        LampUnfit: a frame has too few Fraunhofer lines.
        Overexposed, Underexposed: a frame is.
        FramesDiffer: a dark frame does not fit its frame, or the frames share too few wavelengths.
        UnreadableRaw, UnsupportedRaw, NotSensorRaw, InvalidArgument: a file cannot be used.
    """
    tell = part_of(progress, 0.0, 1.0)
    tell("reading the frames", 0.0)
    colour, camera = read_spectrum(rgb, dark, 3)
    grey, _ = read_spectrum(mono, mono_dark, 1)
    known: tuple[Floats, Floats] | None = None
    if response is not None:
        table, level = read_columns(response, ("wavelength_nm", "response"))
        if level.min() <= 0:
            raise InvalidArgument(
                f"{response} has a response of 0 or less, at {table[np.argmin(level)]:g} nm.",
                "Leave out the wavelengths that the mono camera does not see.",
            )
        known = (table, level)
    curves = {}
    for part, (role, spectrum) in zip((0.3, 0.6), (("rgb", colour), ("mono", grey)), strict=True):
        tell(f"looking for lines in {spectrum.name}", part)
        curves[role] = disperse(*_together(spectrum), name=spectrum.name)
    tell("dividing", 0.9)
    signals, errors, ends = [], [], []
    for spectrum, dispersion in ((colour, curves["rgb"]), (grey, curves["mono"])):
        density = [_per_nanometre(spectrum, c, dispersion) for c in range(len(spectrum.pixel))]
        signals.append(np.stack([value for value, _, _ in density], axis=1))
        errors.append(np.stack([error for _, error, _ in density], axis=1))
        ends.append((max(e[0] for _, _, e in density), min(e[1] for _, _, e in density)))
    light, light_error = signals[1][:, :1], errors[1][:, :1]
    top = int(np.argmax(light))
    faint = np.flatnonzero(light[:, 0] <= FAINTEST * light[top])
    below, above = faint[faint < top], faint[faint > top]
    first = max(ends[0][0], ends[1][0], float(WAVELENGTHS[below[-1] + 1]) if below.size else 0.0)
    last = min(ends[0][1], ends[1][1], float(WAVELENGTHS[above[0] - 1]) if above.size else np.inf)
    if known is not None:
        first, last = max(first, known[0][0]), min(last, known[0][-1])
    if first > FIRST or last < LAST:
        words: dict[str, Any] = {"file": colour.name, "other": grey.name, "first": FIRST, "last": LAST}
        shared = {"value": max(0.0, last - first), "threshold": LAST - FIRST}
        if first >= last:
            raise fail("frames_differ.spectra_apart", **shared, **words)
        raise fail("frames_differ.spectra_narrow", **shared, **words, start=first, end=last)
    inside = ((first <= WAVELENGTHS) & (last >= WAVELENGTHS))[:, None]
    light = np.where(inside, light, 1.0)
    weight = 1.0 if known is None else np.interp(WAVELENGTHS, *known)[:, None]
    ratio = np.where(inside, signals[0], 0.0) / light * weight
    std: Floats | None = None
    if colour.error is not None and grey.error is not None:
        relative = np.hypot(errors[0], ratio / weight * light_error) / light
        std = np.where(inside, relative * weight, 0.0)
    assumptions = (
        ("mono_response", "the mono camera's response is taken for flat." if known is None else f"the mono camera's "
         f"response is {Path(str(response)).name}."),
        ("same_light", "both cameras saw the same light through the same slit, grating and order; scattered light "
         "and second order are not removed."),
        ("black", f"{colour.name}: {colour.black}; {grey.name}: {grey.black}."),
    )  # fmt: skip
    tilts = {"rgb": colour.tilt, "mono": grey.tilt}
    files = identified({"rgb": rgb, "mono": mono, "dark": dark, "mono_dark": mono_dark, "response": response})
    tell("divided", 1.0)
    return checked(Direct(ratio, std, (first, last), camera, curves, tilts, assumptions, files))


def _together(spectrum: FrameSpectrum) -> tuple[Floats, Floats]:
    """Positions (w,) of the channel with most samples, and all channels interpolated there (w, c)."""
    pixel = max(spectrum.pixel, key=len)
    columns = [np.interp(pixel, x, y) for x, y in zip(spectrum.pixel, spectrum.signal, strict=True)]
    return pixel, np.stack(columns, axis=1)


def _per_nanometre(
    spectrum: FrameSpectrum, channel: int, dispersion: Dispersion
) -> tuple[Floats, Floats, tuple[float, float]]:
    """Signal a nm on the grid and its standard error, (681,) each, and the frame's first and last wavelength."""
    from scipy.interpolate import CubicSpline

    x = spectrum.pixel[channel]
    nm, spread = dispersion.wavelength(x), np.abs(dispersion.slope(x))
    order = np.argsort(nm)
    nm, density = nm[order], (spectrum.signal[channel] / spread)[order]
    error = np.zeros_like(nm) if spectrum.error is None else (spectrum.error[channel] / spread)[order]
    value = CubicSpline(nm, density)(np.clip(WAVELENGTHS, nm[0], nm[-1]))
    return value, np.interp(WAVELENGTHS, nm, error), (float(nm[0]), float(nm[-1]))
