"""Measures regions of a photo against a white one, for the commands that compute colours and spectra."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camssf.cli.reading import name_of, parse_rectangle, parse_share, read_result
from camssf.cli.terminal import say
from camssf.errors import InvalidArgument

if TYPE_CHECKING:
    from camssf.colour.regions import Region
    from camssf.colour.spread import Reference
    from camssf.grid import Floats


@dataclass(frozen=True)
class RegionRequest:
    """The regions of a photo to measure, and how; texts as on the command line."""

    photo: str
    regions: Sequence[str]
    white_region: str | None
    white_reflectance: str | None
    dark: str | None
    lens_shading: str


@dataclass(frozen=True)
class MeasuredRegions:
    """Measured regions of a photo: their signals and standard errors, and the white reference."""

    signals: Floats
    errors: Floats
    regions: list[Region]
    white: Region
    reference: Reference
    reflectance: float
    photo: dict[str, str]


def read_curves_of(source: str) -> dict[str, Any]:
    """A result, or the excerpt in a passport, which has no covariance; prints a warning for the latter."""
    result = read_result(source, excerpt=True)
    if "excerpt" in result:
        say(
            "[yellow]without its covariance[/]",
            f": {name_of(source)} is the excerpt that a passport holds; colours look about twice as uncertain "
            "as with the whole result.json",
        )
    return result


def no_region() -> InvalidArgument:
    """The error for a photo without regions."""
    return InvalidArgument(
        "A colour needs a region, and a white or grey surface in the same light.",
        "Add --region x,y,w,h and --white-region x,y,w,h; without a reference the amount of light on "
        "the surface is unknown.",
    )


def measure(request: RegionRequest, camera: dict[str, str], name: str) -> MeasuredRegions:
    """Signals of the photo's regions, relative to a perfect diffuser.

    Args:
        request: the regions and how to measure them.
        camera: make and model in the result.
        name: the camera's name for messages.
    """
    from camssf.colour.regions import against, measure_regions
    from camssf.colour.spread import REFERENCE_TOLERANCE, Reference
    from camssf.errors import FramesDiffer
    from camssf.photo.read.raw import read_raw

    if request.white_region is None:
        raise no_region()
    rectangles = [
        parse_rectangle("--white-region", request.white_region),
        *(parse_rectangle("--region", each) for each in request.regions),
    ]
    mosaic = read_raw(request.photo)
    if any(
        ours and theirs and ours != theirs
        for ours, theirs in ((camera["make"], mosaic.make), (camera["model"], mosaic.model))
    ):
        raise FramesDiffer(
            f"{request.photo} was taken by {mosaic.make} {mosaic.model}, the result is of {name}.",
            "Calibrate that camera; each has its own curves.",
        )
    dark = None if request.dark is None else read_raw(request.dark)
    white, *found = measure_regions(mosaic, rectangles, dark=dark, lens_shading=request.lens_shading)
    share = parse_share(request.white_reflectance)
    reflectance = 1.0 if share is None else share
    y, error = against(found, white, reflectance)
    reference = Reference(REFERENCE_TOLERANCE, white.raw, float((white.error / white.raw).max()))
    about = {"name": Path(request.photo).name, "sha256": mosaic.sha256}
    return MeasuredRegions(y, error, found, white, reference, reflectance, about)
