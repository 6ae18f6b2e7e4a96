"""Measures regions of a photo against a white one, for the commands that compute colours and spectra."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from camssf.cli.reading import name_of, parse_rectangle, read_signed
from camssf.cli.terminal import say
from camssf.errors import InvalidArgument
from camssf.libraries import RESULTS, extension

if TYPE_CHECKING:
    from camssf.documents.excerpt import Excerpt
    from camssf.photo.read.unit import Unit
    from camssf.result import Result
    from camssf_colour.regions import MeasuredRegions

Regions: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(metavar="X,Y,W,H", show_default=False, help="Region to measure, px; may be repeated."),
]
WhiteRegion: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,W,H[,SHARE]",
        show_default=False,
        help="A white or grey surface in the same light, px; and its reflectance, 1 unless given.",
    ),
]

DarkPhoto: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="DNG",
        show_default=False,
        help="Photo to subtract, with the same exposure: lens cap on; or the same view with the torch off, for the "
        "colours under the torch alone.",
    ),
]


def read_curves_of(source: str) -> Result | Excerpt:
    """A result, or the excerpt that `passport verify` printed; prints a warning for the latter: no covariance."""
    from camssf.documents.excerpt import Excerpt

    result: Result | Excerpt = read_signed(source)
    if isinstance(result, Excerpt):
        say(
            "[yellow]without its covariance[/]",
            f": {name_of(source)} is the excerpt that a passport holds; colours look about twice as uncertain "
            "as with the whole result.json",
        )
    return result


def check_unit(result: Result | Excerpt, unit: Unit, photo: str) -> None:
    """Refuse a photo of another unit than that of the result's passport; without a passport nothing is known of it.

    Raises:
        UnitDiffers: it is of another unit.
    """
    from camssf.documents.excerpt import Excerpt

    if not isinstance(result, Excerpt):
        return
    passport = extension(RESULTS, "passport").check_photo_of(result, unit, photo)
    if passport.unit.serial and not unit.serial:
        words = f": {photo} has no serial number, the passport is of {passport.unit.serial}"
        say("[yellow]unit not checked[/]", words)


def measure(
    result: Result | Excerpt, photo: str, regions: Sequence[str], white_region: str | None, dark: str | None
) -> MeasuredRegions:
    """Signals of the photo's regions, relative to a perfect diffuser; regions as on the command line.

    Gain maps in the photo's file are applied if they were in the result's.

    Args:
        result: whose camera and, in a passport's excerpt, unit took the photo.
        photo, dark: RAW files.
        regions, white_region: rectangles; the latter's reflectance may follow.

    Raises:
        InvalidArgument: a region is missing or not a rectangle, or as `camssf_colour.regions.measure_photo`.
        UnitDiffers: the photo is of another unit than the passport.
    """
    from camssf_colour.camera import make_and_model
    from camssf_colour.regions import measure_photo

    if not regions or white_region is None:
        raise InvalidArgument(
            "A colour needs a region, and a white or grey surface in the same light.",
            "Add --region x,y,w,h and --white-region x,y,w,h; without a reference the amount of light on "
            "the surface is unknown.",
        )
    white, reflectance = parse_white_region(white_region)
    measured = measure_photo(
        photo,
        make_and_model(result),
        [parse_rectangle("--region", region) for region in regions],
        white,
        reflectance=reflectance,
        dark=dark,
        lens_shading=lens_shading_of(result),
    )
    check_unit(result, measured.unit, measured.photo.name)
    return measured


def lens_shading_of(result: Result | Excerpt) -> str:
    """How lens shading was treated in the photos of the result: "apply", its gain maps, or "as-stored"."""
    from camssf.documents.excerpt import Excerpt

    shots = result.shots if isinstance(result, Excerpt) else result.capture.shots if result.capture else ()
    return "apply" if any(shot.lens_shading == "apply" for shot in shots) else "as-stored"


def parse_white_region(text: str) -> tuple[tuple[float, float, float, float], float]:
    """A rectangle, and the reflectance that may follow it."""
    rectangle, share = (text.rpartition(",")[::2]) if text.count(",") == 4 else (text, "1")
    try:
        return parse_rectangle("--white-region", rectangle), float(share)
    except ValueError:
        raise InvalidArgument(
            f"--white-region {text!r} does not end in a reflectance.", "Write 18 % as 0.18: 700,480,40,40,0.18."
        ) from None
