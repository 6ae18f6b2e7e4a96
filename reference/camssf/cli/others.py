"""Further commands: direct, parity, explain, and the lists of lamps, charts and cameras."""

from __future__ import annotations

from typing import Annotated

import typer

from camssf.cli.options import Darks, Fit, LightPerPatch, Out, Photos, Signed, Truth, WhiteReflectance, Whites
from camssf.cli.reading import given_frames, given_paths, parse_patches, parse_percent, parse_share, read_result
from camssf.cli.terminal import PARTED, emit, progress_bar, put, say
from camssf.errors import InvalidArgument
from camssf.files import local_folder


def direct(
    frames: Annotated[
        list[str],
        typer.Argument(
            metavar="FRAME...",
            help="Sunlight's spectrum by the colour camera (DNG, or CSV pixel,red,green,blue) and by the mono camera "
            "(TIFF, DNG, or CSV pixel,signal); or one monochromator sweep (CSV wavelength_nm,red,green,blue,power).",
        ),
    ],
    dark: Annotated[
        str | None,
        typer.Option(metavar="DNG", show_default=False, help="The colour camera's frame with the slit closed."),
    ] = None,
    mono_dark: Annotated[
        str | None, typer.Option(metavar="FILE", show_default=False, help="The mono camera's frame, slit closed.")
    ] = None,
    response: Annotated[
        str | None,
        typer.Option(
            metavar="CSV",
            show_default=False,
            help="The mono camera's response, wavelength_nm,response; flat unless given.",
        ),
    ] = None,
    truth: Truth = None,
    out: Out = None,
) -> None:
    """Measure the curves with a spectrograph or a monochromator.

    The frames' wavelengths come from the Fraunhofer lines in them.
    """
    from camssf.direct import divide, sweep

    paths = given_paths("FRAME", frames)
    if out is not None:
        local_folder(out)
    known = None
    if truth is not None:
        from camssf.spectra import read_camera

        known = read_camera(truth)
    if len(paths) > 2 or (len(paths) == 1 and any((dark, mono_dark, response))):
        raise InvalidArgument(
            f"{len(paths)} file(s) do not fit this call.",
            "Give the colour and the mono camera's frame, or a sweep alone: a sweep takes no dark frame or response.",
        )
    with progress_bar() as progress:
        if len(paths) == 2:
            found = divide(paths[0], paths[1], dark=dark, mono_dark=mono_dark, response=response, progress=progress)
        else:
            found = sweep(paths[0])
        if out is None:
            emit(found.document())
        else:
            found.save(out)
    for role, dispersion in found.dispersions.items():
        names = " ".join(line.name for line in dispersion.lines)
        say("", f"{role}: {len(dispersion.lines)} lines ({names}), residual {dispersion.residual:.2f} nm")
    if known is not None:
        from camssf.fit.scores import rmse

        errors = " ".join(f"{value:.4f}" for value in rmse(found.values, known.values))
        say("", f"RMSE against the truth, red green blue: {errors}")
    if out is not None:
        say("", f"curves: {out / 'ssf.csv'}")


def parity(
    document: Annotated[str, typer.Argument(metavar="JSON", help="The result to compare: a file, or - for stdin.")],
    photos: Photos,
    lamp: Annotated[
        list[str] | None,
        typer.Option(metavar="SPEC", show_default=False, help="Replaces the result's, if that was a file."),
    ] = None,
    white: Whites = None,
    dark: Darks = None,
    chart: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", show_default=False, help="Replaces the result's, if that was a file."),
    ] = None,
    white_reflectance: WhiteReflectance = None,
    fit: Fit = None,
    signed: Signed = False,
    light_per_patch: LightPerPatch = None,
) -> None:
    """Compare a phone's result with this computer's.

    Says which stage differs first; exits with 1 where one does.
    """
    from camssf.compare.parity import cause, first
    from camssf.compare.parity import parity as compare
    from camssf.options import Options

    with progress_bar() as progress:
        findings = compare(
            read_result(document),
            given_paths("PHOTO", photos),
            white=given_frames("--white", white),
            dark=given_frames("--dark", dark),
            lamps=lamp or (),
            chart=chart,
            options=Options(
                white_reflectance=parse_share(white_reflectance),
                fit=parse_patches(fit),
                nonnegative=False if signed else None,
                light_per_patch=parse_percent("--light-per-patch", light_per_patch),
            ),
            progress=progress,
        )
    for each in findings:
        bound = f" ({each.measured:.2g}, bound {each.bound:.2g})" if each.bound else ""
        mark = "[green]agrees[/]" if each.agrees else "[bold red]differs[/]"
        say(f"{each.stage:<12}{mark}: ", f"{each.words}{bound}")
    one = first(findings)
    emit(
        {
            "format": "camssf-parity/1",
            "agrees": one is None,
            "first": None if one is None else one.stage,
            "stages": [
                vars(each) | {"measured": each.measured if each.measured < float("inf") else None}
                for each in findings
            ],
        }
    )
    if one is not None:
        say("[bold]first difference[/]: ", f"{one.stage}. {cause(one)}")
        raise typer.Exit(PARTED)


def explain(
    code: Annotated[
        str | None,
        typer.Argument(metavar="CODE", show_default=False, help="An error code; all are listed unless given."),
    ] = None,
) -> None:
    """Say what an error code means and what to do."""
    from camssf.error_codes import as_text, codes, explain_code

    put(as_text(explain_code(code)) if code is not None else "\n".join(codes()))


def lamps() -> None:
    """List the lamps known by name."""
    from camssf.spectra import lamp_names

    put("\n".join(lamp_names()))


def charts() -> None:
    """List the charts known by name."""
    from camssf.spectra import chart_names

    put("\n".join(chart_names()))


def cameras(
    result: Annotated[
        str | None,
        typer.Option(
            "--nearest",
            metavar="JSON",
            show_default=False,
            help="Rank the cameras by their distance from this result's curves.",
        ),
    ] = None,
    count: Annotated[int, typer.Option(metavar="N", min=1, help="How many, with --nearest.")] = 5,
) -> None:
    """List the measured cameras known by name.

    Name, maker and source, between tabs. With --nearest those that a result is most like, as JSON: distances in units
    of the result's own band.
    """
    if result is None:
        from camssf.spectra import camera_names, read_camera

        lines = [(name, name.split()[0], read_camera(name).source.rpartition(" (")[2]) for name in camera_names()]
        put("\n".join("\t".join((*words, source.removesuffix(")"))) for *words, source in lines))
        return
    from camssf.exports import read_result as read_curves
    from camssf.report.nearest import nearest, nearest_document

    document = read_result(result, excerpt=True)
    found, curves = nearest(document)[:count], read_curves(document)
    emit(nearest_document(found, curves.about))
    for each in found:
        size = f"RMS difference {100 * each.rms:.1f} % of the peak, {each.distance:.2f} times the uncertainty"
        say("", f"{each.name}: {size}")
