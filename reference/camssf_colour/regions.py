"""Measures raw signals of rectangles in a photo, as chart patches (docs/patches.md), minus black or dark frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camssf.errors import ChartNotFound, InvalidArgument
from camssf.grid import Floats
from camssf.messages import fail
from camssf.photo.find.pose import Pose
from camssf.photo.patches import FEWEST, measure_patches
from camssf.photo.read.dng import Mosaic
from camssf.photo.read.raw import read_raw
from camssf.photo.read.unit import Unit
from camssf.photo.samples import SHRINK
from camssf.photo.signals import CLIPPED
from camssf.rules import rules
from camssf.shapes import Sha256, Text
from camssf.spectra.limits import REFERENCE
from camssf_colour.spread import REFERENCE_TOLERANCE, Reference

SIGNAL_TO_NOISE = rules().number("colour.signal_to_noise")
Rectangle = tuple[float, float, float, float]
"""x, y of the top left corner, width, height: pixels of the active area, in the sensor's orientation."""


@dataclass(frozen=True)
class Region:
    """A rectangle's raw signals.

    Attributes:
        rectangle: its position.
        raw: (3,) DN above black.
        error: (3,) standard error of `raw`, DN.
        deviation: (3,) standard deviation of the photo's samples, DN.
        dark: (3,) what was subtracted besides black, DN: the light of a dark photo; zeros without one.
    """

    rectangle: Rectangle
    raw: Floats
    error: Floats
    deviation: Floats
    dark: Floats


@dataclass(frozen=True)
class PhotoName:
    """The photo.

    Attributes:
        name: of its file.
        sha256: of the file.
    """

    name: Text
    sha256: Sha256


@dataclass(frozen=True)
class MeasuredRegions:
    """Measured regions of a photo: their signals and standard errors, and the white reference."""

    signals: Floats
    errors: Floats
    regions: list[Region]
    white: Region
    reference: Reference
    reflectance: float
    photo: PhotoName
    unit: Unit


def measure_regions(
    photo: Mosaic, rectangles: Sequence[Rectangle], *, dark: Mosaic | None = None, lens_shading: str = "as-stored"
) -> list[Region]:
    """Measure rectangles of one photo. Dust and hot pixels are left out, as in patches.

    Args:
        photo: the photo.
        rectangles: in it.
        dark: the same view with the lens cap on or the torch off, which is subtracted instead of the black level.
        lens_shading: as for `measure_patches`.

    Raises:
        InvalidArgument: a rectangle that extends beyond the photo or holds too few samples.
        Overexposed: clipped samples.
        FramesDiffer: a dark frame with other settings.
    """
    height, width = photo.samples.shape
    quads = []
    for number, (x, y, w, h) in enumerate(rectangles, 1):
        if not (np.isfinite([x, y, w, h]).all() and w > 0 and h > 0):
            raise InvalidArgument(
                f"Region {number} ({x:g},{y:g},{w:g},{h:g}) is empty.", "Write x,y,width,height in pixels."
            )
        if x < 0 or y < 0 or x + w > width or y + h > height:
            raise InvalidArgument(
                f"Region {number} ({x:g},{y:g},{w:g},{h:g}) leaves the photo, which is {width} × {height}.",
                "Pixels are counted in the sensor's own orientation, from its top left.",
            )
        # pixel borders lie half a pixel outside the centres; `measure_patches` uses only the inner part of a quad
        left, right, top, bottom = x, x + w - 1, y, y + h - 1
        quad = np.array([[left, top], [right, top], [right, bottom], [left, bottom]], dtype=np.float64)
        centre = quad.mean(axis=0)
        quads.append(centre + (quad - centre) / SHRINK)
    pose = Pose("regions", quads[0], np.stack(quads), 0, "by hand", 1.0, ())
    try:
        means = measure_patches(photo, pose, dark=dark, lens_shading=lens_shading)
    except ChartNotFound as error:
        raise InvalidArgument(
            f"A region holds fewer than {FEWEST} good samples of a colour.",
            "Give 12 × 12 pixels or more.",
        ) from error
    for number, clipped in enumerate(means.chart.clipped.max(axis=1), 1):
        if clipped > CLIPPED:
            raise fail("overexposed.region", value=float(clipped), threshold=CLIPPED, region=number, share=clipped)
    light = means.chart.mean - means.black
    dark_light = np.zeros_like(light) if means.dark is None else means.dark.mean - means.black
    of_dark = 0.0 if means.dark is None else means.dark.standard_error
    spread = np.hypot(means.chart.standard_error, of_dark)
    deviation = means.chart.standard_error * np.sqrt(means.chart.count)
    columns = zip(rectangles, light - dark_light, spread, deviation, dark_light, strict=True)
    return [Region(*fields) for fields in columns]


