"""Draws a result's curves with their 95 % bands, and the truth if the result holds it."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from camssf.documents.document import Document, answer_in
from camssf.report.names import camera_of, lamps_of
from camssf.report.sections.curves import curves_of
from camssf.report.sections.drawings import curve_plot
from camssf.report.sections.text import clean
from camssf.report.svg import Label, Plot, whole_svg


def picture(document: Document) -> str:
    """An SVG file, white behind the curves, with camera and lamps as its title."""
    curves = curves_of(document)
    plot = _still(curve_plot(curves, 960, 540, 5, "wide", head=44), document)
    note = "curves" if curves.low is None else "curves with 95 % bands"
    if document.truth is not None:
        note += f"; dashed: {document.truth.name[:60]}"
    head = Label(plot.left, 26, clean(f"{camera_of(document)}, {lamps_of(document)}"), "start", "head")
    return whole_svg(replace(plot, texts=(*plot.texts, head, Label(plot.left, 46, clean(note), "start"))), "white")


def small_picture(document: Document) -> str:
    """An SVG element in the page's text colour, for a notebook."""
    return whole_svg(_still(curve_plot(curves_of(document), 480, 240, 10, "narrow"), document))


def _still(plot: Plot, document: Document) -> Plot:
    """The plot without what the pointer shows, named after its curves: ids are unique on a notebook's page."""
    name = hashlib.sha256(answer_in(document).curves.green.tobytes()).hexdigest()[:8]
    return replace(plot, name=f"curves-{name}", readouts=())
