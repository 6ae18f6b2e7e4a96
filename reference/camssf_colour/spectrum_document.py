"""The document of spectra measured in photos, "camssf-spectrum/1", and the spectra as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from camssf.documents.excerpt import Generator
from camssf.exports.curves import ExportedCurves
from camssf.grid import Floats
from camssf.shapes import Bounds, Number, Rgb, Rows, RowSizes, Shape, Share, Size, Text, Words
from camssf.spectra.bundled import SURFACE_NODES
from camssf.version import __version__
from camssf_colour.absorbance import indices
from camssf_colour.document import (
    OBSERVERS,
    Box,
    Observer,
    ReferenceSurface,
    SourceResult,
    Square,
    WhitePoint,
)
from camssf_colour.reflectance import FAR, SurfaceSpectra
from camssf_colour.regions import MeasuredRegions, PhotoName

FORMAT: Literal["camssf-spectrum/1"] = "camssf-spectrum/1"
_NODES = SURFACE_NODES.size
Reflectance = Annotated[Floats, Shape((_NODES,))]
ReflectanceSizes = Annotated[Floats, Shape((_NODES,), least=0.0)]
Covariance = Annotated[Floats, Shape((_NODES, _NODES))]


@dataclass(frozen=True)
class Prior:
    """The surfaces that the answer is made of.

    Attributes:
        name: general, skin, or a file's name.
        limit: distance above which a region is outside_prior.
    """

    name: Text
    limit: Size


@dataclass(frozen=True, eq=False)
class LitPhoto:
    """A photo and its light.

    Attributes:
        photo: the photo.
        lamp: its light as it was given.
        reference: the white or grey surface in it.
    """

    photo: PhotoName
    lamp: Text
    reference: ReferenceSurface


@dataclass(frozen=True)
class LampsWeight:
    """One of the compared combinations of lamps.

    Attributes:
        names: a lamp for each photo.
        weight: all weights add up to 1.
    """

    names: Annotated[tuple[Text, ...], Bounds(1, 2)]
    weight: Share


@dataclass(frozen=True, eq=False)
class ReflectanceParts:
    """Standard deviations of the reflectance by source.

    Attributes:
        curves: the camera's curves.
        lamp: the lamp.
        noise: noise of the photo.
        reference: the reference, and light that differs between places.
        metamers: surfaces of the prior that give equal signals.
    """

    curves: ReflectanceSizes
    lamp: ReflectanceSizes
    noise: ReflectanceSizes
    reference: ReflectanceSizes
    metamers: ReflectanceSizes


@dataclass(frozen=True)
class Index:
    """An index of absorbance.

    Attributes:
        value: its value.
        standard_deviation: of the value.
    """

    value: Number
    standard_deviation: Size


@dataclass(frozen=True, eq=False)
class SpectrumOfRegion:
    """One region.

    Attributes:
        rectangle: its position.
        status: ok, or outside_prior: spectrum and band do not hold.
        signal: for each photo, raw signals divided by the reference's, times its reflectance.
        standard_error: of the signals.
        distance: of the signals from the prior's surfaces, in standard deviations.
        from_photo: part of the prior's variance that the signals removed.
        reflectance: posterior mean.
        standard_deviation: of the reflectance.
        covariance: of the reflectance.
        parts: sources of the standard deviation.
        xyz: CIE XYZ; Y of a perfect white diffuser is 1.
        xyz_covariance: of XYZ.
        lab: CIE 1976 L*a*b*.
        lab_covariance: of Lab.
        indices: indices of absorbance by name.
    """

    rectangle: Box
    status: Annotated[str, Words(("ok", "outside_prior"))]
    signal: Rows
    standard_error: RowSizes
    distance: Size
    from_photo: Annotated[float, Bounds(most=1.0)]
    reflectance: Reflectance
    standard_deviation: ReflectanceSizes
    covariance: Covariance
    parts: ReflectanceParts
    xyz: Rgb
    xyz_covariance: Square
    lab: Rgb
    lab_covariance: Square
    indices: dict[Text, Index]


@dataclass(frozen=True, eq=False)
class SpectrumDocument:
    """Reflectance of regions of one or two photos through a camera's recovered curves.

    Attributes:
        format: name and version of this form.
        generator: the program that wrote it.
        result: the calibration.
        prior: the surfaces that the answer is made of.
        photos: one photo, or two of the same regions.
        lamps: the compared combinations of lamps.
        chi_squared: χ² of the references' raw ratios under the likeliest lamps; null if they were not used.
        observer: the standard observer.
        white: the white that Lab is relative to.
        wavelength_nm: of the reflectances.
        regions: the regions.
    """

    format: Literal["camssf-spectrum/1"]
    generator: Generator
    result: SourceResult
    prior: Prior
    photos: Annotated[tuple[LitPhoto, ...], Bounds(1, 2)]
    lamps: Annotated[tuple[LampsWeight, ...], Bounds(1, 64)]
    chi_squared: Size | None
    observer: Observer
    white: WhitePoint
    wavelength_nm: Reflectance
    regions: Annotated[tuple[SpectrumOfRegion, ...], Bounds(1, 1000)]


def spectrum_document(
    spectra: SurfaceSpectra,
    photos: Sequence[tuple[str, MeasuredRegions]],
    weights: Mapping[str, Floats],
    curves: ExportedCurves,
) -> SpectrumDocument:
    """The document of spectra measured in one or two photos.

    Args:
        spectra: of m regions.
        photos: for each photo its lamp, as the user gave it, and the m regions.
        weights: of the indices to state, by name.
        curves: of the camera.
    """
    values = {name: indices(spectra, weight) for name, weight in weights.items()}
    measured = [regions for _, regions in photos]

    def region(i: int) -> SpectrumOfRegion:
        variances = {name: np.maximum(np.diagonal(part[i]), 0.0) for name, part in spectra.parts.items()}
        return SpectrumOfRegion(
            rectangle=measured[-1].regions[i].rectangle,
            status="outside_prior" if spectra.distance[i] > FAR else "ok",
            signal=np.stack([regions.signals[i] for regions in measured]),
            standard_error=np.stack([regions.errors[i] for regions in measured]),
            distance=float(spectra.distance[i]),
            from_photo=float(spectra.from_photo[i]),
            reflectance=spectra.reflectance[i],
            standard_deviation=spectra.standard_deviation[i],
            covariance=spectra.covariance[i],
            parts=ReflectanceParts(**{name: np.sqrt(variance) for name, variance in variances.items()}),
            xyz=spectra.xyz[i],
            xyz_covariance=spectra.xyz_covariance[i],
            lab=spectra.lab[i],
            lab_covariance=spectra.lab_covariance[i],
            indices={name: Index(float(value[i]), float(std[i])) for name, (value, std) in values.items()},
        )

    return SpectrumDocument(
        format=FORMAT,
        generator=Generator("camssf", __version__),
        result=SourceResult.of(curves),
        prior=Prior(spectra.prior, FAR),
        photos=tuple(LitPhoto(regions.photo, lamp, ReferenceSurface.of(regions)) for lamp, regions in photos),
        lamps=tuple(LampsWeight(tuple(names), weight) for names, weight in spectra.lamps),
        chi_squared=spectra.chi_squared,
        observer=OBSERVERS[spectra.view.observer],
        white=WhitePoint(spectra.view.white, spectra.white),
        wavelength_nm=SURFACE_NODES,
        regions=tuple(map(region, range(len(spectra.reflectance)))),
    )


def spectrum_csv(spectra: SurfaceSpectra) -> str:
    """A line for each wavelength: the reflectance of each region, then its standard deviation."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    numbers = range(1, len(spectra.reflectance) + 1)
    writer.writerow(["wavelength_nm", *(f"region_{i}" for i in numbers), *(f"region_{i}_std" for i in numbers)])
    table = np.concatenate([spectra.reflectance, spectra.standard_deviation]).T
    for nm, row in zip(SURFACE_NODES, table, strict=True):
        writer.writerow([f"{nm:g}", *(f"{value:.6f}" for value in row)])
    return text.getvalue()
