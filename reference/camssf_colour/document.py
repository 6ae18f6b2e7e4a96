"""The document of colours measured in a photo, "camssf-colour/1"; that of spectra shares its parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from camssf.documents.excerpt import PASSED, Generator
from camssf.exports.curves import ExportedCurves
from camssf.grid import Floats
from camssf.shapes import Bounds, Number, Rgb, RgbSizes, Sha256, Shape, Share, Size, Text, Words
from camssf.version import __version__
from camssf_colour.reach import REACH
from camssf_colour.regions import MeasuredRegions, PhotoName, Region
from camssf_colour.standard import Colours
from camssf_colour.view import ADAPTED

FORMAT: Literal["camssf-colour/1"] = "camssf-colour/1"
OBSERVERS = {"1931": "CIE 1931 2°", "1964": "CIE 1964 10°"}
Observer = Annotated[str, Words(tuple(OBSERVERS.values()))]
Square = Annotated[Floats, Shape((3, 3))]
Box = tuple[Number, Number, Number, Number]


@dataclass(frozen=True)
class SourceResult:
    """The calibration.

    Attributes:
        camera: make and model.
        sha256: of the result as result.json holds it.
        verdict: a refused result has no curves.
        reasons: codes of a doubtful verdict.
    """

    camera: Text
    sha256: Sha256
    verdict: Annotated[str, Words(PASSED)]
    reasons: tuple[Text, ...]

    @staticmethod
    def of(curves: ExportedCurves) -> SourceResult:
        """The result that these curves are of."""
        return SourceResult(curves.camera, curves.sha256, curves.status, curves.reasons)


@dataclass(frozen=True, eq=False)
class WhitePoint:
    """The white that Lab is relative to.

    Attributes:
        of: the lamp itself, or the illuminant that colours were adapted to by CAT16.
        xyz: its XYZ, Y = 1.
    """

    of: Annotated[str, Words(ADAPTED)]
    xyz: Rgb


@dataclass(frozen=True)
class LampWeight:
    """One of the compared lamps.

    Attributes:
        name: its name.
        weight: all weights add up to 1.
    """

    name: Text
    weight: Share


@dataclass(frozen=True)
class WeighedLamp:
    """The light.

    Attributes:
        asked: as it was given.
        weights: the compared lamps.
        chi_squared: χ² of the reference's two raw ratios under the likeliest lamp; null if they were not used.
    """

    asked: Text
    weights: Annotated[tuple[LampWeight, ...], Bounds(1, 64)]
    chi_squared: Size | None


@dataclass(frozen=True, eq=False)
class ReferenceSurface:
    """The white or grey surface in the same light.

    Attributes:
        reflectance: its reflectance.
        tolerance: relative error of it.
        rectangle: its position: x, y, width, height in pixels of the active area, in the sensor's orientation.
        raw: its raw signals above black, DN.
    """

    reflectance: Size
    tolerance: Share
    rectangle: Box
    raw: Rgb

    @staticmethod
    def of(measured: MeasuredRegions) -> ReferenceSurface:
        """The reference that regions were measured against."""
        white = measured.white
        return ReferenceSurface(measured.reflectance, measured.reference.tolerance, white.rectangle, white.raw)


@dataclass(frozen=True, eq=False)
class LabParts:
    """Standard deviations of L*, a*, b* by source.

    Attributes:
        curves: the camera's curves.
        lamp: the lamp.
        noise: noise of the photo.
        reference: the reference, and light that differs between places.
        metamers: surfaces that look alike to the camera and not to the observer.
    """

    curves: RgbSizes
    lamp: RgbSizes
    noise: RgbSizes
    reference: RgbSizes
    metamers: RgbSizes


@dataclass(frozen=True, eq=False)
class ColourOfRegion:
    """One region; without a colour if no surface has it.

    Attributes:
        rectangle: its position.
        status: ok, or colour_out_of_reach: no surface has this colour under the lamp, and none is stated.
        reach: distance from the nearest signals that a surface could give, in standard deviations; null if it was
            not computed.
        signal: raw signals divided by the reference's, times its reflectance: a perfect white diffuser gives 1.
        standard_error: of the signal.
        xyz: CIE XYZ; Y of a perfect white diffuser is 1.
        xyz_covariance: of XYZ.
        lab: CIE 1976 L*a*b*.
        lab_covariance: of Lab.
        parts: sources of Lab's standard deviation.
    """

    rectangle: Box
    status: Annotated[str, Words(("ok", "colour_out_of_reach"))]
    reach: Size | None
    signal: Rgb
    standard_error: RgbSizes
    xyz: Rgb | None = None
    xyz_covariance: Square | None = None
    lab: Rgb | None = None
    lab_covariance: Square | None = None
    parts: LabParts | None = None


@dataclass(frozen=True, eq=False)
class ColourDocument:
    """Colours of regions of a photo through a camera's recovered curves.

    Attributes:
        format: name and version of this form.
        generator: the program that wrote it.
        result: the calibration.
        photo: the photo.
        observer: the standard observer.
        white: the white that Lab is relative to.
        lamp: the light.
        reference: the white or grey surface.
        regions: the regions.
    """

    format: Literal["camssf-colour/1"]
    generator: Generator
    result: SourceResult
    photo: PhotoName
    observer: Observer
    white: WhitePoint
    lamp: WeighedLamp
    reference: ReferenceSurface
    regions: Annotated[tuple[ColourOfRegion, ...], Bounds(1, 1000)]


def colour_document(colours: Colours, measured: MeasuredRegions, curves: ExportedCurves, lamp: str) -> ColourDocument:
    """The document of colours measured in a photo.

    Args:
        colours: m colours.
        measured: the m regions.
        curves: of the camera.
        lamp: as the user gave it.
    """
    return ColourDocument(
        format=FORMAT,
        generator=Generator("camssf", __version__),
        result=SourceResult.of(curves),
        photo=measured.photo,
        observer=OBSERVERS[colours.view.observer],
        white=WhitePoint(colours.view.white, colours.white),
        lamp=WeighedLamp(lamp, tuple(LampWeight(*pair) for pair in colours.lamps), colours.chi_squared),
        reference=ReferenceSurface.of(measured),
        regions=tuple(_region(colours, measured, region, i) for i, region in enumerate(measured.regions)),
    )


def _region(colours: Colours, measured: MeasuredRegions, region: Region, i: int) -> ColourOfRegion:
    far, reach = bool(colours.reach[i] > REACH), float(colours.reach[i])
    signal, error, known = measured.signals[i], measured.errors[i], None if np.isnan(reach) else reach
    if far:
        return ColourOfRegion(region.rectangle, "colour_out_of_reach", known, signal, error)
    return ColourOfRegion(
        region.rectangle,
        "ok",
        known,
        signal,
        error,
        xyz=colours.xyz[i],
        xyz_covariance=colours.xyz_covariance[i],
        lab=colours.lab[i],
        lab_covariance=colours.lab_covariance[i],
        parts=LabParts(**{name: np.sqrt(np.diagonal(part[1][i])) for name, part in colours.parts.items()}),
    )
