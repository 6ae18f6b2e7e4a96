"""The command that computes reflectances of regions of one or two photos."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from camssf.cli.reading import spare
from camssf.cli.terminal import emit, say
from camssf.errors import InvalidArgument
from camssf_colour.cli.regions import DarkPhoto, Regions, WhiteRegion, measure, read_curves_of


def spectrum(
    document: Annotated[str, typer.Argument(metavar="JSON", help="The result: a file, or - for stdin.")],
    photos: Annotated[
        list[str],
        typer.Argument(
            metavar="PHOTO...",
            help="RAW photo (DNG) by the same camera; a second one shows the same regions in another light.",
        ),
    ],
    region: Regions = None,
    white_region: WhiteRegion = None,
    lamp: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEC",
            show_default=False,
            help="The light of a photo (see `camssf lamps`), or auto: estimated from the white region; one a photo, "
            "in their order. Of one photo, the lamp of the result's first shot unless given.",
        ),
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
    dark: DarkPhoto = None,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            "-o",
            "--out",
            metavar="FILE",
            show_default=False,
            help="Write reflectances and standard deviations (.csv), or draw them (.svg), too; may be repeated.",
        ),
    ] = None,
) -> None:
    """Reflectance of regions of a photo, with its uncertainty.

    From 380 to 720 nm. Three or six numbers do not determine a spectrum: the answer is the measured surfaces of the
    prior that explain them. It states how far the signals are from the prior, and how much of the answer comes from
    the photo. XYZ and Lab are stated, too, under the first photo's light.
    """
    from camssf.documents.forms import to_plain
    from camssf.documents.unnamed_light import weighed_kinds_in_words
    from camssf.exports import exported
    from camssf.files import write_file
    from camssf.grid import BAND
    from camssf_colour.absorbance import index_weights
    from camssf_colour.camera import camera_of_result
    from camssf_colour.reflectance import FAR, LitSurfaces
    from camssf_colour.reflectance import spectrum as spectrum_of
    from camssf_colour.spectrum_document import spectrum_csv, spectrum_document
    from camssf_colour.spectrum_plot import spectrum_svg
    from camssf_colour.surface_prior import read_prior

    lamps = lamp or []
    if len(photos) > 2 or (len(lamps) != len(photos) and (lamps or len(photos) > 1)):
        raise InvalidArgument(
            f"{len(photos)} photo(s) but {len(lamps)} lamp(s).",
            "Give one photo, or two, and one --lamp a photo in the same order.",
        )
    writers = {".csv": spectrum_csv, ".svg": spectrum_svg}
    for file in out or ():
        spare(file, document, *photos)
        if file.suffix.casefold() not in writers:
            raise InvalidArgument(f"No spectra can be written as {file}.", "Name a file that ends in .csv or .svg.")
    surfaces, weights = read_prior(prior), dict(map(index_weights, index or []))
    result = read_curves_of(document)
    camera, curves = camera_of_result(result), exported(result)
    photographed, lit = [], []
    for photo, light in zip(photos, lamps or curves.lamps[:1], strict=True):
        measured = measure(result, photo, region or (), white_region, dark)
        lit.append(LitSurfaces(light, measured.signals, measured.errors, measured.reference))
        photographed.append((light, measured))
    spectra = spectrum_of(camera, *lit, prior=surfaces)
    written = spectrum_document(spectra, photographed, weights, curves)
    for file in out or ():
        write_file(file, writers[file.suffix.casefold()](spectra))
    emit(to_plain(written))
    if len(spectra.lamps) > 1:
        say("", weighed_kinds_in_words([(" and ".join(names), weight) for names, weight in spectra.lamps]))
    for number, surface in enumerate(written.regions, 1):
        band = BAND * float((spectra.standard_deviation[number - 1, 2:33] ** 2).mean() ** 0.5)
        words = f"band ± {band:.3f}, {surface.from_photo:.0%} of the prior's variance removed by the signals"
        for name, index_of in surface.indices.items():
            words += f", {name} {index_of.value:.3f} ± {BAND * index_of.standard_deviation:.3f}"
        say("", f"region {number}, prior {spectra.prior}: {words}")
        if surface.status != "ok":
            say(
                "[yellow]outside the prior[/]",
                f": region {number} is {surface.distance:.1f} standard deviations from every surface of the prior "
                f"{spectra.prior} (limit {FAR:g}); its spectrum and band do not hold. Take another prior.",
            )
