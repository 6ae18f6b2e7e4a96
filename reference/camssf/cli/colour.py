"""The command that computes standard colour with a result, and converts signals between two cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from camssf.cli.options import (
    Adapt,
    LensShading,
    Observer,
    RegionDark,
    RegionLamp,
    RegionReflectance,
    Regions,
    WhiteRegion,
)
from camssf.cli.reading import parse_signal
from camssf.cli.regions import RegionRequest, check_unit_of, measure, no_region, read_curves_of
from camssf.cli.terminal import emit, say
from camssf.errors import InvalidArgument


def colour(
    document: Annotated[
        str | None,
        typer.Argument(
            metavar="JSON|JWS",
            help="The result, or its passport: a file, or - for stdin. None with --from.",
        ),
    ] = None,
    photo: Annotated[str | None, typer.Argument(metavar="PHOTO", help="RAW photo (DNG) by the same camera.")] = None,
    region: Regions = None,
    white_region: WhiteRegion = None,
    white_reflectance: RegionReflectance = None,
    lamp: RegionLamp = None,
    observer: Observer = "1931",
    adapt: Adapt = "lamp",
    dark: RegionDark = None,
    lens_shading: LensShading = "as-stored",
    key: Annotated[
        list[Path] | None,
        typer.Option(metavar="PEM", show_default=False, help="For a passport: a trusted public key."),
    ] = None,
    revoked: Annotated[
        Path | None,
        typer.Option(metavar="JWS", show_default=False, help="Signed list of revoked passports and keys."),
    ] = None,
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="JSON", show_default=False, help="Convert from this camera's result ..."),
    ] = None,
    to: Annotated[
        str | None, typer.Option("--to", metavar="JSON", show_default=False, help="... to this camera's signals.")
    ] = None,
    signal: Annotated[
        list[str] | None,
        typer.Option(
            metavar="R,G,B",
            show_default=False,
            help="With --from and --to: signals to convert, raw divided by that of white; may be repeated.",
        ),
    ] = None,
) -> None:
    """Standard colour of regions of a photo, with its uncertainty.

    CIE XYZ and Lab, and where their covariance comes from. With --from and --to no colour, but raw signals of one
    camera as another would have given them: of a PHOTO's regions, of --signal, or the conversion alone. Exits with 9
    where a colour is none that a surface has.
    """
    if source is None and to is None:
        if document is None or photo is None or signal:
            raise InvalidArgument(
                "A colour needs a result and a region of a photo.",
                "Name the result and the photo; or --from and --to to convert between two cameras.",
            )
        request = RegionRequest(photo, region or (), white_region, white_reflectance, dark, lens_shading)
        _standard(read_curves_of(document, key or (), revoked), request, lamp, observer, adapt)
        return
    if source is None or to is None:
        raise InvalidArgument("A conversion needs two cameras.", "Give both --from and --to.")
    if key or revoked is not None:
        raise InvalidArgument("A conversion takes results, not passports.", "Leave --key and --revoked out.")
    if photo is not None or observer != "1931" or adapt != "lamp":
        raise InvalidArgument(
            "A conversion takes two results and at most one photo, and no observer.",
            "Write camssf colour photo.dng --from a.json --to b.json; leave out --observer and --adapt.",
        )
    if (document is None) != (not region) or (document is not None and signal):
        raise InvalidArgument(
            "Signals to convert come either from a photo or from --signal.",
            "Give a photo with --region and --white-region, or --signal r,g,b, or neither.",
        )
    request = RegionRequest(document or "", region or (), white_region, white_reflectance, dark, lens_shading)
    _between(source, to, request, signal or [], lamp)


def _standard(result: dict[str, Any], request: RegionRequest, lamp: str | None, observer: str, adapt: str) -> None:
    from camssf.colour.camera import camera_of_result
    from camssf.colour.document import colour_document
    from camssf.colour.reach import REACH, check_reach
    from camssf.colour.standard import standard_colour
    from camssf.colour.view import View
    from camssf.exports import read_result as read_curves

    if not request.regions or request.white_region is None:
        raise no_region()
    view = View(observer, adapt)
    camera, curves = camera_of_result(result), read_curves(result)
    found = measure(request, result["camera"], curves.camera)
    check_unit_of(result, found)
    spec = curves.lamps[0] if lamp is None else lamp
    colours = standard_colour(camera, spec, found.signals, found.errors, reference=found.reference, view=view)
    about = {
        "result": curves.about,
        "photo": found.photo,
        "lamp": spec,
        "reference": {"reflectance": found.reflectance, "tolerance": found.reference.tolerance},
    }
    emit(colour_document(colours, found.signals, found.errors, found.regions, found.white, about))
    for number, (lab, spread) in enumerate(zip(colours.lab, colours.lab_covariance, strict=True), 1):
        if not colours.reach[number - 1] > REACH:  # NaN: reach is not computed for many regions
            words = " ".join(
                f"{name} {value:.1f} ± {1.96 * size:.1f}"
                for name, value, size in zip(("L*", "a*", "b*"), lab, spread.diagonal() ** 0.5, strict=True)
            )
            say("", f"region {number}: {words}")
    check_reach(colours.reach)


def _between(source: str, to: str, request: RegionRequest, signal: list[str], lamp: str | None) -> None:
    import numpy as np

    from camssf.colour.between import convert
    from camssf.colour.camera import camera_of_result
    from camssf.colour.document import between_document
    from camssf.colour.reach import REACH, check_reach
    from camssf.exports import read_result as read_curves

    given = [parse_signal(text) for text in signal]
    if source == to == "-":
        raise InvalidArgument("Standard input holds one result.", "Name a file for --from or for --to.")
    results = [read_curves_of(each) for each in (source, to)]
    ours, theirs = (camera_of_result(result) for result in results)
    one, other = (read_curves(result) for result in results)
    found = measure(request, results[0]["camera"], one.camera) if request.photo else None
    if found is not None:
        check_unit_of(results[0], found)
    y = np.array(given, dtype=np.float64).reshape(-1, 3) if found is None else found.signals
    error = np.zeros(y.shape) if found is None else found.errors
    spec = one.lamps[0] if lamp is None else lamp
    converted = convert(ours, theirs, spec, y, error, reference=None if found is None else found.reference)
    about: dict[str, Any] = {
        "from": one.about,
        "to": other.about,
        "lamp": spec,
        "photo": None if found is None else found.photo,
        "regions": [None] * len(y) if found is None else [list(each.rectangle) for each in found.regions],
    }
    emit(between_document(converted, y, error, about))
    likely = converted.conversions[int(np.argmax([weight for _, weight in converted.lamps]))]
    say(
        "",
        f"{one.camera} to {other.camera} under {likely.lamp}: {likely.kind}, misses {likely.rms[likely.kind]:.4f} of "
        "white on surfaces unseen",
    )
    for number, (values, spread) in enumerate(zip(converted.signals, converted.covariance, strict=True), 1):
        if not converted.reach[number - 1] > REACH:
            words = " ".join(
                f"{name} {value:.4f} ± {1.96 * size:.4f}"
                for name, value, size in zip("RGB", values, spread.diagonal() ** 0.5, strict=True)
            )
            say("", f"signal {number}: {words}")
    check_reach(converted.reach)