def check_reference(white: Region, reflectance: float) -> None:
    """Check a reference and its reflectance.

    Raises:
        InvalidArgument: it is too dark, or its reflectance is outside 0.02 to 1.2.
    """
    if not REFERENCE[0] <= reflectance <= REFERENCE[1]:
        raise InvalidArgument(
            "The reference's reflectance must lie between {:g} and {:g}; got {:g}.".format(*REFERENCE, reflectance),
            "Write 18 % as 0.18.",
        )
    if not (white.raw > SIGNAL_TO_NOISE * white.error).all():
        raise InvalidArgument("The reference is too dark.", "Choose a lit white or grey surface.")


def reference_of(white: Region) -> Reference:
    """The reference that a measured white or grey surface is."""
    return Reference(REFERENCE_TOLERANCE, white.raw, float((white.error / white.raw).max()))


def against(regions: Sequence[Region], white: Region, reflectance: float) -> tuple[Floats, Floats]:
    """Signals and their standard errors (m, 3) in units of a perfect diffuser: regions divided by a reference.

    Raises:
        InvalidArgument: as `check_reference`.
    """
    check_reference(white, reflectance)
    raw, error = (np.stack([getattr(region, name) for region in regions]) for name in ("raw", "error"))
    y = raw / white.raw
    spread = np.hypot(error / white.raw, y * white.error / white.raw)
    return reflectance * y, reflectance * spread


def read_photo_by(photo: str | Path, camera: tuple[str, str]) -> Mosaic:
    """Read a RAW photo and check make and model of its camera; "" for any.

    Raises:
        FramesDiffer: a photo by another camera.
    """
    mosaic = read_raw(photo)
    if Unit(mosaic.make, mosaic.model).differs(Unit(*camera)):
        make, model = camera
        name = model if model.casefold().startswith(make.casefold()) else f"{make} {model}"
        raise fail("frames_differ.result_camera", file=photo, camera=f"{mosaic.make} {mosaic.model}", other=name)
    return mosaic


def measure_photo(
    photo: str | Path,
    camera: tuple[str, str],
    rectangles: Sequence[Rectangle],
    white: Rectangle,
    *,
    reflectance: float = 1.0,
    dark: str | Path | None = None,
    lens_shading: str = "as-stored",
) -> MeasuredRegions:
    """Measure rectangles of a photo's file relative to a white or grey one.

    Args:
        photo, dark: RAW files.
        camera: make and model in the result; "" for any.
        rectangles, white: the surfaces, and the reference.
        reflectance: of the reference, 0 to 1.
        lens_shading: as for `measure_patches`; a photo without gain maps is measured as stored.

    Raises:
        FramesDiffer: a photo by another camera, or a dark frame with other settings.
        InvalidArgument, Overexposed: as `measure_regions` and `against`.
    """
    mosaic = read_photo_by(photo, camera)
    frame = None if dark is None else read_raw(dark)
    shading = lens_shading if mosaic.gain_maps else "as-stored"
    *regions, first = measure_regions(mosaic, [*rectangles, white], dark=frame, lens_shading=shading)
    y, error = against(regions, first, reflectance)
    about = PhotoName(Path(photo).name, mosaic.sha256)
    return MeasuredRegions(y, error, regions, first, reference_of(first), reflectance, about, mosaic.unit)
