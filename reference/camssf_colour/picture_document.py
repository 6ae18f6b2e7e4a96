"""The document of a picture in standard colour, "camssf-picture/1", which the picture's file holds, too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from camssf.documents.excerpt import Generator
from camssf.exports.curves import ExportedCurves
from camssf.shapes import Rgb, Size, Text, Words
from camssf.version import __version__
from camssf_colour.document import LampWeight, SourceResult, WeighedLamp
from camssf_colour.picture import SPACES, StandardPicture
from camssf_colour.regions import PhotoName

FORMAT: Literal["camssf-picture/1"] = "camssf-picture/1"
NO_DIAGNOSIS = "Colour for the record; no diagnosis."


@dataclass(frozen=True, eq=False)
class WhiteOfPicture:
    """What the photo's signals were divided by.

    Attributes:
        source: reference, a white or grey surface in the photo; or calibration, the white balance that the result
            gives for the lamp, and the level at which the photo saturates, to which lightness is then relative.
        raw: raw signal of a perfect white diffuser, DN above black.
        signal_to_noise: of a pixel of the white surface; null without one.
        dark_share: part of the light on the white surface that was subtracted; null without a dark photo.
    """

    source: Annotated[str, Words(("reference", "calibration"))]
    raw: Rgb
    signal_to_noise: Rgb | None
    dark_share: Rgb | None


@dataclass(frozen=True, eq=False)
class PictureDocument:
    """A picture in standard colour, and where it comes from.

    Attributes:
        format: name and version of this form.
        generator: the program that wrote it.
        result: the calibration.
        photo: the photo.
        dark: the photo that was subtracted; null for none.
        unit: serial number of the camera; "" if the photo does not state it.
        exposure: time, s; null if the photo does not state it.
        iso: sensitivity; null if the photo does not state it.
        space: of the picture's numbers.
        lamp: the light.
        white: what is white.
        note: what the picture is not.
    """

    format: Literal["camssf-picture/1"]
    generator: Generator
    result: SourceResult
    photo: PhotoName
    dark: PhotoName | None
    unit: Text
    exposure: Size | None
    iso: Size | None
    space: Annotated[str, Words(tuple(SPACES))]
    lamp: WeighedLamp
    white: WhiteOfPicture
    note: Text


def picture_document(
    picture: StandardPicture, name: str, curves: ExportedCurves, lamp: str, dark: str = ""
) -> PictureDocument:
    """The document of a picture.

    Args:
        picture: the picture.
        name, dark: of the photo's file and the dark photo's; "" for none.
        curves: of the camera.
        lamp: as the user gave it.
    """
    white = picture.white
    return PictureDocument(
        format=FORMAT,
        generator=Generator("camssf", __version__),
        result=SourceResult.of(curves),
        photo=PhotoName(name, picture.photo.sha256),
        dark=None if picture.dark is None else PhotoName(dark, picture.dark.sha256),
        unit=picture.photo.unit.serial,
        exposure=picture.photo.exposure,
        iso=picture.photo.iso,
        space=picture.space.name,
        lamp=WeighedLamp(lamp, tuple(LampWeight(*pair) for pair in picture.lamps), picture.chi_squared),
        white=WhiteOfPicture(
            "reference" if white.from_reference else "calibration", white.raw, white.signal_to_noise, white.dark_share
        ),
        note=NO_DIAGNOSIS,
    )
