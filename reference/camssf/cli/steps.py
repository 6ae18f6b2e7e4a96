"""Commands for single steps, to be joined by pipes: patches, solve, validate, report."""

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
    OutFolder,
    Photos,
    Previous,
    Signed,
    Truth,
    WhiteReflectance,
    Whites,
)
from camssf.cli.reading import (
    PATCHES,
    RESULT,
    name_of,
    parse_chart,
    parse_patches,
    parse_percent,
    parse_share,
    parse_shots,
    read_json,
    read_previews,
    read_result,
    read_result_bytes,
    read_signature,
)
from camssf.cli.terminal import emit, finish, kept_in, pass_on, product_of, progress_bar, say, summarise
from camssf.errors import InvalidArgument


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
    from camssf.calibration import recorded
    from camssf.documents.patches_json import patches_document
    from camssf.options import Options
    from camssf.photo.capture import Capture, Record, measure

    def stage(record: Record) -> Capture:
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
            options=Options(white_reflectance=parse_share(white_reflectance)),
            progress=progress,
            record=record,
        )

    with progress_bar() as progress:
        capture = product_of(recorded(stage), None)
    emit(patches_document(capture))
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
    truth: Truth = None,
) -> None:
    """Patches to curves: JSON in, JSON out.

    A refusal of the command before the pipe is passed on as it is.
    """
    from camssf.calibration import recorded
    from camssf.calibration import solve as run
    from camssf.documents.patches_json import read_patches
    from camssf.options import Options

    given = read_json(document, PATCHES, refusal=True)
    if given["format"] == RESULT:
        from camssf.documents.result_json import check_document

        pass_on(check_document(given, name_of(document)))
        return
    capture = read_patches(given)
    options = Options(
        basis=basis,
        fit=parse_patches(fit),
        nonnegative=False if signed else None,
        l2=l2,
        gamma=gamma,
        engine=engine,
        light_per_patch=parse_percent("--light-per-patch", light_per_patch),
    )
    with progress_bar() as progress:
        result = product_of(
            recorded(
                lambda record: run(
                    capture, options=options, truth=truth, previous=previous, progress=progress, record=record
                )
            ),
            None,
        )
    pass_on(result.document())


def validate(
    document: Document = "-",
    truth: Truth = None,
) -> None:
    """Score a result against measured curves.

    Passes the result on with scores.rmse and the truth filled in; without --truth as it is, once checked.
    """
    result = read_result(document)
    if "ssf" in result and truth is not None:
        from camssf.documents.result_json import compare
        from camssf.spectra import read_camera

        compare(result, read_camera(truth))
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
    compare: Annotated[
        str | None,
        typer.Option(
            metavar="JSON", show_default=False, help="Another result: of this unit earlier, or of a reference unit."
        ),
    ] = None,
    passport: Annotated[
        str | None,
        typer.Option(metavar="JWS", show_default=False, help="Passport of this result: unit, validity, signature."),
    ] = None,
    key: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="PEM",
            show_default=False,
            help="Verify the passport with this trusted public key. May be repeated.",
        ),
    ] = None,
    revoked: Annotated[
        Path | None,
        typer.Option(metavar="JWS", show_default=False, help="Signed list of revoked passports and keys."),
    ] = None,
) -> None:
    """Write result.json, ssf.csv, ssf.png and report.html."""
    from camssf.report.build import report as render
    from camssf.report.build import result_folder
    from camssf.report.provenance import read_provenance

    result_folder(out)
    if passport is None and (key or revoked):
        raise InvalidArgument("--key needs a passport, and none was given.", "Add --passport JWS.")
    with progress_bar() as progress:
        result, data = read_result_bytes(document)
        previews = read_previews(result, photo or [])
        provenance = replace(
            read_provenance(photo or []),
            signature=None if passport is None else read_signature(passport, data, key or [], revoked),
            other=None if compare is None else read_result(compare),
            other_name="" if compare is None else name_of(compare),
        )
        if provenance.other is not None and "ssf" not in provenance.other:
            raise InvalidArgument(f"{compare} was refused: it has no curves.", "Compare with a result that has some.")
        progress("writing the report", 0.5)
        written = render(result, previews, provenance=provenance).save(out)
    summarise(result, written[-1])
    if kept := kept_in(out, written):
        say("", kept.rstrip())
    finish(result)
