"""The command that computes reflectances of regions of one or two photos."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

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
from camssf.cli.reading import spare
from camssf.cli.regions import RegionRequest, check_unit_of, measure, no_region, read_curves_of
from camssf.cli.terminal import emit, say
from camssf.errors import InvalidArgument


def spectrum(
    document: Annotated[str, typer.Argument(metavar="JSON", help="The result: a file, or - for stdin.")],
    photo: Annotated[str, typer.Argument(metavar="PHOTO", help="RAW photo (DNG) by the same camera.")],
    region: Regions = None,
    white_region: WhiteRegion = None,
    white_reflectance: RegionReflectance = None,
    lamp: RegionLamp = None,
    photo2: Annotated[
        str | None,
        typer.Option(metavar="PHOTO", show_default=False, help="The same regions under another light."),
    ] = None,
    lamp2: Annotated[
        str | None, typer.Option(metavar="SPEC", show_default=False, help="The light of --photo2.")
    ] = None,
    prior: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="general, skin, or a file of measured reflectances.")
    ] = "general",
    index: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME|FILE",
            show_default=False,
            help="Index of absorbance: erythema, melanin, or a file of wavelengths and weights; may be repeated.",
        ),
    ] = None,
    observer: Observer = "1931",
    adapt: Adapt = "lamp",
    csv: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default=False, help="Write reflectances and standard deviations, too."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default=False, help="Draw them with 95 % bands: .png, .svg or .pdf."),
    ] = None,
    dark: RegionDark = None,
    lens_shading: LensShading = "as-stored",
) -> None:
    """Reflectance of regions of a photo, with its uncertainty.

    From 380 to 720 nm. Three or six numbers do not determine a spectrum: the answer is the measured surfaces of the
    prior that explain them. It states how far the signals are from the prior, and how much of the answer comes from
    the photo. XYZ and Lab are stated, too, under the first photo's light.
    """
    from camssf.colour.absorbance import index_weights
    from camssf.colour.camera import camera_of_result
    from camssf.colour.reflectance import FAR, LitSurfaces
    from camssf.colour.reflectance import spectrum as spectrum_of
    from camssf.colour.spectrum_document import spectrum_csv, spectrum_document
    from camssf.colour.surface_prior import read_prior
    from camssf.colour.view import View
    from camssf.exports import read_result as read_curves
    from camssf.files import write_file
    from camssf.report.spectrum_plot import check_picture, spectrum_picture

    if not region or white_region is None:
        raise no_region()
    if (photo2 is None) != (lamp2 is None):
        raise InvalidArgument(
            "A second photo needs its light, and a second light its photo.", "Give both --photo2 and --lamp2."
        )
    inputs = [each for each in (document, photo, photo2) if each is not None]
    for out in (csv, plot):
        if out is not None:
            spare(out, *inputs)
    if plot is not None:
        check_picture(plot.suffix)
    view, surfaces, weights = View(observer, adapt), read_prior(prior), dict(map(index_weights, index or []))
    result = read_curves_of(document)
    camera, curves = camera_of_result(result), read_curves(result)
    lamps = [curves.lamps[0] if lamp is None else lamp, lamp2 or ""]
    photos, lit, regions = [], [], []
    for path, light in zip(inputs[1:], lamps, strict=False):
        request = RegionRequest(path, region, white_region, white_reflectance, dark, lens_shading)
        found = measure(request, result["camera"], curves.camera)
        check_unit_of(result, found)
        lit.append(LitSurfaces(light, found.signals, found.errors, found.reference))
        regions = found.regions
        reference = {
            "reflectance": found.reflectance,
            "tolerance": found.reference.tolerance,
            "rectangle": list(found.white.rectangle),
            "raw": found.white.raw.tolist(),
        }
        photos.append(
            {"photo": found.photo, "lamp": light, "reference": reference}
            | {"signals": found.signals, "errors": found.errors}
        )
    spectra = spectrum_of(camera, *lit, prior=surfaces, view=view)
    written = spectrum_document(spectra, photos, regions, weights, {"result": curves.about})
    if csv is not None:
        write_file(csv, spectrum_csv(spectra))
    if plot is not None:
        write_file(plot, spectrum_picture(spectra, plot.suffix))
    emit(written)
    for number, each in enumerate(written["regions"], 1):
        band = 1.96 * float((spectra.standard_deviation[number - 1, 2:33] ** 2).mean() ** 0.5)
        words = f"band ± {band:.3f}, {each['from_photo']:.0%} of the prior's variance removed by the signals"
        for name, value in each["indices"].items():
            words += f", {name} {value['value']:.3f} ± {1.96 * value['standard_deviation']:.3f}"
        say("", f"region {number}, prior {spectra.prior}: {words}")
        if each["status"] != "ok":
            say(
                "[yellow]outside the prior[/]",
                f": region {number} is {each['distance']:.1f} standard deviations from every surface of the prior "
                f"{spectra.prior} (limit {FAR:g}); its spectrum and band do not hold. Take another prior.",
            )
