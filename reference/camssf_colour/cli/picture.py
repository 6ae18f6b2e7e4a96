"""The command that writes a photo as a picture in standard colour."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camssf.cli.reading import parse_rectangle
from camssf.cli.terminal import emit, say
from camssf.errors import InvalidArgument
from camssf_colour.cli.regions import (
    DarkPhoto,
    Regions,
    WhiteRegion,
    check_unit,
    lens_shading_of,
    parse_white_region,
    read_curves_of,
)

if TYPE_CHECKING:
    from camssf.documents.excerpt import Excerpt
    from camssf.photo.read.dng import Mosaic
    from camssf.result import Result


def picture(
    document: Annotated[str, typer.Argument(metavar="JSON", help="The result: a file, or - for stdin.")],
    photo: Annotated[str, typer.Argument(metavar="PHOTO", help="RAW photo (DNG) by the same camera.")],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="FILE", help="The picture, .tif or .png; with --compare a page, .html."),
    ],
    white_region: WhiteRegion = None,
    lamp: Annotated[
        str | None,
        typer.Option(
            metavar="SPEC",
            show_default=False,
            help="The light (see `camssf lamps`), or auto: estimated from the white region. With a white region, the "
            "lamp of the result's first shot unless given.",
        ),
    ] = None,
    dark: DarkPhoto = None,
    space: Annotated[
        str, typer.Option(metavar="NAME", help="srgb, display-p3, or linear XYZ: xyz-d65, xyz-d50.")
    ] = "srgb",
    bits: Annotated[int, typer.Option(metavar="N", help="16, or 8 for PNG.")] = 16,
    compare: Annotated[
        tuple[str, str] | None,
        typer.Option(
            metavar="JSON PHOTO",
            show_default=False,
            help="Another camera's result and photo of the same scene in the same light: write a page, .html.",
        ),
    ] = None,
    region: Regions = None,
    other_region: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y,W,H", show_default=False, help="The same region in the other photo, if elsewhere."),
    ] = None,
    other_white_region: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,W,H[,SHARE]", show_default=False, help="The white surface in the other photo, if elsewhere."
        ),
    ] = None,
) -> None:
    """A photo as a picture in standard colour, with its uncertainty.

    Beside the picture a second one, NAME.uncertainty, holds the standard deviation of L*, a* and b* in hundredths.
    With --compare, one page shows what two cameras make of a scene, by their files' matrices and by their curves.
    """
    from camssf.documents.forms import to_plain
    from camssf.exports import exported
    from camssf.photo.read.raw import read_raw
    from camssf_colour.picture import standard_picture, white_of_region
    from camssf_colour.picture_document import picture_document
    from camssf_colour.picture_file import write_picture
    from camssf_colour.regions import measure_regions

    if compare is not None:
        there = other_region or region or [], other_white_region or white_region
        if dark is not None:
            raise InvalidArgument(
                "Two pictures are compared as they were taken, without a photo to subtract.",
                "Leave --dark away, or write each picture by itself.",
            )
        _write_comparison(out, (document, photo, region or [], white_region), (*compare, *there), lamp)
        return
    if region or other_region or other_white_region:
        raise InvalidArgument(
            "Regions are for --compare: a picture shows the whole photo.",
            "Add --compare RESULT PHOTO; or take `camssf colour` for the colours of regions.",
        )
    if white_region is None and lamp is None:
        raise InvalidArgument(
            "Nothing says what light the photo was taken in, or what is white in it.",
            "Add --white-region x,y,w,h of a white or grey surface in it, or name the lamp: --lamp daylight.",
        )
    result, mosaic, shading = _read(document, photo)
    curves, white, dark_photo = exported(result), None, read_raw(dark) if dark else None
    if white_region is not None:
        rectangle, reflectance = parse_white_region(white_region)
        (measured,) = measure_regions(mosaic, [rectangle], dark=dark_photo, lens_shading=shading)
        white = white_of_region(measured, reflectance)
    spec = curves.lamps[0] if lamp is None else lamp
    made = standard_picture(result, spec, mosaic, dark=dark_photo, white=white, space=space, lens_shading=shading)
    about = picture_document(made, Path(photo).name, curves, spec, Path(dark or "").name)
    written = write_picture(made, out, json.dumps(to_plain(about)), bits)
    emit(to_plain(about))
    say("[green]wrote[/]", f": {written.picture} and {written.uncertainty}")
    if made.white.dark_share is not None and made.white.signal_to_noise is not None:
        share, ratio = made.white.dark_share.max(), made.white.signal_to_noise.min()
        words = f": {share:.0%} of the light on the white surface; signal to noise of its pixels: {ratio:.0f}"
        say("subtracted", words)
    for share, words in (
        (written.clipped, "clipped, white in the picture"),
        (written.out_of_reach, "none that a surface has under this light"),
    ):
        if share > 0:
            say("", f"{share:.1%} of the picture: {words}")


def _read(document: str, photo: str) -> tuple[Result | Excerpt, Mosaic, str]:
    """A result, a photo of its camera and unit, and how lens shading is treated."""
    from camssf_colour.camera import make_and_model
    from camssf_colour.regions import read_photo_by

    result = read_curves_of(document)
    mosaic = read_photo_by(photo, make_and_model(result))
    check_unit(result, mosaic.unit, Path(photo).name)
    return result, mosaic, lens_shading_of(result) if mosaic.gain_maps else "as-stored"


def _write_comparison(
    out: Path,
    one: tuple[str, str, list[str], str | None],
    other: tuple[str, str, list[str], str | None],
    lamp: str | None,
) -> None:
    """The page of two photos, each with its result, regions and white region."""
    from camssf.exports import exported
    from camssf.files import write_file
    from camssf_colour.picture_comparison import ScenePhoto, comparison_page

    scenes = []
    for document, photo, regions, white_region in (one, other):
        if white_region is None or not regions:
            raise InvalidArgument(
                "Two pictures are compared in regions, beside a white or grey surface in the same light.",
                "Add --region x,y,w,h, once for each surface, and --white-region x,y,w,h.",
            )
        result, mosaic, shading = _read(document, photo)
        curves = exported(result)
        rectangles = [parse_rectangle("--region", each) for each in regions]
        white = parse_white_region(white_region)
        scenes.append(ScenePhoto(curves.camera, result, mosaic, lamp or curves.lamps[0], rectangles, white, shading))
    if out.suffix.lower() not in (".html", ".htm"):
        raise InvalidArgument(f"{out.name} is no name of a page.", "End it in .html.")
    write_file(out, comparison_page(*scenes))
    say("[green]wrote[/]", f": {out}")
