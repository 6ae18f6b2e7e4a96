"""Draws the PNG of a result document's curves."""

from __future__ import annotations

from camssf.fonts import prepare_matplotlib
from camssf.report.notebook import lamps_of
from camssf.report.plots import INK, QUIET, draw_curves
from camssf.report.sections.curves import curves_of
from camssf.report.sections.text import Json, camera_name


def picture(document: Json) -> bytes:
    """A PNG of the curves with their 95 % bands, and of the truth if the document holds it."""
    from io import BytesIO

    prepare_matplotlib()
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    curves = curves_of(document)
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        figure = Figure(figsize=(9.6, 5.4), dpi=150, facecolor="white")
        axes = figure.add_axes((0.075, 0.115, 0.9, 0.75))
        draw_curves(axes, curves)
        note = "curves" if curves.low is None else "curves with 95 % bands"
        if curves.truth is not None:
            note += f"; dashed: {_short_name(document['truth']['name'])}"
        # Names are untrusted input: "$" must not start a formula, and rare characters may have no glyph.
        figure.text(0.075, 0.94, _title(document), color=INK, fontsize=14, fontweight="bold", parse_math=False)
        figure.text(0.075, 0.895, note, color=QUIET, fontsize=10.5, parse_math=False)
        file = BytesIO()
        FigureCanvasAgg(figure).print_png(file, metadata={"Software": None})
    return file.getvalue()


def _short_name(text: str, length: int = 60) -> str:
    """The text with at most `length` characters, all of them in every build of the plot's font."""
    text = "".join(c if c.isprintable() and ord(c) < 0x250 else "?" for c in text)
    return text if len(text) <= length else text[: length - 3] + "..."


def _title(document: Json) -> str:
    return f"{_short_name(camera_name(document), 50)}, {_short_name(lamps_of(document), 60)}"
