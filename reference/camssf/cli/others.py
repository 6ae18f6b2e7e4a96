"""Further commands: parity, explain, and the lists of lamps, charts and cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from camssf.cli.options import (
    BasisName,
    Darks,
    Document,
    Fit,
    LightPerPatch,
    Photos,
    Signed,
    WhiteReflectance,
    Whites,
)
from camssf.cli.reading import given_frames, given_paths, parse_options, read_result, read_signed, spare
from camssf.cli.terminal import PARTED, emit, progress_bar, put, say


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
    basis: BasisName = "auto",
) -> None:
    """Compare a phone's result with this computer's.

    Says which stage differs first; exits with 1 where one does. --basis is for a refused result, which holds none.
    """
    with progress_bar() as progress:
        from camssf.compare.parity import cause, first
        from camssf.compare.parity import parity as compare

        findings = compare(
            read_result(document),
            given_paths(photos),
            white=given_frames(white),
            dark=given_frames(dark),
            lamps=lamp or (),
            chart=chart,
            options=parse_options(
                white_reflectance=white_reflectance,
                fit=fit,
                signed=signed,
                light_per_patch=light_per_patch,
                basis=basis,
            ),
            progress=progress,
        )
    for finding in findings:
        bound = f" ({finding.measured:.2g}, bound {finding.bound:.2g})" if finding.bound else ""
        mark = "[green]agrees[/]" if finding.agrees else "[bold red]differs[/]"
        say(f"{finding.stage:<12}{mark}: ", f"{finding.words}{bound}")
    one = first(findings)
    emit(
        {
            "format": "camssf-parity/1",
            "agrees": one is None,
            "first": None if one is None else one.stage,
            "stages": [
                vars(finding) | {"measured": finding.measured if finding.measured < float("inf") else None}
                for finding in findings
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


def cameras() -> None:
    """List the measured cameras known by name.

    Name, maker and source, between tabs.
    """
    from camssf.spectra import camera_names, read_camera

    lines = [(name, name.split()[0], read_camera(name).source.rpartition(" (")[2]) for name in camera_names()]
    put("\n".join("\t".join((*words, source.removesuffix(")"))) for *words, source in lines))


FORMATS = "rawtoaces, dcamprof, spectacle, csv, dcp, icc, clf, colour"
"""Names in `camssf.exports.formats`, repeated here so that the help does not load it."""


def export(
    document: Document = "-",
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help=f"One of {FORMATS}.")] = "csv",
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="FILE", show_default=False, help="The file to write.")
    ] = None,
    licence: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT",
            show_default=False,
            help="Licence of the curves, for formats that state one, as CC-BY-4.0.",
        ),
    ] = None,
    lamp: Annotated[
        str | None,
        typer.Option(metavar="SPEC", show_default="D65", help="Lamp for the matrix of icc and clf."),
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
        raise InvalidArgument("No output file was given.", "Add -o FILE.")
    terms = UNSTATED if licence is None else licence
    light = MATRIX_LAMP if lamp is None else lamp
    write_file(spare(out, document), write(read_signed(document), to, licence=terms, lamp=light))
    say("", f"{FORMATS[to].what}: {out}")
