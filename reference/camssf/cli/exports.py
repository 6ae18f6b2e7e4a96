"""Commands that put a result to use: export, colour."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from camssf.cli.options import Document, LensShading
from camssf.cli.reading import parse_rectangle, parse_share, read_result
from camssf.cli.terminal import emit, say

FORMATS = "rawtoaces, spectacle, csv, dcp, icc, clf, colour"
"""Those of `camssf.exports.formats`, which is not loaded to print the help."""


def export(
    document: Document = "-",
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help=f"One of {FORMATS}.")] = "csv",
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="FILE", show_default=False, help="The file to write.")
    ] = None,
    licence: Annotated[
        str | None,
        typer.Option(metavar="TEXT", show_default=False, help="Of the curves, for formats that ask: CC-BY-4.0."),
    ] = None,
    lamp: Annotated[
        str | None,
        typer.Option(metavar="SPEC", show_default="D65", help="That the matrix of icc and clf is made for."),
    ] = None,
) -> None:
    """Write a result in another program's format.

    Its verdict and its hash stand in the file's description. A refused result has nothing to export.
    """
    from camssf.errors import InvalidArgument
    from camssf.exports import FORMATS
    from camssf.exports import export as write
    from camssf.exports.formats import MATRIX_LAMP, UNSTATED
    from camssf.files import write_file

    if out is None:
        raise InvalidArgument("No file was named to export to.", "Add -o FILE.")
    told = UNSTATED if licence is None else licence
    light = MATRIX_LAMP if lamp is None else lamp
    write_file(out, write(read_result(document), to, licence=told, lamp=light))
    say("", f"{FORMATS[to].what}: {out}")


def colour(
    document: Annotated[str, typer.Argument(metavar="JSON", help="The result: a file, or - for stdin.")],
    photo: Annotated[str, typer.Argument(metavar="PHOTO", help="RAW photo (DNG) by the same camera.")],
    region: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y,W,H", show_default=False, help="What to measure, px; repeat it for more."),
    ] = None,
    white_region: Annotated[
        str | None,
        typer.Option(metavar="X,Y,W,H", show_default=False, help="A white or grey surface in the same light, px."),
    ] = None,
    white_reflectance: Annotated[
        str | None,
        typer.Option(metavar="SHARE", show_default=False, help="Reflectance of that surface; 1 unless given."),
    ] = None,
    lamp: Annotated[
        str | None,
        typer.Option(
            metavar="SPEC",
            show_default=False,
            help="The light (see `camssf lamps`), or auto: what the white region's ratios say. "
            "The lamp of the result's first shot unless given.",
        ),
    ] = None,
    observer: Annotated[str, typer.Option(metavar="YEAR", help="1931 (2°) or 1964 (10°).")] = "1931",
    adapt: Annotated[str, typer.Option(metavar="WHITE", help="lamp, or adapted by CAT16 to D50 or D65.")] = "lamp",
    dark: Annotated[
        str | None, typer.Option(metavar="DNG", show_default=False, help="Dark frame: lens cap on, same exposure.")
    ] = None,
    lens_shading: LensShading = "as-stored",
) -> None:
    """Standard colour of regions of a photo, with its uncertainty.

    CIE XYZ and Lab, and where their covariance comes from. Exits with 8 where a colour is none that a surface has.
    """
    from camssf.colour.camera import camera_of_result
    from camssf.colour.document import colour_document
    from camssf.colour.reach import REACH, check_reach
    from camssf.colour.regions import against, measure_regions
    from camssf.colour.standard import REFERENCE_TOLERANCE, Reference, View, standard_colour
    from camssf.errors import FramesDiffer, InvalidArgument
    from camssf.exports import read_result as read_curves
    from camssf.photo.mosaic import read_dng

    if not region or white_region is None:
        raise InvalidArgument(
            "A colour needs a region, and a white or grey surface in the same light.",
            "Add --region x,y,w,h and --white-region x,y,w,h; without a reference nobody knows how much light falls "
            "on the surface.",
        )
    view, result = View(observer, adapt), read_result(document)
    camera, curves = camera_of_result(result), read_curves(result)
    rectangles = [parse_rectangle("--white-region", white_region), *(parse_rectangle("--region", r) for r in region)]
    mosaic = read_dng(photo)
    if any(
        ours and theirs and ours != theirs
        for ours, theirs in ((result["camera"]["make"], mosaic.make), (result["camera"]["model"], mosaic.model))
    ):
        raise FramesDiffer(
            f"{photo} was taken by {mosaic.make} {mosaic.model}, the result is of {curves.camera}.",
            "Calibrate that camera; each has its own curves.",
        )
    white, *found = measure_regions(
        mosaic, rectangles, dark=None if dark is None else read_dng(dark), lens_shading=lens_shading
    )
    share = parse_share(white_reflectance)
    reflectance = 1.0 if share is None else share
    y, error = against(found, white, reflectance)
    reference = Reference(REFERENCE_TOLERANCE, white.raw, float((white.error / white.raw).max()))
    told = curves.lamps[0] if lamp is None else lamp
    colours = standard_colour(camera, told, y, error, reference=reference, view=view)
    about = {
        "result": curves.about,
        "photo": {"name": Path(photo).name, "sha256": mosaic.sha256},
        "lamp": told,
        "reference": {"reflectance": reflectance, "tolerance": reference.tolerance},
    }
    emit(colour_document(colours, y, error, found, white, about))
    for number, (lab, spread) in enumerate(zip(colours.lab, colours.lab_covariance, strict=True), 1):
        if not colours.reach[number - 1] > REACH:  # NaN: so many that nobody asked
            words = " ".join(
                f"{name} {value:.1f} ± {1.96 * size:.1f}"
                for name, value, size in zip(("L*", "a*", "b*"), lab, spread.diagonal() ** 0.5, strict=True)
            )
            say("", f"region {number}: {words}")
    check_reach(colours.reach)
