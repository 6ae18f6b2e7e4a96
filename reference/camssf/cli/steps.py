"""The command calibrate, and its single steps, to be joined by pipes: patches, solve, validate, report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from camssf.cli.options import (
    L2,
    BasisName,
    Chart,
    ChartTolerance,
    Corners,
    Darks,
    Document,
    Engine,
    Fit,
    Gamma,
    Lamps,
    LampTolerances,
    LensShading,
    LightPerPatch,
    Out,
    OutFolder,
    Photos,
    Png,
    Previous,
    Revoked,
    Signed,
    TrustedKeys,
    Truth,
    WhiteReflectance,
    Whites,
)
from camssf.cli.reading import (
    parse_chart,
    parse_options,
    parse_shots,
    read_document,
    read_previews,
    read_result,
    read_result_bytes,
)
from camssf.cli.terminal import emit, finish, kept_in, pass_on, product_of, progress_bar, say, summarise
from camssf.errors import InvalidArgument
from camssf.libraries import RESULTS, extension
from camssf.progress import part_of

REPORTING = 0.75
"""Part of a calibration's time, for progress, after which the report is written."""


def calibrate(
    photos: Photos,
    lamp: Lamps = None,
    white: Whites = None,
    dark: Darks = None,
    chart: Chart = "classic24",
    corners: Corners = None,
    white_reflectance: WhiteReflectance = None,
    lamp_tolerance: LampTolerances = None,
    chart_tolerance: ChartTolerance = None,
    lens_shading: LensShading = "as-stored",
    basis: BasisName = "auto",
    fit: Fit = None,
    signed: Signed = False,
    l2: L2 = None,
    gamma: Gamma = None,
    engine: Engine = "onnx",
    light_per_patch: LightPerPatch = None,
    previous: Previous = None,
    truth: Truth = None,
    out: Out = None,
    png: Png = False,
) -> None:
    """RAW photos of a chart to the camera's curves."""
    with progress_bar() as progress:
        from camssf.calibration import attempt
        from camssf.report.build import report, result_folder, verdict_in
        from camssf.report.provenance import read_provenance
        from camssf.result import Result

        if out is not None:
            result_folder(out)
            if previous is not None and Path(previous).resolve().parent == out.resolve():
                raise InvalidArgument(
                    f"{out} holds the previous result.", "Name another folder with -o: keep that one."
                )
        result: Result = product_of(
            attempt(
                parse_shots(
                    photos,
                    lamp,
                    white,
                    dark,
                    corners=corners,
                    lamp_tolerance=lamp_tolerance,
                    lens_shading=lens_shading,
                ),
                chart=parse_chart(chart, chart_tolerance),
                options=parse_options(
                    white_reflectance=white_reflectance,
                    basis=basis,
                    fit=fit,
                    signed=signed,
                    l2=l2,
                    gamma=gamma,
                    engine=engine,
                    light_per_patch=light_per_patch,
                ),
                truth=truth,
                previous=previous,
                progress=part_of(progress, 0.0, REPORTING),
            ),
            out,
            photos,
        )
        if out is None:
            emit(result)
        else:
            progress("writing the report", REPORTING)
            page = report(result, result.previews, provenance=read_provenance(photos), png=png)
            if result.verdict.status == "doubtful" and verdict_in(out) == "accepted":
                say("", f"{out} held an accepted result; this doubtful one takes its place")
            page.save(out)
    summarise(result, None if out is None else out / "report.html")
    finish(result)


