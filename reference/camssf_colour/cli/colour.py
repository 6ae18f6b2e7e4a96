"""The command that computes standard colour with a result."""

from __future__ import annotations

from typing import Annotated

import typer

from camssf.cli.terminal import emit, say
from camssf_colour.cli.regions import DarkPhoto, Regions, WhiteRegion, measure, read_curves_of


def colour(
    document: Annotated[str, typer.Argument(metavar="JSON", help="The result: a file, or - for stdin.")],
    photo: Annotated[str, typer.Argument(metavar="PHOTO", help="RAW photo (DNG) by the same camera.")],
    region: Regions = None,
    white_region: WhiteRegion = None,
    lamp: Annotated[
        str | None,
        typer.Option(
            metavar="SPEC",
            show_default=False,
            help="The light (see `camssf lamps`), or auto: estimated from the white region. "
            "The lamp of the result's first shot unless given.",
        ),
    ] = None,
    observer: Annotated[str, typer.Option(metavar="YEAR", help="1931 (2°) or 1964 (10°).")] = "1931",
    adapt: Annotated[str, typer.Option(metavar="WHITE", help="lamp, or adapted by CAT16 to D50 or D65.")] = "lamp",
    dark: DarkPhoto = None,
) -> None:
    """Standard colour of regions of a photo, with its uncertainty.

    CIE XYZ and Lab, and where their covariance comes from. Exits with 9 where a colour is none that a surface has.
    """
    from camssf.documents.forms import to_plain
    from camssf.documents.unnamed_light import weighed_kinds_in_words
    from camssf.exports import exported
    from camssf.grid import BAND
    from camssf_colour.camera import camera_of_result
    from camssf_colour.document import colour_document
    from camssf_colour.reach import REACH, check_reach
    from camssf_colour.standard import standard_colour
    from camssf_colour.view import View

    result, view = read_curves_of(document), View(observer, adapt)
    camera, curves = camera_of_result(result), exported(result)
    measured = measure(result, photo, region or (), white_region, dark)
    spec = curves.lamps[0] if lamp is None else lamp
    signals, errors = measured.signals, measured.errors
    colours = standard_colour(camera, spec, signals, errors, reference=measured.reference, view=view)
    emit(to_plain(colour_document(colours, measured, curves, spec)))
    for number, (lab, spread) in enumerate(zip(colours.lab, colours.lab_covariance, strict=True), 1):
        if not colours.reach[number - 1] > REACH:  # NaN: reach is not computed for many regions
            words = " ".join(
                f"{name} {value:.1f} ± {BAND * size:.1f}"
                for name, value, size in zip(("L*", "a*", "b*"), lab, spread.diagonal() ** 0.5, strict=True)
            )
            say("", f"region {number}: {words}")
    if len(colours.lamps) > 1:
        say("", weighed_kinds_in_words(colours.lamps))
    check_reach(colours.reach)
