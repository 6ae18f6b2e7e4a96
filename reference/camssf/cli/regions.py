"""Measures regions of a photo against a white one, for the commands that compute colours and spectra."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camssf.cli.reading import name_of, parse_rectangle, parse_share, read_list, read_received, read_result
from camssf.cli.terminal import say
from camssf.errors import InvalidArgument

if TYPE_CHECKING:
    from camssf.colour.regions import MeasuredRegions


@dataclass(frozen=True)
class RegionRequest:
    """The regions of a photo to measure, and how; texts as on the command line."""

    photo: str
    regions: Sequence[str]
    white_region: str | None
    white_reflectance: str | None
    dark: str | None
    lens_shading: str


def read_curves_of(source: str, keys: Sequence[Path] = (), revoked: Path | None = None) -> dict[str, Any]:
    """A result, or the excerpt of a passport, which has no covariance; prints a warning for the latter.

    Args:
        source: a result; a passport, signed, which needs keys; or the excerpt that `passport verify` printed.
        keys: trusted public keys; with them the source must be a passport, and is verified.
        revoked: the list of revoked passports and keys.

    Raises:
        PassportInvalid: the passport does not hold, or no key is given for it.
    """
    if keys:
        from camssf.documents.keys import read_public
        from camssf.documents.passport import as_document, verify

        data, trusted = read_received(source), read_public(keys)
        result = as_document(data, verify(data, trusted, revoked=read_list(revoked, trusted)))
    else:
        result = read_result(source, excerpt=True)
    if "excerpt" in result:
        say(
            "[yellow]without its covariance[/]",
            f": {name_of(source)} is the excerpt that a passport holds; colours look about twice as uncertain "
            "as with the whole result.json",
        )
    return result


def check_unit_of(result: dict[str, Any], found: MeasuredRegions) -> None:
    """Refuse a photo of another unit than that of the result's passport; without a passport nothing is known of it.

    Raises:
        UnitDiffers: it is of another unit.
    """
    if "excerpt" not in result:
        return
    from camssf.documents.passport import read

    passport, _ = read(result["excerpt"]["passport"].encode())
    passport.check_photo(found.unit, found.photo["name"])
    if passport.unit.serial and not found.unit.serial:
        words = f": {found.photo['name']} has no serial number, the passport is of {passport.unit.serial}"
        say("[yellow]unit not checked[/]", words)


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
    from camssf.colour.regions import measure_photo

    if request.white_region is None:
        raise no_region()
    share = parse_share(request.white_reflectance)
    white = parse_rectangle("--white-region", request.white_region)
    return measure_photo(
        request.photo,
        (camera, name),
        [parse_rectangle("--region", each) for each in request.regions],
        white,
        reflectance=1.0 if share is None else share,
        dark=request.dark,
        lens_shading=request.lens_shading,
    )