def patches(
    photos: Photos,
    lamp: Lamps = None,
    white: Whites = None,
    dark: Darks = None,
    chart: Chart = "classic24",
    corners: Corners = None,
    white_reflectance: WhiteReflectance = None,
    lamp_tolerance: LampTolerances = None,
    chart_tolerance: ChartTolerance = None,
    lens_shading: LensShading = "as-stored",
) -> None:
    """Measure the patches: JSON for `solve`."""
    with progress_bar() as progress:
        from camssf.calibration import attempted
        from camssf.documents.document import FORMAT
        from camssf.documents.document import Document as CaptureDocument
        from camssf.photo.capture import Capture, measure
        from camssf.version import __version__

        def stage() -> Capture:
            return measure(
                parse_shots(
                    photos,
                    lamp,
                    white,
                    dark,
                    corners=corners,
                    lamp_tolerance=lamp_tolerance,
                    lens_shading=lens_shading,
                ),
                chart=parse_chart(chart, chart_tolerance),
                options=parse_options(white_reflectance=white_reflectance),
                progress=progress,
            )

        capture = product_of(attempted(stage), None)
    emit(CaptureDocument(format=FORMAT, version=__version__, capture=capture))
    for shot in capture.shots:
        say("", f"{shot.photo.name}: {len(shot.means.chart.mean)} patches measured")


def solve(
    document: Document = "-",
    basis: BasisName = "auto",
    fit: Fit = None,
    signed: Signed = False,
    l2: L2 = None,
    gamma: Gamma = None,
    engine: Engine = "onnx",
    light_per_patch: LightPerPatch = None,
    previous: Previous = None,
) -> None:
    """Patches to curves: JSON in, JSON out.

    Takes what `patches` printed, what a phone saved, or a result, whose photos are solved again. A refusal of the
    command before the pipe is passed on as it is.
    """
    given = read_document(document)
    from camssf.result import Result

    capture = given.capture
    if isinstance(given, Result) and (capture is None or capture.unfinished is not None):
        pass_on(given)
        return
    assert capture is not None
    with progress_bar() as progress:
        from camssf.calibration import attempted
        from camssf.calibration import solve as run
        from camssf.spectra import CameraCurves

        options = parse_options(
            basis=basis,
            fit=fit,
            signed=signed,
            l2=l2,
            gamma=gamma,
            engine=engine,
            light_per_patch=light_per_patch,
        )
        result: Result = product_of(
            attempted(lambda: run(capture, options=options, previous=previous, progress=progress)),
            None,
        )
        if isinstance(given, Result) and given.truth is not None:
            truth = given.truth
            result = result.with_truth(CameraCurves(truth.name, truth.curves.values, "the result"))
    pass_on(result)


def validate(
    document: Document = "-",
    truth: Truth = None,
) -> None:
    """Score a result against measured curves.

    Prints the errors and passes the result on with the truth filled in; without --truth as it is, once checked.
    """
    result = read_result(document)
    if truth is not None:
        from camssf.spectra import read_camera

        result = result.with_truth(read_camera(truth))
    pass_on(result)


def report(
    document: Document = "-",
    out: OutFolder = Path("out"),
    photo: Annotated[
        list[str] | None,
        typer.Option(
            metavar="DNG",
            show_default=False,
            help="Photo of a shot, to show it and to read unit, lens and time; in the shots' order.",
        ),
    ] = None,
    passport: Annotated[
        str | None,
        typer.Option(metavar="JWS", show_default=False, help="Passport of this result: unit, validity, signature."),
    ] = None,
    key: TrustedKeys = None,
    revoked: Revoked = None,
) -> None:
    """Write the page and the files of a result.

    result.json, ssf.csv, patches.csv, ssf.svg and report.html.
    """
    with progress_bar() as progress:
        from camssf.report.build import report as render
        from camssf.report.build import result_folder
        from camssf.report.provenance import read_provenance

        result_folder(out)
        if passport is None and (key or revoked):
            raise InvalidArgument("--key needs a passport, and none was given.", "Add --passport JWS.")
        result, data = read_result_bytes(document)
        previews = read_previews(result, photo or [])
        signed = None if passport is None else extension(RESULTS, "passport")
        provenance = replace(
            read_provenance(photo or []),
            signature=None if signed is None else signed.read_signature(passport, data, key or [], revoked),
        )
        progress("writing the report", 0.5)
        written = render(result, previews, provenance=provenance).save(out)
    summarise(result, written[-1])
    if kept := kept_in(out, written):
        say("", kept.rstrip())
    finish(result)
