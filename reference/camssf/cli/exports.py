"""The command that writes a result in another program's format."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from camssf.cli.options import Document
from camssf.cli.reading import read_result, spare
from camssf.cli.terminal import say

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
    write_file(spare(out, document), write(read_result(document, excerpt=True), to, licence=terms, lamp=light))
    say("", f"{FORMATS[to].what}: {out}")
